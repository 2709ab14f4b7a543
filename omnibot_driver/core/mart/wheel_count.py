# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How far the right wheel has turned, by a count that begins anew with each motion.

A reply may be that to an earlier question, and another number than the count. So a count that does
not fit is left out; one that comes again and again is taken, as one that tells no way. Knows counts
and times; no metres per count but the one given. Time is an argument.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.moment import Moment

DOUBT_M, DOUBT_MPS = 0.03, 0.3
"""A doubtful count is as near as that to what was expected."""
MOST_M, MOST_MPS = 0.3, 2.0
"""No wheel goes farther between two counts: one of them is false."""
STRAY_COUNTS: Final = 3
"""A robot that stands is counted no farther."""
ODD_TIMES: Final = 3
SAME_TIMES: Final = 2
"""The count of a robot that is driven is not twice that of before: the start was lost."""


@dataclass(frozen=True, slots=True)
class Step:
    """``wheel_m``: since the last count, in ``seconds``. ``lost``: what else the robot has done
    between is not known. ``unsure``: it may be zero as well.
    """

    wheel_m: float
    seconds: float
    lost: bool = False
    unsure: bool = False


class WheelCount:
    """``last``: None where nothing was counted; ``told_s``: when, ``from_s``: at the earliest;
    ``certain``: it cannot be the answer to another question. ``maybe``: the counts of a motion that
    was not answered, and has begun or not: they are the same as those of the motion before.
    """

    def __init__(self) -> None:
        self.last: int | None = None
        self.told_s = self.from_s = -math.inf
        self.certain = False
        self.maybe = 0
        self.may_begin_anew = False
        """The next count may be from zero on, by the check of the IMU."""
        self._raw: int | None = None
        self._before: int | None = None
        self._begins = self._confirmed = self._unseen = False
        self._same = self._odd = 0

    def begin(self) -> None:
        """A motion has begun, and the count with it, if the start has come."""
        self._before, self.last = self.last, 0
        self.may_begin_anew = self._begins = True
        self.certain = self._confirmed = False
        self._same = self.maybe = 0

    def started(self) -> None:
        """The server has answered that it has."""
        self._confirmed = True

    def refused(self) -> None:
        """It has not, by the reply to its stop: the count goes on."""
        if not self._confirmed:
            self.last, self._begins = self._before, False

    def connect(self) -> None:
        """The server was not heard for long: it may have gone on, or have begun anew."""
        self.may_begin_anew = self._unseen = True

    def rest(self) -> None:
        """The motion is over."""
        self.last, self._begins = self._raw, False
        self.maybe = 0

    def tell(
        self,
        count: int,
        when: Moment,
        metres_per_count: float,
        expected_mps: float,
        stood_s: float,
        *,
        rests: bool,
    ) -> Step | None:
        """None for a count that is not believed. ``expected_mps``: of the wheel; ``stood_s``: since
        when the robot stands; ``rests``: without a motion since.
        """
        before, before_s = self.last, self.told_s
        self.certain = count == before or not when.doubtful
        if before is None:
            self._take(count, when)
            return Step(0.0, 0.0)
        seconds = max(when.at_s - before_s, 1e-4)
        if (self.may_begin_anew or rests) and abs(count) <= abs(count - before):
            before = 0
        unsure = bool(self._begins and self._before and abs(count - self._before) <= 1)
        driven = math.isinf(stood_s)
        if self._confirmed and not self._same and when.from_s >= stood_s and not when.doubtful:
            unsure = False
        if unsure and (not self._confirmed or self._same or driven):
            # as before the start, which may have been lost
            self._same += driven and not when.doubtful
            self.maybe = count if self._same < SAME_TIMES else 0
            self._raw, self.told_s, self.from_s = count, when.at_s, when.from_s
            return Step(0.0, seconds)
        lost = bool(self._unseen and not before and self.last)
        wheel_m = (count - before) * metres_per_count
        moved_s = max(0.0, min(when.at_s, stood_s) - before_s)
        if abs(wheel_m) > MOST_M + MOST_MPS * seconds:
            return self._odd_one(count, when, Step(0.0, seconds, lost=True))
        if not rests and self._falls_back(count, when):
            return self._odd_one(count, when, Step(wheel_m, seconds, lost=True))
        if rests and when.doubtful and abs(count - before) > STRAY_COUNTS:
            return self._odd_one(count, when, Step(wheel_m, seconds))
        most_m = DOUBT_M + DOUBT_MPS * (moved_s + when.spread_s)
        if when.doubtful and not self._begins and abs(wheel_m - expected_mps * moved_s) > most_m:
            return None
        self._take(count, when)
        return Step(wheel_m, seconds, lost, unsure)

    def _odd_one(self, count: int, when: Moment, step: Step) -> Step | None:
        """One that has come too often to be chance is so, whatever it was."""
        self._odd += 1
        if self._odd < ODD_TIMES:
            return None
        self._take(count, when)
        return step

    def _falls_back(self, count: int, when: Moment) -> bool:
        """Whether it is less than before in this motion: of an earlier time, or another number."""
        before = self.last or 0
        if abs(before) <= STRAY_COUNTS or not when.is_uncertain:
            return False
        return abs(count) < abs(before) - STRAY_COUNTS or count * before < 0

    def _take(self, count: int, when: Moment) -> None:
        self.last = self._raw = count
        self.told_s, self.from_s = when.at_s, when.from_s
        self.may_begin_anew = self._begins = self._unseen = False
        self._odd = self.maybe = 0
