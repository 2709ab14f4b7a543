# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Speed of a wheel that rolls on without power.

Input: speeds and times.
"""

import math
from dataclasses import dataclass
from typing import Final

COASTING_S: Final = 0.15
DRY_MPS2: Final = 0.7
"""Deceleration of a wheel without power by dry friction, in m/s². In addition, its speed decays
exponentially, with the time constant ``COASTING_S``, in s.
"""
COAST_PART: Final = 0.35
"""Assumed standard deviation of the deceleration, as a fraction of the deceleration."""


@dataclass(frozen=True, slots=True)
class Coasting:
    """A wheel that coasts after a command.

    * ``heard_s``: time in s at which the board reads the command.
    * ``speed_mps``: speed at this time, with sign.
    """

    heard_s: float
    speed_mps: float

    def unsure_mps(self, now: float, step_s: float) -> float:
        """Return the standard deviation of the speed at ``now``, in m/s, with the speed's sign.

        ``step_s``: period of the speed controller in s, by which the deceleration may be delayed.
        """
        age_s = now - self.heard_s
        slow_mps = self._speed_after((1 + COAST_PART) * age_s)
        fast_mps = self._speed_after((1 - COAST_PART) * (age_s - step_s))
        return math.copysign((fast_mps - slow_mps) / 2, self.speed_mps)

    def _speed_after(self, coasting_s: float) -> float:
        dry_mps = DRY_MPS2 * COASTING_S
        kept = math.exp(-max(coasting_s, 0.0) / COASTING_S)
        return max((abs(self.speed_mps) + dry_mps) * kept - dry_mps, 0.0)
