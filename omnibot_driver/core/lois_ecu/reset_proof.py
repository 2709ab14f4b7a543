# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the board's tick counters show that it has obeyed a reset, and what they cannot show.

A count that is near zero proves nothing by itself: it may have been there before, or a wheel may
have rolled back to it. Knows counts and times, no lines.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Ticks

FEW_TICKS: Final = 20
"""A wheel that was stopped rolls on for at most this many: 0.4 s at 50 RPM."""
JUMP_TICKS: Final = 60
"""More than any wheel rolls until a reset that arrived is shown."""
STEADY_TICKS: Final = 3
"""For wheels at rest, this many cannot be backlash."""
UNPROVED_S: Final = 2.5
"""How long to wait for a proof where none may come; meanwhile the reset is sent again."""


class ResetProof:
    """``before``: the counts when the reset was sent, None where they are unknown; ``steady``: they
    did not change for some time. ``remark``: what was not shown, in a sentence.
    """

    def __init__(self, before: Ticks | None, *, steady: bool) -> None:
        self._before, self._steady = before, steady
        self._waits_since_s = math.inf
        self._seen: Ticks | None = None

    def again(self, before: Ticks | None, *, steady: bool) -> None:
        """The reset is sent once more: wheels that stand by now show more than those that rolled.

        Counts of wheels that still roll are not better than those that were there at first.
        """
        if before is not None and steady and _largest(before) >= STEADY_TICKS:
            self._before, self._steady = before, steady
            self._waits_since_s, self._seen = math.inf, None

    def look(self, ticks: Ticks, now: float) -> bool:
        """Whether all that can be shown is shown, by these counts."""
        self._waits_since_s = min(self._waits_since_s, now)
        self._seen = ticks
        if _largest(ticks) > FEW_TICKS:
            return False
        return self._proved or now - self._waits_since_s >= UNPROVED_S

    @property
    def _proved(self) -> bool:
        before, seen = self._before, self._seen
        if before is None or seen is None:
            return False
        if _largest(before) >= FEW_TICKS + JUMP_TICKS and _largest(seen) <= FEW_TICKS:
            return True
        return self._steady and _largest(before) >= STEADY_TICKS and not _largest(seen)

    @property
    def remark(self) -> str:
        """Empty where the counts prove the reset."""
        if self._proved:
            return ""
        if self._before is None:
            was = "unknown"
        else:
            was = f"{self._before.left} and {self._before.right} ticks"
        return (
            "reset sent, but unconfirmed: the wheel counters are near zero and were not far from it"
            f" before ({was}), so the board cannot show whether it obeyed"
        )


def _largest(ticks: Ticks) -> int:
    return max(abs(ticks.left), abs(ticks.right))
