# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parser of the MART controller's datagrams. It accepts any bytes without an exception.

This module knows the forms of replies; it does not know the requests.
"""

import re
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.words import Form

LONGEST_REPLY: Final = 300
"""Longest reply in bytes; a longer datagram is a piece of a file."""
_FORMS: Final = (
    (Form.NOTHING, re.compile(r"")),
    (Form.INTEGER, re.compile(r"[-+]?\d{1,10}")),
    (Form.DECIMAL, re.compile(r"[-+]?(\d{1,25}\.\d{1,6}|nan|inf)")),
    (Form.TRUTH, re.compile(r"true|false")),
    (Form.FILE, re.compile(r"(\S.*) (\d{1,9})")),
    (Form.NAME, re.compile(r"[A-Za-z]\S*")),
)


@dataclass(frozen=True, slots=True)
class Ok:
    """A reply that begins with ``ok``.

    ``text``: the text after ``ok``.
    """

    form: Form
    text: str = ""

    @property
    def number(self) -> float:
        """The value of a reply of form INTEGER or DECIMAL."""
        return float(self.text)

    @property
    def file(self) -> tuple[str, int]:
        """The name of a file, and the size of this file in bytes, from a reply of form FILE."""
        name, _, size = self.text.rpartition(" ")
        return name, int(size)


@dataclass(frozen=True, slots=True)
class Fail:
    """A reply that begins with ``fail``.

    ``reason``: the text after ``fail``, which may be empty.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Other:
    """A datagram that is not a reply: a piece of a file, or data of another program."""

    data: bytes


Reply = Ok | Fail | Other


class MartDecoder:
    """The decoder of replies.

    ``foreign``: number of received datagrams that are not replies.

    A reply is always one complete datagram, so the decoder keeps no data between calls.
    """

    def __init__(self) -> None:
        self.foreign = 0

    def feed(self, data: bytes, now: float) -> list[Reply]:
        """Return the reply in one datagram as a list; empty for an empty datagram."""
        if not data:
            return []
        reply = parse(data)
        self.foreign += isinstance(reply, Other)
        return [reply]

    def flush(self, now: float) -> list[Reply]:
        """Return an empty list, because no data is kept between calls."""
        return []


def parse(data: bytes) -> Reply:
    """Return the reply in one datagram; ``Other`` if it is not a reply."""
    if len(data) > LONGEST_REPLY or not data.isascii():
        return Other(data)
    head, _, rest = data.decode("ascii").strip(" \0\t\r\n").partition(" ")
    rest = rest.strip()
    if head == "fail":
        return Fail(rest)
    if head != "ok":
        return Other(data)
    for form, pattern in _FORMS:
        if pattern.fullmatch(rest):
            return Ok(form, rest)
    return Other(data)


def signed(count: int) -> int:
    """Return ``count`` as a signed 32-bit number.

    Some servers send a negative count as an unsigned number, without the sign.
    """
    return (count + 2**31) % 2**32 - 2**31
