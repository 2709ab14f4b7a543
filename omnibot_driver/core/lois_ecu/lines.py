# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One line of the protocol: command byte and 32-bit payload, as ASCII hex with a checksum.

``:<command><payload><checksum>\\n`` has 14 characters. Lines to a board may have no checksum.
"""

import re
import struct
from functools import reduce
from operator import xor
from typing import Final

from omnibot_driver.core.errors import FrameError
from omnibot_driver.core.values import value

BEGIN: Final = b":"
END: Final = b"\n"
LENGTH: Final = 14
LENGTH_WITHOUT_SUM: Final = 12
MARKER: Final = 0xFFFFFFFF
"""Payload of a marker, which is the line that begins a group. A group encodes one report."""

_SUMMED: Final = 11
_HEX: Final = re.compile(rb":[0-9a-fA-F]+\n").fullmatch
_FLOAT: Final = struct.Struct(">f")
_WORD: Final = struct.Struct(">I")


@value(frozen=True, slots=True)
class Line:
    """One line: ``command`` 0..255 and ``payload`` 0..2³²-1."""

    command: int
    payload: int


def checksum(text: bytes) -> int:
    """Return the checksum of a line: the XOR of its first eleven characters."""
    return reduce(xor, text[:_SUMMED], 0)


def encode_line(command: int, payload: int, *, with_sum: bool = True) -> bytes:
    """Return the characters of one line. Raises FrameError if a value is out of range."""
    if not (0 <= command <= 0xFF and 0 <= payload <= MARKER):
        raise FrameError(f"command {command} with payload {payload} does not fit into a line")
    text = b":%02x%08x" % (command, payload)
    return b"%s%02x\n" % (text, checksum(text)) if with_sum else text + END


def line_of(text: bytes, *, sum_required: bool = True) -> Line | None:
    """Parse the characters of one line, from ``:`` to the line feed; None if they are not valid.

    A carriage return may precede the line feed.
    """
    if text.endswith(b"\r\n"):
        text = text[:-2] + END
    if not _HEX(text):
        return None
    if len(text) == LENGTH:
        if int(text[_SUMMED:-1], 16) != checksum(text):
            return None
    elif sum_required or len(text) != LENGTH_WITHOUT_SUM:
        return None
    return Line(int(text[1:3], 16), int(text[3:_SUMMED], 16))


def from_pair(left: int, right: int) -> int:
    """Return the payload whose high 16-bit word is ``left`` and whose low one is ``right``.

    Both can be signed or unsigned. Raises FrameError if a number does not fit into 16 bits.
    """
    if not (-0x8000 <= left <= 0xFFFF and -0x8000 <= right <= 0xFFFF):
        raise FrameError(f"{left} and {right} do not fit into two 16-bit words")
    return (left & 0xFFFF) << 16 | right & 0xFFFF


def unsigned_pair(payload: int) -> tuple[int, int]:
    """Return the high and the low 16-bit word of a payload, unsigned."""
    return payload >> 16, payload & 0xFFFF


def signed(word: int) -> int:
    """Return the value of a 16-bit word in two's complement."""
    return word - 0x10000 if word & 0x8000 else word


def signed_pair(payload: int) -> tuple[int, int]:
    """Return the high and the low 16-bit word of a payload, in two's complement."""
    return signed(payload >> 16), signed(payload & 0xFFFF)


def from_float(number: float) -> int:
    """Return the payload that encodes ``number`` as float32. Raises FrameError if too large."""
    try:
        (payload,) = _WORD.unpack(_FLOAT.pack(number))
    except OverflowError as error:
        raise FrameError(f"{number} does not fit into a float32") from error
    return int(payload)


def to_float(payload: int) -> float:
    """Return the float32 number that a payload encodes. The number may be NaN or infinite."""
    (number,) = _FLOAT.unpack(_WORD.pack(payload))
    return float(number)
