# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Datagrams of the protocol as the server reads and writes them; from the manual, its own codec.

A request is one line of text without an end. Numbers are read as C's ``atoi`` reads them. Knows no
meaning of a command.
"""

import re

LONGEST_REQUEST = 50
BLOCK = 512

_NUMBER = re.compile(r"\s*([+-]?\d+)")


def text_of(datagram: bytes) -> str:
    """The part of a request that the server understands: up to the first NUL of its buffer."""
    return datagram[:LONGEST_REQUEST].partition(b"\0")[0].decode("latin-1")


def reply(text: str) -> bytes:
    """Encode a reply as a datagram."""
    return text.encode("latin-1")


def integer(text: str) -> int:
    """The number that it begins with, or 0."""
    found = _NUMBER.match(text)
    return int(found[1]) if found else 0


def fields(text: str) -> list[str]:
    """The text behind each blank, up to the end."""
    return [text[place + 1 :] for place, letter in enumerate(text) if letter == " "]


def degrees(angle_deg: float) -> str:
    """An angle of RM."""
    return f"ok {angle_deg:.2f}"


def blocks(name: str, content: bytes) -> list[bytes]:
    """A file: its name and size, then its bytes."""
    head = reply(f"ok {name} {len(content)}")
    return [head, *(content[at : at + BLOCK] for at in range(0, len(content), BLOCK))]
