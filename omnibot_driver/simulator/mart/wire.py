# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Codec of the datagrams as the server reads and writes them, from the manual only.

Numbers are parsed as by C's ``atoi``. This module does not know commands.
"""

import re

LONGEST_REQUEST = 49
BLOCK = 512

_NUMBER = re.compile(r"\s*([+-]?\d+)")


def text_of(datagram: bytes) -> str:
    """Return the part of a request that the server reads: its first 49 bytes, up to a NUL."""
    return datagram[:LONGEST_REQUEST].partition(b"\0")[0].decode("latin-1")


def reply(text: str) -> bytes:
    """Encode a reply as a datagram."""
    return text.encode("latin-1")


def integer(text: str) -> int:
    """Return the number at the beginning of the text, or 0 without such a number."""
    found = _NUMBER.match(text)
    return int(found[1]) if found else 0


def fields(text: str) -> list[str]:
    """Return, for each space character in the text, everything after it.

    ``integer`` reads the number at the beginning of such a text.
    """
    return [text[place + 1 :] for place, letter in enumerate(text) if letter == " "]


def degrees(angle_deg: float) -> str:
    """Return the text with which RMCS and RMRA report an angle in degrees."""
    return f"ok {angle_deg:.2f}"


def blocks(name: str, content: bytes) -> list[bytes]:
    """Return the datagrams that contain a file: its name and size, then its bytes."""
    head = reply(f"ok {name} {len(content)}")
    return [head, *(content[at : at + BLOCK] for at in range(0, len(content), BLOCK))]
