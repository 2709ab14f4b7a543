# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The angle of the front wheel as a line for the drive board, in digits that damage cannot change.

Two lost characters whose codes add up to 99 change no sum, wherever they stand. So an angle is sent
in digits without such a pair, and rounded for that by half a degree at most; what is rounded off is
sent with the next angles, so the mean is right. To the right some angles have a ``6`` that no
rounding avoids: their minus sign and that ``6`` can be lost unseen, which leaves less than 10° to
the left.

Without sums any character can be lost unseen. Then whole degrees are sent, of which any loss leaves
a smaller number: beyond 90° the board would compute an inner wheel faster than the outer one.
Knows no sums but their modulus.
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
"""Tenths of a degree by which an angle may be moved."""
MOST_OWED: Final = 0.5
"""Degrees."""
ACROSS: Final = 10.0
"""Degrees to the left, below which an angle to the right may be heard as if it were there."""
_NUMBER: Final = re.compile(r"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)")


class AngleRelay:
    """Remembers what was rounded off."""

    def __init__(self) -> None:
        self._owed_deg = 0.0

    def text(self, angle_rad: float, *, sums: bool) -> bytes:
        """The line, without its sum."""
        angle_deg = math.degrees(angle_rad)
        wanted_deg = angle_deg + self._owed_deg
        text = _with_sum(round(10 * wanted_deg)) if sums else b"%d" % round(wanted_deg)
        self._owed_deg = max(-MOST_OWED, min(MOST_OWED, wanted_deg - float(text)))
        return b"fwl " + text


def heard_instead(text: str) -> Iterator[float]:
    """What a number says without any two of its characters that change no sum; 0 where none."""
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
    """With and without the zeros that change nothing, shortest first."""
    whole, tenth = divmod(abs(tenths), 10)
    heads = [str(whole), f"0{whole}"] if whole else ["0", ""]
    tails = [f".{tenth}", f".{tenth}0"] if tenth else ["", ".", ".0", ".00"]
    sign = "-" if tenths < 0 else ""
    texts = [sign + head + tail for head in heads for tail in tails]
    return [text for text in texts if any(map(str.isdigit, text))]
