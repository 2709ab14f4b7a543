# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The encoding of frames and letters for a line that loses bytes, and for unknown firmware.

Zeros are sent before each frame or letter (S, P, R). The bytes within a frame contain neither a
letter nor a header. After a motion frame, nothing is sent until the next frame or letter is due.
docs/internals/omnibot_protocol.md ("The line to the board") gives the reasons.

This module knows bytes; it does not know what is commanded, nor when.
"""

import re
import struct
from typing import Final

from omnibot_driver.core.omnibot.frames import (
    COMMAND_HEADER,
    FORCE_START,
    RESET,
    TOGGLE_PAUSE,
    Words,
)

MAX_WORD: Final = 32767

ZEROS: Final = bytes(8)
"""The zeros that are sent before Stop, the emergency stop or a letter.

* Seven zeros complete a previous frame that has lost its end; the eighth is a reserve.
* Three zeros wake a board.
"""
# Send no zeros after a motion frame: they would complete a damaged frame at once, even in a parser
# that discards incomplete frames after a pause.
ZEROS_BEFORE_MOTION: Final = bytes(4)
"""The zeros that are sent before a motion frame.

The zeros may complete a damaged previous frame to a wrong command. The motion frame then replaces
the wrong command. With few zeros, this happens soon.
"""

_LETTERS: Final = FORCE_START + TOGGLE_PAUSE + RESET
_HARMFUL: Final = re.compile(b"[%s]|%s" % (_LETTERS, re.escape(COMMAND_HEADER))).search
_WORDS: Final = struct.Struct(">3h").pack
_WORD_FOLLOWED: Final = struct.Struct(">hB").pack


def transmission(*parts: bytes) -> bytes:
    """Return the bytes of frames and letters in the given order, with zeros before each."""
    return b"".join([ZEROS + part for part in parts])


def harmless(counts: tuple[float, float, float]) -> Words:
    """Return the three words nearest to ``counts``, without a letter or a header in their bytes.

    Letters: S, P, R. Absolute values: at most ``MAX_WORD``.
    """
    a, b, c = counts
    words = nearest(a, b, c)
    if not _HARMFUL(_WORDS(*words)):
        return words
    last = _harmless_word(c, words[2], 0)
    middle = _harmless_word(b, words[1], last >> 8 & 0xFF)
    return _harmless_word(a, words[0], middle >> 8 & 0xFF), middle, last


def nearest(a: float, b: float, c: float) -> Words:
    """Return the nearest integers; halves are rounded away from zero."""
    return (
        int(a + 0.5 if a > 0.0 else a - 0.5),
        int(b + 0.5 if b > 0.0 else b - 0.5),
        int(c + 0.5 if c > 0.0 else c - 0.5),
    )


def begins_with_a_letter(word: int) -> bool:
    """Return whether the high byte of ``word`` is S, P or R.

    If so, changing the word by one LSB does not avoid the letter.
    """
    return word >> 8 & 0xFF in _LETTERS


def _harmless_word(count: float, word: int, follows: int) -> int:
    """Return the nearest word to ``count`` whose bytes contain no letter (S, P, R) and no header.

    ``word``: ``count`` rounded. ``follows``: the byte that is sent after the returned word.
    """
    reach = 0
    while True:
        near = [
            other
            for other in (word - reach, word + reach)
            if abs(other) <= MAX_WORD and not _HARMFUL(_WORD_FOLLOWED(other, follows))
        ]
        if near:
            return min(near, key=lambda other: (abs(other - count), abs(other)))
        reach += 1
