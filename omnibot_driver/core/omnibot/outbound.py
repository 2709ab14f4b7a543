# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The encoding of frames and letters for a line that loses bytes, and for unknown firmware.

The frames are the manual's. This module decides which bytes precede a frame, and which of two
neighbouring values a word takes. It knows bytes; it does not know what is commanded, nor when.

A control frame has no checksum, and the board's parser is unknown. The worst possible parser counts
seven bytes after ``FF FE``, however long they take. If a frame lost a byte, that parser completes
the frame with the next byte that is sent. So the encoding has four rules.

1. *Zeros precede everything.* A zero is neither a letter nor a header. A frame that lost bytes
   swallows zeros instead of a letter, and a header never follows an ``FF``. Seven zeros end any
   such frame, and an eighth replaces one that is lost. A Stop that zeros complete is still a stop,
   or becomes a frame in mode 0, which is not a command. The same is true of an emergency stop.
   Before a motion frame, four zeros are enough. Only a frame that lost five or more bytes of its
   payload could swallow the header after four zeros. Such a frame commands motion as well.
2. *Nothing follows a motion frame.* A motion frame that lost bytes has no effect until the next
   transmission. The zeros of that transmission complete it. The next frame replaces it 12 bytes
   later (1.0 ms at 115200 baud). Zeros directly after a motion frame would complete the damaged
   frame at once, even in a parser that discards an incomplete frame after a pause. The wrong
   command would last until the next repetition.
3. *A payload without its header is harmless.* If the header is lost, a parser looks for letters and
   headers in the payload. So no byte of a payload is ``S``, ``P`` or ``R``, and ``FE`` never
   follows ``FF``. Each word takes the nearest value for which this is true. That value is at most
   one LSB away, unless the high byte of the word is a letter.
4. *What is lost is sent again.* Each of these frames and letters is repeated, or the board's data
   confirms it.

One risk remains: an added or changed byte can turn a frame into another valid frame, until the next
repetition.
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
"""Zeros before a frame or letter. Seven zeros end any frame that was begun, and an eighth may be
lost. To wake a board, three zeros are enough."""
ZEROS_BEFORE_MOTION: Final = bytes(4)
"""Zeros before a motion frame. They are few, so that this frame soon replaces a damaged frame
before it."""

_LETTERS: Final = FORCE_START + TOGGLE_PAUSE + RESET
_HARMFUL: Final = re.compile(b"[%s]|%s" % (_LETTERS, re.escape(COMMAND_HEADER))).search
_WORDS: Final = struct.Struct(">3h").pack
_WORD_FOLLOWED: Final = struct.Struct(">hB").pack


def transmission(*parts: bytes) -> bytes:
    """Return the bytes of frames and letters in the given order, with zeros before each."""
    return b"".join([ZEROS + part for part in parts])


def harmless(counts: tuple[float, float, float]) -> Words:
    """Return three words near to ``counts``, without a letter or a header in their bytes.

    Each word is the nearest one to its count for which this is possible. Letters are S, P and R.
    The absolute values of the words are at most ``MAX_WORD``.
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
    """Return the nearest word to ``count`` that has no letter and no header in its bytes.

    ``word``: the integer nearest to ``count``. ``follows``: the byte after the word.
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
