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
"""Smallest measured distance or turn of a complete move, as a fraction.

It is a fraction of the smaller one of two values: the requested distance or turn, and the expected
distance or turn.
"""
SETTLES_S, S_PER_DEG, S_PER_IN = 0.7, 1 / 70, 1 / 8
"""Usual duration of a move in s: SETTLES_S, plus S_PER_DEG per degree or S_PER_IN per inch.

The word SLOW in a request doubles the times per degree and inch.
"""
FULL, TWO = 0.6, 1.4
"""Shortest durations of one and of two complete runs of a move, as fractions of the usual one."""
LEAST_CUT_M, LEAST_CUT_RAD = 0.1, math.radians(15.0)
"""Smallest request, in m or rad, for which the encoder count shows an incomplete run."""


@dataclass(frozen=True, slots=True)
class Done:
    """A controlled move that has ended, with its measurements.

    A duplicate of the request may have started a second run of the same move.

    ``way_m``, ``turned_rad``: distance and turn by the encoder. If there was a second run, they are
    the distance and turn of the second run alone.

    ``lasted_s``: time in s from the request to the reply.

    ``quiet_s``: longest possible duration of a second run, in s.

    ``completed``: whether the server reported success, and no stop ended the move.

    ``expected``: distance in m, or turn in rad, of a complete run, learned from earlier moves.

    ``stopped_again``: whether the driver has sent a stop after the move, to end a possible second
    run.
    """

    request: Request
    way_m: float
    turned_rad: float
    lasted_s: float
    quiet_s: float
    completed: bool
    stopped_again: bool
    expected: float

    @property
    def is_straight(self) -> bool:
        """Whether the move is straight; else it is a turn on the spot."""
        return self.request.word in (TF, TB)

    @property
    def asked(self) -> float:
        """The requested distance in m, or turn in rad."""
        number = float(self.request.data.split()[-1])
        return number * INCH_M if self.is_straight else math.radians(number)

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
        slow = 2 if b"SLOW" in self.request.data.split() else 1
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
        """Whether the right wheel has turned far against the direction of the request."""
        seen = self.way_m if self.is_straight else self.turned_rad
        return (seen if self.request.word in (TB, MCR) else -seen) > self._least

    @property
    def contradicts_the_server(self) -> bool:
        """Whether the encoder contradicts the server, which has reported a completed turn.

        The encoder contradicts the server if the right wheel has turned much less or much more than
        the turn requires. The server ends a turn by the gyro, so it may not notice a wheel that is
        stuck or slips.
        """
        if self.is_straight or not self.completed or not self.is_large:
            return False
        return self._is_short or LEAST_LIKE * self._seen > max(self.asked, self.expected)

    @property
    def may_have_run_twice(self) -> bool:
        """Whether the server may have run the move twice, from a duplicated datagram."""
        no_time = self.quiet_s < FULL * self.usual_s and not self.ended_late
        if self.stopped_again:  # the stop may have cut the second run short
            return not (no_time and self._seen >= self.asked)
        return not (no_time and (self.completed or not self._is_short))

    @property
    def has_run_twice(self) -> bool:
        """Whether the server has run the move twice.

        The first run was complete. The driver has stopped the second run.
        """
        whole = self.completed and not self.ended_early
        return whole and self.stopped_again and self._is_short and self.is_large

    @property
    def ended_late(self) -> bool:
        """Whether the reply came so late that the move may have run twice.

        If the network has duplicated the request, the server runs the move twice. The reply may
        then be the answer to the second run, because the network has lost the answer to the first
        run.
        """
        return self.lasted_s >= TWO * self.usual_s

    @property
    def ended_early(self) -> bool:
        """Whether the reply came so early that the move cannot have been complete.

        Such a reply belongs to another request. After this reply, the driver may have sent a stop
        to end a possible second run. If so, this stop has in fact ended the first run.
        """
        return self.lasted_s < FULL * self.usual_s
