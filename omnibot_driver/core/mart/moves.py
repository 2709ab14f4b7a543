# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Controlled moves to a goal, one after another, and the evaluation of finished moves.

This module knows goals and moves; it does not know when a move may be sent. The caller passes the
time.
"""

import math
from typing import Final

from omnibot_driver.core.commands.orders import GoTo
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.asking import Asking
from omnibot_driver.core.mart.goal import INCH_M, Done, Move, next_move
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.states import NEEDS_IMU, Motion
from omnibot_driver.core.mart.stopping import SLOW_STOP
from omnibot_driver.core.mart.words import Request

LEAST_STOP_S: Final = 0.3
"""Shortest time in s from SL or SS until the server answers again, if a move was stopped."""


class Moves(Asking):
    """The part of the pilot that drives to a goal."""

    @property
    def goal_progress(self) -> str:
        """A text with the distance and the turn to the goal, and the number of the present move."""
        move = self._move
        if move is None:
            return "none"
        way = self.odometry.pose.way_to(move.place)
        turn_deg = math.degrees(math.remainder(way.yaw_rad, math.tau))
        left = f"{way.way_m:.2f} m and {turn_deg:.0f}° away"
        return f"over, {left}" if move.given_up else f"move {move.said}, {left}"

    def _next_goal_move(self, order: GoTo, now: float) -> Request | None:
        if self.jobs.job is Job.TURN_RECORD:
            return None
        if self._move is None:
            self._move = Move(order.place)
        request = next_move(self._move, self.odometry.pose, self._settings, self._surplus)
        if request is None:
            self._move.given_up = True  # the goal is over, even if the robot is pushed away
            return None
        if request.word in NEEDS_IMU and not self.imu.fresh(now):
            return request
        self._move.begin(request)
        return request

    def _moved(self, reply: Ok | Fail, now: float, *, sure: bool) -> None:
        """Evaluate the reply that ends a controlled move.

        ``sure``: whether the reply certainly belongs to this move.
        """
        motion = self.motion
        copies_s = self._started_s + 2 * self._delay_s  # of earlier requests, and their replies
        slow = self._is_slow_stop(reply, motion, now)  # the target was reached nevertheless
        if sure and (slow or isinstance(reply, Ok)) and now >= copies_s:
            self.odometry.wheel.started()
        if motion is Motion.STRAIGHT:
            self.odometry.doubt.end_straight()
        self.jobs.moved(reply, now)
        self.proof.stopped(now)
        self._rest(now)
        self._rolled = slow
        if slow:
            self._once(SLOW_STOP)
        elif isinstance(reply, Fail):
            self._moved_by = None  # the move was cut short
            discarded = ""
            if self._move is not None:
                self._move.fail()
                discarded = (
                    "; the goal of cmd_pose is discarded: remove the cause, then send it again"
                )
            reason = reply.reason or "the server gives no reason"
            self._notice(f"controlled move failed: {reason}{discarded}", halt=True)
            if reply.reason == words.IMU_LOST:
                self.imu.lost()

    def _learn_from(self, move: Request, now: float) -> None:
        """Learn by how much a move that has ended goes beyond its target.

        On a good network, the driver first downloads the server's record of a turn, because it is
        more exact.
        """
        turns = move.word in (words.MCR, words.MCL)
        if turns and self._records.wanted and not self.conversation.disturbed(now):
            try:
                self.jobs.ask(Job.TURN_RECORD, None, now)
            except RequestRefused:
                pass  # the user has called a job
            else:
                self._records.asked()
                self._recorded = move
                return
        asked_m = 0.0 if turns else float(move.data.split()[-1]) * INCH_M
        if not (self._rolled and abs(self.odometry.moved_m) < asked_m):  # else maybe an obstacle
            self._surplus.learn(move, self.odometry.moved_m, self.odometry.turn.spun_rad)

    def _use_turn_record(self) -> None:
        """Correct the heading by the record of the last turn, if its download has ended."""
        if self._recorded is None or self.jobs.job is Job.TURN_RECORD:
            return
        turn, self._recorded = self._recorded, None
        odometry = self.odometry
        if self.jobs.turn_record is None:
            self._records.cancelled()
        else:
            spun_rad, ratio = odometry.turn.spun_rad, odometry.left_over_right
            degrees = self._records.degrees(*self.jobs.turn_record, turn)
            if degrees is not None and odometry.turn_recorded(degrees):
                wheel_rad = spun_rad / (2.0 if ratio is None else 1.0 - ratio)
                self._records.used(odometry.turn.spun_rad, wheel_rad)
        self._surplus.learn(turn, 0.0, odometry.turn.spun_rad)

    def _done(self, move: Request, free_s: float) -> Done:
        """Return the last move with its measurements.

        ``free_s``: time of the first reply after the move.
        """
        return Done(
            move,
            self.odometry.moved_m,
            self.odometry.turn.spun_rad,
            lasted_s=self._rested_s - self._started_s,
            quiet_s=free_s - self._rested_s + self._delay_s,
        )

    def _stopped_a_copy(self, move: Request, now: float) -> bool:
        """Return whether SL and SS may have stopped a copy of ``move``.

        The result is False in one case: the server has answered sooner than it can end a motion,
        and the time was too short for a copy to end by itself.
        """
        if self._copies_stopped_s < self._rested_s:
            return False
        free_s = min(now, self._port_free_s)
        quick = free_s < self._first_copy_stop_s + LEAST_STOP_S
        done = self._done(move, free_s)
        return not (quick and done.quiet_s < done.usual_s / 2)

    def _doubt_a_copy(self, now: float, *, suspected: bool) -> bool:
        """Return whether the server may have run the last controlled move twice.

        After two runs, the encoder count covers only the second one, so the uncertainty grows.

        ``suspected``: whether SL and SS may have stopped the second run.
        """
        move, self._last_move = self._last_move, None
        if move is None or not (suspected or self.conversation.disturbed(now)):
            return False
        done = self._done(move, now)
        twice = done.may_have_run_twice(self._delay_s)
        if twice:
            self.odometry.doubt.add(
                *((done.asked**2, 0.0) if done.is_straight else (0.0, done.asked**2))
            )
        return twice
