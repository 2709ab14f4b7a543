# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Datagrams of the MART controller as replies. Never raises on what comes in.

Knows the forms of replies; not what was asked.
"""

import re
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.words import Form

LONGEST_REPLY: Final = 300
"""Bytes; what is longer is a piece of a file."""
_FORMS: Final = (
    (Form.NOTHING, re.compile(r"")),
    (Form.INTEGER, re.compile(r"[-+]?\d{1,10}")),
    (Form.DECIMAL, re.compile(r"[-+]?\d{1,9}\.\d{1,6}")),
    (Form.TRUTH, re.compile(r"true|false")),
    (Form.FILE, re.compile(r"(\S.*) (\d{1,9})")),
    (Form.NAME, re.compile(r"\S+")),
)


@dataclass(frozen=True, slots=True)
class Ok:
    """``ok`` and what follows it."""

    form: Form
    text: str = ""

    @property
    def number(self) -> float:
        """The value of an INTEGER or a DECIMAL."""
        return float(self.text)

    @property
    def file(self) -> tuple[str, int]:
        """The name of a FILE and its size in bytes."""
        name, _, size = self.text.rpartition(" ")
        return name, int(size)


@dataclass(frozen=True, slots=True)
class Fail:
    """``fail`` and the reason that follows it, which may be empty."""

    reason: str


@dataclass(frozen=True, slots=True)
class Other:
    """A datagram that is not a reply: a piece of a file, or of another program."""

    data: bytes


Reply = Ok | Fail | Other


class MartDecoder:
    """Each datagram is a whole, so nothing is held. ``foreign``: those that are not replies."""

    def __init__(self) -> None:
        self.foreign = 0

    def feed(self, data: bytes, now: float) -> list[Reply]:
        """Parse one datagram; an empty one gives nothing."""
        if not data:
            return []
        reply = parse(data)
        self.foreign += isinstance(reply, Other)
        return [reply]

    def flush(self, now: float) -> list[Reply]:
        """Return nothing, as no data is held."""
        return []


def parse(data: bytes) -> Reply:
    """Parse one datagram."""
    if len(data) > LONGEST_REPLY or not data.isascii():
        return Other(data)
    head, _, rest = data.rstrip(b" \0\r\n").decode("ascii").partition(" ")
    if head == "fail":
        return Fail(rest.strip())
    if head != "ok":
        return Other(data)
    for form, pattern in _FORMS:
        if pattern.fullmatch(rest):
            return Ok(form, rest)
    return Other(data)


def signed(count: int) -> int:
    """A signed number of 32 bits, as some servers omit the sign of a negative count."""
    return (count + 2**31) % 2**32 - 2**31
