# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How far the robot has turned in a motion, by the relative heading as it is polled.

RM sets it to zero, and some servers let it stand in every other motion. Knows rad and times; no
words. Time is an argument.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.mart.doubt import CLOCK_S
from omnibot_driver.core.mart.moment import Moment

DOUBT_RAD: Final = 0.1
ACCELERATION_RADPS2, MOST_RADPS = 3.0, 1.0
"""Of a robot that is not heard, as far as an uncertain heading is believed."""
OLD_RAD: Final = 0.01
"""A first heading of RM that is so near to the last one before is that one."""
AHEAD_S: Final = 0.3
"""It is predicted so far, to the time of a count."""
ODD_TIMES: Final = 3
"""What has come so often is so."""
SPREADS: Final = 4
"""The turn rate is an average over this multiple of a reply's uncertainty."""


class RelativeHeading:
    """``told_s``: time of the last reply; ``from_s``: the earliest time it can have, unless it
    answers another question; ``changed_s``: time of the last change; ``rate_radps``: of the turn.
    """

    def __init__(self) -> None:
        self.told_s = self.from_s = self.changed_s = -math.inf
        self.rate_radps = 0.0
        self._angle_rad: float | None = None
        self._before_rad = 0.0
        self._turned_rad = 0.0
        self._odd = 0
        self._track: deque[tuple[float, float]] = deque(maxlen=40)

    @property
    def is_known(self) -> bool:
        """Whether turns can be measured from now on."""
        return self._angle_rad is not None

    def forget(self) -> None:
        """The next one may begin anew."""
        self._angle_rad = None

    def begin(self, now: float, *, anew: bool) -> None:
        """A motion has begun. ``anew``: with a heading of zero."""
        if anew:
            self._before_rad, self._angle_rad = self._angle_rad or 0.0, None
        self._turned_rad = 0.0
        self._track.clear()
        self.changed_s = now

    def tell(self, angle_rad: float, when: Moment, stood_s: float) -> bool:
        """Whether it is believed, and has changed. ``stood_s``: since when the robot stands."""
        before_rad, before_s, at_s = self._angle_rad, self.told_s, when.at_s
        if before_rad is None:
            old = abs(angle_rad - self._before_rad) < OLD_RAD < abs(self._before_rad)
            if not old or when.from_s >= stood_s:  # else of before RM, which may have been lost
                self._take(angle_rad, when)
                self.from_s = when.from_s
            return False
        if at_s <= before_s:
            return False
        turn_rad = angle_rad - before_rad
        moved_s = max(0.0, min(at_s, stood_s) - before_s)
        late_s = moved_s + when.spread_s
        most_rad = DOUBT_RAD + min(ACCELERATION_RADPS2 * late_s**2 / 2, MOST_RADPS * late_s)
        if when.is_uncertain and abs(turn_rad - self.rate_radps * moved_s) > most_rad:
            self._odd += 1
            if self._odd < ODD_TIMES:
                return False
        self._turned_rad += turn_rad
        if not (when.doubtful and turn_rad):
            self.from_s = when.from_s
        self._take(angle_rad, when)
        if turn_rad:
            self.changed_s = at_s
        return bool(turn_rad)

    def _take(self, angle_rad: float, when: Moment) -> None:
        self._odd = 0
        self._angle_rad, self.told_s = angle_rad, when.at_s
        self._track.append((when.at_s, self._turned_rad))
        self.rate_radps = 0.0
        if len(self._track) > 1:
            from_s = min(when.at_s - SPREADS * when.spread_s, self._track[-2][0])
            then_s, then_rad = next(each for each in self._track if each[0] >= from_s)
            self.rate_radps = (self._turned_rad - then_rad) / max(when.at_s - then_s, CLOCK_S)

    def turned_rad(self, at_s: float, *, stands: bool) -> float:
        """Since the motion began, predicted to this time."""
        ahead_s = 0.0 if stands else min(max(0.0, at_s - self.told_s), AHEAD_S)
        return self._turned_rad + self.rate_radps * ahead_s
