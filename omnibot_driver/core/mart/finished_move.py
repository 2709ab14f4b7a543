# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The evaluation of a controlled move that has ended: was it complete, and did it run twice?

This module knows requests, times and measurements; it does not know replies or the odometry.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.mart.goal import INCH_M
from omnibot_driver.core.mart.words import MCR, TB, TF, Request

LEAST_LIKE: Final = 0.65
"""Smallest measured distance or turn of a complete move, as a fraction of the requested or the
expected one, whichever is smaller. A move with less is regarded as incomplete."""
SETTLES_S, S_PER_DEG, S_PER_IN = 0.7, 1 / 70, 1 / 8
"""Usual duration of a move in s: SETTLES_S, plus S_PER_DEG per degree or S_PER_IN per inch.

The word SLOW in a request doubles the times per degree and inch; ``Done.slowness`` adapts them to
the robot.
"""
LEAST_PACE: Final = 0.65
"""Lowest plausible mean speed of an incomplete move, as a fraction of the move's usual speed."""
FULL, TWO = 0.6, 1.25
"""``FULL``: shortest duration of one complete run of a move. ``TWO``: shortest duration of two
complete runs. Both are fractions of the move's usual duration."""
LEAST_CUT_M, LEAST_CUT_RAD = 0.1, math.radians(15.0)
"""Smallest requested distance in m, and smallest requested turn in rad, for which the encoder count
can show that the run was incomplete."""


@dataclass(frozen=True, slots=True)
class Done:
    """A controlled move that has ended, with its measurements.

    * ``way_m``, ``turned_rad``: distance and turn by the encoder. If the move had a second run,
      both values are for the second run alone.
    * ``lasted_s``: time in s from the request to the reply.
    * ``quiet_s``: longest possible duration of a second run, in s.
    * ``completed``: whether the server reported success, and no stop ended the move.
    * ``expected``: distance in m, or turn in rad, of a complete run, learned from earlier moves.
    * ``stopped_again``: whether the driver has sent a stop after the move, against a second run.
    * ``slowness``: usual time per inch or degree, divided by that of a robot with the default
      settings.
    * ``gyro_scale``: true turn divided by the turn that the server's gyro measures.
    """

    request: Request
    way_m: float
    turned_rad: float
    lasted_s: float
    quiet_s: float
    completed: bool
    stopped_again: bool
    expected: float
    slowness: float = 1.0
    gyro_scale: float = 1.0

    @property
    def is_straight(self) -> bool:
        """Whether the move is straight. If it is not, it is a turn on the spot."""
        return self.request.word in (TF, TB)

    @property
    def asked(self) -> float:
        """The requested distance in m, or turn in rad."""
        number = float(self.request.data.split()[-1])
        return number * INCH_M if self.is_straight else self.gyro_scale * math.radians(number)

    @property
    def _least(self) -> float:
        return LEAST_CUT_M if self.is_straight else LEAST_CUT_RAD

    @property
    def is_large(self) -> bool:
        """Whether the move is so large that the encoder count can show an incomplete run."""
        return self.asked >= self._least

    @property
    def longest(self) -> float:
        """Longest distance in m, or turn in rad, of one complete run."""
        return 2 * self.asked + self._least

    @property
    def usual_s(self) -> float:
        """The usual duration of the move, in s."""
        number = float(self.request.data.split()[-1])
        slow = self.slowness * (2 if b"SLOW" in self.request.data.split() else 1)
        return SETTLES_S + slow * number * (S_PER_IN if self.is_straight else S_PER_DEG)

    @property
    def _is_short(self) -> bool:
        """Whether the encoder count is too small for a complete move."""
        return self._seen < LEAST_LIKE * min(self.asked, self.expected)

    @property
    def _seen(self) -> float:
        return abs(self.way_m if self.is_straight else self.turned_rad)

    @property
    def went_the_wrong_way(self) -> bool:
        """Whether the right wheel has turned clearly against the requested direction."""
        seen = self.way_m if self.is_straight else self.turned_rad
        return (seen if self.request.word in (TB, MCR) else -seen) > self._least

    @property
    def contradicts_the_server(self) -> bool:
        """Whether the server has reported a completed turn, but the encoder shows a wrong one.

        The server ends a turn by the gyro, and may not notice a wheel that is stuck or slips.
        """
        if self.is_straight or not self.completed or not self.is_large:
            return False
        return self._is_short or LEAST_LIKE * self._seen > max(self.asked, self.expected)

    @property
    def may_have_run_twice(self) -> bool:
        """Whether the server may have run the move twice, because its request was duplicated."""
        no_time = self.quiet_s < FULL * self.usual_s and not self.ended_late
        if self.stopped_again:  # the stop may have cut the second run short
            return not (no_time and self._seen >= self.asked)
        return not (no_time and (self.completed or not self._is_short))

    @property
    def has_run_twice(self) -> bool:
        """Whether the measurements show that the server has run the move twice.

        The encoder counts from zero in a second run. If the count of a completed move is too small,
        a second run was stopped.
        """
        whole = self.completed and not self.ended_early
        return whole and self.stopped_again and self._is_short and self.is_large

    @property
    def ended_late(self) -> bool:
        """Whether the reply came so late that the server may have run the move twice.

        If the reply to the first run is lost, the reply to the second run seems to be late.
        """
        return self.lasted_s >= TWO * self.usual_s

    @property
    def lags(self) -> bool:
        """Whether an incomplete move went much less far than a move usually goes in this time.

        The request may then have been duplicated, and the encoder may show only the second run.
        """
        driven_s = self.lasted_s - 2 * SETTLES_S
        least = LEAST_PACE * self.asked * driven_s / (self.usual_s - SETTLES_S)
        return not self.completed and self._seen < least

    @property
    def ended_early(self) -> bool:
        """Whether the reply came so early that the move cannot have been complete.

        Such a reply answers another request. A stop after such a reply has ended the move itself,
        not a duplicate of the move.
        """
        return self.lasted_s < FULL * self.usual_s
