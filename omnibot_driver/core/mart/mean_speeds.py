# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The mean speed and turn rate of the robot, from its last encoder counts.

This module knows metres, rad and times; it does not know how they are measured.
"""

from collections import deque
from typing import Final

from omnibot_driver.core.mart.doubt import CLOCK_S

WINDOW_S, SPREADS = 0.35, 4
"""Speeds are averaged over WINDOW_S (s), or over SPREADS times a reply's time uncertainty if this
time is longer."""
LEAST_S: Final = 0.05
"""Least time in s that is assumed between two counts, when a speed is computed from them."""


class MeanSpeeds:
    """The mean speeds of one motion.

    ``spread_s``: uncertainty, in s, of the time at which the server measured the last count.
    """

    def __init__(self) -> None:
        self.spread_s = CLOCK_S
        self._track: deque[tuple[float, float, float]] = deque(maxlen=40)
        self._way_m = self._yaw_rad = 0.0

    def add(self, at_s: float, way_m: float, turn_rad: float) -> None:
        """Record a new count, and the displacement since the previous count.

        ``at_s``: time of the new count.
        """
        self._way_m += way_m
        self._yaw_rad += turn_rad
        self._track.append((at_s, self._way_m, self._yaw_rad))

    def correct(self, turn_rad: float) -> None:
        """Add ``turn_rad``, a correction of the heading, to the turn in the next displacement."""
        self._yaw_rad += turn_rad

    def forget(self) -> None:
        """Forget the counts, because the next counts belong to another motion."""
        self._track.clear()

    @property
    def are_known(self) -> bool:
        """Whether speeds are known, which needs at least two counts."""
        return len(self._track) > 1

    @property
    def window_s(self) -> float:
        """The averaging time in s."""
        return max(WINDOW_S, SPREADS * self.spread_s)

    @property
    def means(self) -> tuple[float, float]:
        """Mean speed (m/s) and turn rate (rad/s) over the window; zero while unknown."""
        if not self.are_known:
            return 0.0, 0.0
        newest_s, way_m, yaw_rad = self._track[-1]
        from_s = min(newest_s - self.window_s, self._track[-2][0])
        at_s, then_m, then_rad = next(each for each in self._track if each[0] >= from_s)
        seconds = max(newest_s - at_s, 1e-3)
        return (way_m - then_m) / seconds, (yaw_rad - then_rad) / seconds

    @property
    def changes(self) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) between the last two counts, minus ``means``."""
        if not self.are_known:
            return 0.0, 0.0
        (then_s, then_m, then_rad), (at_s, way_m, yaw_rad) = self._track[-2], self._track[-1]
        seconds = max(at_s - then_s, LEAST_S)
        speed, rate = self.means
        return (way_m - then_m) / seconds - speed, (yaw_rad - then_rad) / seconds - rate
