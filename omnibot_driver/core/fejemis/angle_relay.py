# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The front wheel's angle as a line for the drive board, in digits that make damage detectable.

If two characters whose codes add up to 99 are lost, the sum (checksum) of a line does not change.
So the driver sends an angle in digits without such a pair; to get these digits, it rounds the angle
by at most half a degree. The rounding error is added to the next angles, so the mean is correct.
Some angles to the right contain a ``6`` that rounding cannot avoid. If the minus sign and this
``6`` are both lost, the sum does not change, and the board receives an angle of less than 10° to
the left.

Without sums, the board does not detect any loss. So the driver sends whole degrees: the loss of a
digit never makes a whole number larger, so the received angle never exceeds 90°. Beyond 90°, the
board would compute an inner wheel that is faster than the outer one.
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
"""Largest rounding error that is carried over to the next angle, in degrees."""
ACROSS: Final = 10.0
"""Limit, in degrees, of an angle to the left that a board may read if the text of an angle to the
right is damaged. Texts whose damage can give ``ACROSS`` or more are avoided."""
_NUMBER: Final = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


class AngleRelay:
    """Turns angles into lines, and carries the rounding error over to the next angle."""

    def __init__(self) -> None:
        self._owed_deg = 0.0

    def text(self, angle_rad: float, *, sums: bool) -> bytes:
        """Return the ``fwl`` line for the angle; ``sums``: whether the caller adds a sum."""
        angle_deg = math.degrees(angle_rad)
        wanted_deg = angle_deg + self._owed_deg
        text = _with_sum(round(10 * wanted_deg)) if sums else b"%d" % round(wanted_deg)
        self._owed_deg = max(-MOST_OWED, min(MOST_OWED, wanted_deg - float(text)))
        return b"fwl " + text


def heard_instead(text: str) -> Iterator[float]:
    """Yield each number that a board may read instead of ``text`` if two characters are lost.

    Only losses that the sum does not detect are included. A remaining text that is not a number
    gives 0.
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
    """Return the notations of an angle with and without redundant zeros, shortest first."""
    whole, tenth = divmod(abs(tenths), 10)
    heads = [str(whole), f"0{whole}"] if whole else ["0", ""]
    tails = [f".{tenth}", f".{tenth}0"] if tenth else ["", ".", ".0", ".00"]
    sign = "-" if tenths < 0 else ""
    texts = [sign + head + tail for head in heads for tail in tails]
    return [text for text in texts if any(map(str.isdigit, text))]
