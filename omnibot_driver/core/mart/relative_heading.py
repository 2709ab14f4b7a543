# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The turn of the robot within a motion, from the relative heading that the server reports.

Some servers update the heading only in a forward drive (RM). This module knows rad and times; it
does not know commands.
"""

import math
from collections import deque
from typing import Final

from omnibot_driver.core.mart.doubt import CLOCK_S
from omnibot_driver.core.mart.moment import Moment

DOUBT_RAD: Final = 0.1
ACCELERATION_RADPS2, MOST_RADPS = 3.0, 1.0
"""``ACCELERATION_RADPS2``: largest plausible angular acceleration of a robot, in rad/s².

``MOST_RADPS``: largest plausible difference between its turn rate and the last measured rate, in
rad/s.
"""
OLD_RAD: Final = 0.01
"""Largest difference in rad between two headings that are regarded as the same. If the heading is
the same after RM (forward drive), it may be old: the reply was late, or RM was lost."""
MOST_RAD: Final = 1e7
"""Limit in rad. A reported heading of this size or more is rejected.

A server whose clock is set back reports 1e15 degrees, for example.
"""
AHEAD_S: Final = 0.3
"""Longest time in s for which the heading is predicted after its last report."""
ODD_TIMES: Final = 3
"""After this number of implausible headings in a row, the driver accepts the last of them."""
SPREADS: Final = 4
"""The turn rate is averaged over ``SPREADS`` times the time uncertainty of a reply."""


class RelativeHeading:
    """The relative heading within a motion.

    * ``told_s``: time of the last accepted heading.
    * ``from_s``: earliest possible time of measurement of the last certain heading. A changed
      heading in a doubtful reply (``Moment.doubtful``) is not certain.
    * ``changed_s``: time of the last change of heading.
    * ``same``: number of equal headings since the last change.
    """

    def __init__(self) -> None:
        self.told_s = self.from_s = self.changed_s = -math.inf
        self.rate_radps = 0.0
        self._angle_rad: float | None = None
        self._before_rad = 0.0
        self._turned_rad = 0.0
        self.same = 0
        self.may_begin_anew = False
        """Whether the server may have restarted. A restarted server begins its heading at zero
        again."""
        self._odd = 0
        self._track: deque[tuple[float, float]] = deque(maxlen=40)

    @property
    def is_known(self) -> bool:
        """Whether a heading is known, so that later turns can be measured."""
        return self._angle_rad is not None

    @property
    def angle_rad(self) -> float | None:
        """The last heading in rad, or None if it is not known."""
        return self._angle_rad

    @property
    def is_zero(self) -> bool:
        """Whether the heading is exactly zero.

        A server reports zero before its first forward drive (RM).
        """
        return self._angle_rad == 0.0

    def forget(self) -> None:
        """Forget the heading, because the next reported heading may have another zero point."""
        self._angle_rad = None

    def begin(self, now: float, *, anew: bool) -> None:
        """Record that a motion was started.

        ``anew``: whether the motion sets the heading to zero, as only a forward drive (RM) does.
        """
        if anew:
            self._before_rad, self._angle_rad = self._angle_rad or 0.0, None
        self._turned_rad = 0.0
        self._track.clear()
        self.same = 0
        self.changed_s = now

    def started(self) -> None:
        """Record that a forward drive (RM) has certainly begun.

        All headings that are reported from now on belong to this drive.
        """
        self._before_rad = 0.0

    def tell(self, angle_rad: float, when: Moment, stood_s: float, scale: float = 1.0) -> bool:
        """Process a reported heading; return whether it is plausible and has changed.

        ``stood_s``: time at which the robot was stopped; infinite while driven. ``scale``: true
        turn to the left divided by the change of the reported heading.
        """
        if not abs(angle_rad) < MOST_RAD:
            self.forget()
            self.told_s, self.from_s, self.rate_radps = when.at_s, when.from_s, 0.0
            return False
        before_rad, before_s, at_s = self._angle_rad, self.told_s, when.at_s
        if before_rad is None:
            old = abs(angle_rad - self._before_rad) < OLD_RAD < abs(self._before_rad)
            # a heading like the one before RM is accepted only after the stop: RM may be lost
            if not old or when.from_s >= stood_s:
                self._take(angle_rad, when)
                self.from_s = when.from_s
                self.changed_s = max(self.changed_s, at_s)  # no change can be seen before this time
            return False
        if at_s <= before_s:
            return False
        if self.begins_anew(angle_rad):
            self._take(angle_rad, when)
            self.from_s = when.from_s
            return False
        turn_rad = scale * (angle_rad - before_rad)
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
        self.same += 1
        if turn_rad:
            self.changed_s, self.same = at_s, 0
        return bool(turn_rad)

    def begins_anew(self, angle_rad: float) -> bool:
        """Return whether a heading of zero shows a restart of the server, and not a turn."""
        known = self._angle_rad is not None and abs(self._angle_rad) > OLD_RAD
        return self.may_begin_anew and angle_rad == 0.0 and known

    def doubt_rad(self, angle_rad: float, at_s: float) -> float:
        """Return the standard deviation, in rad, of the turn since the last heading.

        A restart of the server sets its heading to zero. The result is 0 if a restart is excluded,
        and infinite if the new heading ``angle_rad`` proves a restart.
        """
        before_rad = self._angle_rad
        if not self.may_begin_anew or before_rad is None or at_s <= self.told_s:
            return 0.0
        if self.begins_anew(angle_rad):
            return math.inf
        most_rad = abs(self.rate_radps) * (at_s - self.told_s)
        same = angle_rad and abs(angle_rad - before_rad) < OLD_RAD
        # A heading near zero may have a new zero point. The turn may then be as large as the last
        # heading plus the turn that is expected since then.
        return 0.0 if same or abs(angle_rad) > most_rad + DOUBT_RAD else abs(before_rad) + most_rad

    def _take(self, angle_rad: float, when: Moment) -> None:
        self._odd = 0
        self.may_begin_anew = False
        self._angle_rad, self.told_s = angle_rad, when.at_s
        self._track.append((when.at_s, self._turned_rad))
        self.rate_radps = 0.0
        if len(self._track) > 1:
            from_s = min(when.at_s - SPREADS * when.spread_s, self._track[-2][0])
            then_s, then_rad = next(each for each in self._track if each[0] >= from_s)
            self.rate_radps = (self._turned_rad - then_rad) / max(when.at_s - then_s, CLOCK_S)

    def turned_rad(self, at_s: float, *, stands: bool) -> float:
        """Return the turn from the beginning of the motion until ``at_s``, in rad.

        The turn since the last heading is predicted, unless the robot was stopped (``stands``).
        """
        ahead_s = 0.0 if stands else min(max(0.0, at_s - self.told_s), AHEAD_S)
        return self._turned_rad + self.rate_radps * ahead_s
