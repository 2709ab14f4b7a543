# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The distance rolled by the right wheel, from its encoder count.

The count begins at zero in each motion. Implausible counts are rejected, but the third one in a row
is accepted. This module knows counts and times; it does not know the robot's motion. The caller
passes the time.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.moment import Moment

DOUBT_M, DOUBT_MPS = 0.03, 0.3
"""Tolerance for an encoder count that may be the reply to another query.

The distance since the last count may deviate by DOUBT_M (m) + DOUBT_MPS (m/s) * (driving time +
uncertainty of the reply's time).
"""
MOST_M, MOST_MPS = 0.3, 2.0
"""Largest plausible distance between two counts: MOST_M (m) + MOST_MPS (m/s) * time between them.
"""
STRAY_COUNTS: Final = 3
"""Largest accepted change of the count of a robot at rest."""
ODD_TIMES: Final = 3
SAME_TIMES: Final = 2
"""The driver assumes that a start command was lost when it has received ``SAME_TIMES`` unchanged
counts. A count is unchanged if it is within 1 of the last count before the command."""


@dataclass(frozen=True, slots=True)
class Step:
    """The distance that the wheel has rolled between two counts.

    * ``lost``: whether the robot has also moved by an unknown amount.
    * ``unsure``: whether the start command may be lost, so that the wheel has not rolled.
    """

    wheel_m: float
    seconds: float
    lost: bool = False
    unsure: bool = False


class WheelCount:
    """The count of the right wheel's encoder.

    * ``last``: last accepted count.
    * ``told_s``, ``from_s``: most probable and earliest possible time of the last count.
    * ``certain``: whether the last reply is certainly the reply to ENC, the query of the count.
    * ``maybe``: the last reported count, if it may date from before the current motion; else 0. It
      only adds uncertainty.
    """

    def __init__(self) -> None:
        self.last: int | None = None
        self.told_s = self.from_s = -math.inf
        self.certain = False
        self.maybe = 0
        self.may_begin_anew = False
        """Whether the server may have reset the count to zero after its last reply."""
        self._raw: int | None = None
        self._before: int | None = None
        self._begins = self._confirmed = self._unseen = False
        self._same = self._odd = 0

    def begin(self) -> None:
        """Record that a start command was sent.

        If the server receives it, the count begins at zero again.
        """
        self._before, self.last = self.last, 0
        self.may_begin_anew = self._begins = True
        self.certain = self._confirmed = False
        self._same = self.maybe = 0

    def started(self) -> None:
        """Record that the server has acknowledged the motion."""
        self._confirmed = True

    def refused(self) -> bool:
        """Record that the server knows of no motion; return whether the server was restarted.

        If a count of the motion has come, but no acknowledgement, a restart has ended the motion.
        """
        if self._confirmed:
            return False
        if self._begins:
            # without a count of the motion, the motion did not begin
            self.last, self._begins = self._before, False
            return False
        return True

    def connect(self) -> None:
        """Begin a new connection.

        Before it, the robot may have moved, or the server may have restarted.
        """
        self.may_begin_anew = self._unseen = True

    def appear(self) -> None:
        """Record that the server answers again. It may have restarted while it did not answer."""
        if self.last is not None:
            self.may_begin_anew = self._unseen = True

    def rest(self) -> None:
        """Record that the motion is over.

        The next distance (Step) is measured from the last count received.
        """
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
        """Process a reported count; return the step since the last one, or None if implausible.

        ``stood_s``: time at which the robot was stopped; infinite while it is driven. ``rests``:
        whether the last motion is over.
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
            # maybe the count from before the start, if the start was lost
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
        """Reject an implausible count and return None, but accept the third one in a row.

        Three wrong replies in a row are unlikely. The result is then ``step``, the step to this
        count.
        """
        self._odd += 1
        if self._odd < ODD_TIMES:
            return None
        self._take(count, when)
        return step

    def _falls_back(self, count: int, when: Moment) -> bool:
        """Return whether an uncertain count contradicts the last count, and so is a wrong reply.

        Such a count is clearly nearer to zero than the last one, or has the other sign.
        """
        before = self.last or 0
        if abs(before) <= STRAY_COUNTS or not when.is_uncertain:
            return False
        return abs(count) < abs(before) - STRAY_COUNTS or count * before < 0

    def _take(self, count: int, when: Moment) -> None:
        self.last = self._raw = count
        self.told_s, self.from_s = when.at_s, when.from_s
        self.may_begin_anew = self._begins = self._unseen = False
        self._odd = self.maybe = 0
