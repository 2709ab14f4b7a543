# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes the front wheel's angle as a line in which the drive board can detect damage.

With a misread angle above 90°, the board would drive the wrong wheel faster.
"""

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations
from typing import Final

from omnibot_driver.core.fejemis.sums import MODULUS, robust

ROUNDED: Final = 5
"""Largest allowed rounding of an angle, in tenths of a degree."""
MOST_OWED: Final = 0.5
"""Largest rounding error, in degrees, that is carried over to the next angle."""
LARGEST_DEG: Final = 90.0
ACROSS: Final = 10.0
"""Limit, in degrees, for a wrong angle to the left.

The board reads a wrong angle if an angle to the right loses the characters ``-`` and ``6``. The
checksum does not detect this loss.
"""
_NUMBER: Final = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


class AngleRelay:
    """Turns angles into lines, and adds the rounding error of each angle to the next angle."""

    def __init__(self) -> None:
        self._owed_deg = 0.0

    def text(self, angle_rad: float, *, sums: bool) -> bytes:
        """Return the ``fwl`` line with the angle, without a checksum.

        ``sums``: whether the caller adds a checksum to the line. If not, the angle is rounded to
        whole degrees.
        """
        wanted_deg = math.degrees(angle_rad) + self._owed_deg
        told_deg = max(-LARGEST_DEG, min(LARGEST_DEG, wanted_deg))
        # Without a checksum, the board detects no loss. A whole number never grows if a digit is
        # lost.
        text = _with_sum(round(10 * told_deg)) if sums else b"%d" % round(told_deg)
        self._owed_deg = max(-MOST_OWED, min(MOST_OWED, wanted_deg - float(text)))
        return b"fwl " + text


def heard_instead(text: str) -> Iterator[float]:
    """Yield each number that a board may read if two characters of ``text`` are lost unnoticed.

    The number is 0 if the remaining characters form none.
    """
    for i, j in combinations(range(len(text)), 2):
        if (ord(text[i]) + ord(text[j])) % MODULUS == 0:
            found = _NUMBER.match(text[:i] + text[i + 1 : j] + text[j + 1 :])
            yield float(found[0]) if found else 0.0


@lru_cache(maxsize=4000)
def _with_sum(tenths: int) -> bytes:
    # A checksum does not detect the loss of two characters whose codes add up to 99. So the angle
    # is rounded, by at most half a degree, to digits without such a pair. Some angles to the right
    # cannot be written without the pair ``-`` and ``6``. For these, a text is used from which the
    # board reads less than 10° to the left if both characters are lost.
    across = ""
    for off in range(ROUNDED + 1):
        for near in (tenths + off, tenths - off)[: 2 if off else 1]:
            for text in _written(near):
                if not robust(b"fwl " + text.encode("ascii")):
                    continue
                instead = list(heard_instead(text))
                if not instead:
                    return text.encode("ascii")
                if not across and all(0.0 <= angle_deg < ACROSS for angle_deg in instead):
                    across = text
    return across.encode("ascii") or b"%.1f" % (tenths / 10)


def _written(tenths: int) -> list[str]:
    """Return the possible texts for an angle, for example 5.3, 5.30, 05.3 and 05.30.

    ``tenths``: the angle in tenths of a degree.
    """
    whole, tenth = divmod(abs(tenths), 10)
    heads = [str(whole), f"0{whole}"] if whole else ["0", ""]
    tails = [f".{tenth}", f".{tenth}0"] if tenth else ["", ".", ".0", ".00"]
    sign = "-" if tenths < 0 else ""
    texts = [sign + head + tail for head in heads for tail in tails]
    return [text for text in texts if any(map(str.isdigit, text))]
