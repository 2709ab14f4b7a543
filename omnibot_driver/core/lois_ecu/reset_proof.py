# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Proof, by the tick counts, that the board has obeyed a reset.

A count near zero proves nothing by itself. The count may have been near zero before the reset, or a
wheel may have rolled back.

This module works on counts and times.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Ticks

FEW_TICKS: Final = 20
"""Largest assumed number of ticks that a wheel rolls on after it was stopped: 0.4 s at 50 RPM."""
JUMP_TICKS: Final = 60
"""Number of ticks that no wheel can roll between a reset and the next counts. If the counts fall by
this number, the board has obeyed the reset."""
STEADY_TICKS: Final = 3
"""Smallest count that proves a reset by changing to zero while the wheels are at rest. Backlash of
the gears can change only smaller counts to zero."""
UNPROVED_S: Final = 2.5
"""Longest time in s to wait for a proof. The reset is repeated until then. Sometimes no proof is
possible, for example if the counts were zero before the reset."""


class ResetProof:
    """Search for a proof that the board has obeyed a reset.

    ``before``: counts when the reset was sent, None if unknown.

    ``steady``: whether these counts had not changed for some time.

    ``remark``: sentence on what was not proved.
    """

    def __init__(self, before: Ticks | None, *, steady: bool) -> None:
        self._before, self._steady = before, steady
        self._waits_since_s = math.inf
        self._seen: Ticks | None = None

    def again(self, before: Ticks | None, *, steady: bool) -> None:
        """Record that the reset is repeated.

        Replace ``before`` if the present counts can prove more.

        Counts of wheels at rest can prove more than counts of rolling wheels. While the wheels
        still roll, the present counts can prove no more than the first counts.
        """
        if before is not None and steady and _largest(before) >= STEADY_TICKS:
            self._before, self._steady = before, steady
            self._waits_since_s, self._seen = math.inf, None

    def look(self, ticks: Ticks, now: float) -> bool:
        """Return whether the driver can report the reset now.

        The counts must be near zero. In addition, they must prove the reset, or ``UNPROVED_S`` must
        have passed.
        """
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
        """Sentence on what was not proved. Empty if the counts prove the reset."""
        if self._proved:
            return ""
        if self._before is None:
            was = "unknown"
        else:
            was = f"{self._before.left} and {self._before.right} ticks"
        return (
            "reset sent, but unconfirmed: the wheel counters are near zero now, but their values"
            f" before the reset ({was}) do not prove that the board obeyed"
        )


def _largest(ticks: Ticks) -> int:
    return max(abs(ticks.left), abs(ticks.right))
