# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes the front wheel's angle as a line for the drive board, so that damage is detected.

**Lines with a checksum.** If a line loses two characters whose codes add up to 99, its checksum
stays correct. So the driver rounds the angle, by at most half a degree, to digits without such a
pair. The rounding error is added to the next angle, so the mean of the angles is correct. Some
angles to the right need a minus sign and a ``6``, which are such a pair. If both are lost, the
board reads an angle of less than 10° to the left.

**Lines without a checksum.** The board detects no loss. So the driver sends whole degrees. A whole
number never becomes larger if a digit is lost, so the board never reads more than 90°. Beyond 90°,
the board would drive its inner wheel faster than the outer one.
"""

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations
from typing import Final

from omnibot_driver.core.fejemis.outbound import robust
from omnibot_driver.core.fejemis.sums import MODULUS

ROUNDED: Final = 5
"""Largest allowed rounding of an angle, in tenths of a degree."""
MOST_OWED: Final = 0.5
"""Largest rounding error that is added to the next angle, in degrees."""
ACROSS: Final = 10.0
"""Largest angle to the left, in degrees, that undetected damage to a line is allowed to produce.

A text is avoided if undetected damage could produce a larger angle to the left, or an angle to the
right.
"""
_NUMBER: Final = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


class AngleRelay:
    """Turns angles into lines, and adds the rounding error of each angle to the next angle."""

    def __init__(self) -> None:
        self._owed_deg = 0.0

    def text(self, angle_rad: float, *, sums: bool) -> bytes:
        """Return the ``fwl`` line for the angle; ``sums``: whether the caller adds a checksum."""
        angle_deg = math.degrees(angle_rad)
        wanted_deg = angle_deg + self._owed_deg
        text = _with_sum(round(10 * wanted_deg)) if sums else b"%d" % round(wanted_deg)
        self._owed_deg = max(-MOST_OWED, min(MOST_OWED, wanted_deg - float(text)))
        return b"fwl " + text


def heard_instead(text: str) -> Iterator[float]:
    """Yield each number that a board may read after an undetected loss of two characters.

    The loss is undetected if the checksum of ``text`` stays correct. If the remaining text is not a
    number, the result is 0.
    """
    for i, j in combinations(range(len(text)), 2):
        if (ord(text[i]) + ord(text[j])) % MODULUS == 0:
            found = _NUMBER.match(text[:i] + text[i + 1 : j] + text[j + 1 :])
            yield float(found[0]) if found else 0.0


@lru_cache(maxsize=4000)
def _with_sum(tenths: int) -> bytes:
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
    """Return all ways to write the angle, with and without redundant zeros."""
    whole, tenth = divmod(abs(tenths), 10)
    heads = [str(whole), f"0{whole}"] if whole else ["0", ""]
    tails = [f".{tenth}", f".{tenth}0"] if tenth else ["", ".", ".0", ".00"]
    sign = "-" if tenths < 0 else ""
    texts = [sign + head + tail for head in heads for tail in tails]
    return [text for text in texts if any(map(str.isdigit, text))]
