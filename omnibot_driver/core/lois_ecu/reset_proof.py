# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Proof, by the tick counts, that the board has obeyed a reset.

Counts near zero prove nothing if they were near zero before. This module knows counts and times.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.messages import Ticks

# A limit of a count consists of turns of the wheel and of ticks, for the counts' rounding.
FEW_TURNS: Final = 0.3
FEW_TICKS: Final = 2
"""``FEW_TURNS`` (turns of a wheel) plus ``FEW_TICKS`` (ticks): largest count that is regarded as
near zero. A stopped wheel is assumed to roll at most this far."""
JUMP_TURNS: Final = 0.95
JUMP_TICKS: Final = 3
"""``JUMP_TURNS`` (turns of a wheel) plus ``JUMP_TICKS`` (ticks): smallest fall of a count to near
zero that proves a reset. No wheel can roll as far between a reset and the next counts."""
STEADY_TURNS: Final = 1 / 60
STEADY_TICKS: Final = 2
"""``STEADY_TURNS`` (turns of a wheel) plus ``STEADY_TICKS`` (ticks): smallest count at rest that
can prove a reset. If both counts then fall to zero, the board was reset, because backlash changes a
count by less."""
UNPROVED_S: Final = 2.5
"""Time in s after which the driver accepts counts near zero without a proof. No proof is possible
if the counts were already near zero before the reset."""


class ResetProof:
    """Search for a proof that the board has obeyed a reset.

    ``before``: the counts when the reset was sent; None if they are unknown.

    ``steady``: whether ``before`` had not changed for some time, so that the wheels were at rest.
    """

    def __init__(self, before: Ticks | None, ticks_per_revolution: int, *, steady: bool) -> None:
        self._before, self._steady = before, steady
        self.ticks_per_revolution = ticks_per_revolution
        self._waits_since_s = math.inf
        self._seen: Ticks | None = None

    def again(self, before: Ticks | None, *, steady: bool) -> None:
        """Record that the driver sends the reset again.

        ``before``: the last tick counts. They are kept for the proof if the wheels are at rest
        (``steady``) and one count is large enough. Otherwise, the counts from before an earlier
        reset are kept.
        """
        if before is not None and steady and _largest(before) >= self._still:
            self._before, self._steady = before, steady
            self._waits_since_s, self._seen = math.inf, None

    def look(self, ticks: Ticks, now: float) -> bool:
        """Return whether the driver can report the reset as done.

        The counts ``ticks`` must be near zero. Until ``UNPROVED_S`` after the first call, the
        counts must also prove the reset.
        """
        self._waits_since_s = min(self._waits_since_s, now)
        self._seen = ticks
        if _largest(ticks) > self._few:
            return False
        return self._proved or now - self._waits_since_s >= UNPROVED_S

    @property
    def _proved(self) -> bool:
        before, seen = self._before, self._seen
        if before is None or seen is None:
            return False
        jump = JUMP_TURNS * self.ticks_per_revolution + JUMP_TICKS
        if _largest(before) >= self._few + jump and _largest(seen) <= self._few:
            return True
        return self._steady and _largest(before) >= self._still and not _largest(seen)

    @property
    def _few(self) -> float:
        return FEW_TURNS * self.ticks_per_revolution + FEW_TICKS

    @property
    def _still(self) -> float:
        return STEADY_TURNS * self.ticks_per_revolution + STEADY_TICKS

    @property
    def remark(self) -> str:
        """Sentence on what was not proved. Empty if the counts prove the reset."""
        if self._proved:
            return ""
        if self._before is None:
            was = "not known before the reset"
        else:
            was = (
                "already small before the reset"
                f" ({self._before.left} and {self._before.right} ticks)"
            )
        return (
            f"reset sent, but unconfirmed: the wheel counters were {was}, so their current values"
            " near zero do not prove that the board obeyed"
        )


def _largest(ticks: Ticks) -> int:
    return max(abs(ticks.left), abs(ticks.right))
