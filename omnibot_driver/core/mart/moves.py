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
from omnibot_driver.core.mart.finished_move import FULL, Done
from omnibot_driver.core.mart.goal import INCH_M, MOST_MOVES, Move, next_move
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import NEEDS_IMU, Motion
from omnibot_driver.core.mart.stopping import SLOW_STOP
from omnibot_driver.core.mart.turn_angle import is_of_another
from omnibot_driver.core.mart.words import Request

UNLIKELY: Final = 1 / 3
"""Assumed error of the odometry if the server may have run a move twice, but probably has not.

The error is a standard deviation, as a fraction of the move.
"""
RAN_TWICE: Final = (
    "the network has delivered a controlled move twice, and the driver has stopped the second run"
    " of the move. The first run was not measured; for it, `odom` uses the expected distance or"
    " turn of the move: check the network"
)
CONTRADICTED: Final = (
    "the controller has measured a turn of {:.0f}°, but the right wheel shows {:.0f}°: "
)
SLIPS: Final = "one wheel may be stuck or slip, so the heading is uncertain"
OPPOSITE: Final = "the directions are opposite; check `heading_inverted` and `encoder_inverted`"
WRONG_WAY: Final = (
    "the right wheel turned against the direction of a controlled move: check `encoder_inverted`,"
    " and the wiring of motors and encoder"
)
DISCARDED: Final = "; the goal of cmd_pose is discarded: remove the cause, then send the goal again"
OFF_COURSE_RAD: Final = 0.5
"""Assumed standard deviation, in rad, of the angle by which the robot turns in a failed move.

The server does not report this angle.
"""
LEAST_STOP_S: Final = 0.3
"""Shortest time in s that the server needs to stop a controlled move after SL or SS.

The server answers again only after this time.
"""


class Moves(Asking):
    """The part of ``Pilot`` that drives to a goal."""

    @property
    def goal_progress(self) -> str:
        """A text with the distance and the turn to the goal, and the number of the current move."""
        move = self._move
        if move is None:
            return "none"
        left = self._left(move)
        return f"over, {left} away" if move.given_up else f"move {move.said}, {left} away"

    def _left(self, move: Move) -> str:
        way = self.odometry.pose.way_to(move.place)
        turn_deg = math.degrees(math.remainder(way.yaw_rad, math.tau))
        return f"{way.way_m:.2f} m and {turn_deg:.0f}°"

    def _next_goal_move(self, order: GoTo, now: float) -> Request | None:
        if self.jobs.job is Job.TURN_RECORD:
            return None
        if self._move is None:
            self._move = Move(order.place)
        request = next_move(self._move, self.odometry.pose, self._settings, self._surplus)
        if request is None:
            self._move.given_up = True  # the goal is over, even if the robot is pushed away
            return None
        if self._move.said >= MOST_MOVES:
            self._move.fail()
            left = self._left(self._move)
            self._notice(
                f"goal not reached after {MOST_MOVES} moves: {left} left{DISCARDED}", halt=True
            )
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
        # until then, copies of earlier requests and their replies may come
        copies_s = self._started_s + 2 * self._delay_s
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
                discarded = DISCARDED
            reason = reply.reason or "the server gives no reason"
            self._notice(f"controlled move failed: {reason}{discarded}", halt=True)
            if reply.reason == words.IMU_LOST:
                self.imu.lost()
            elif reply.reason in (words.GYRO, words.NO_START):
                self.odometry.doubt_turn(OFF_COURSE_RAD)

    def _learn_from(self, move: Request, now: float) -> None:
        """Learn from a finished move how far the robot moves beyond the requested distance or turn.

        After a turn, the driver may download the server's record of the turn before it learns.
        """
        turns = move.word in (words.MCR, words.MCL)
        if turns and self._records.wanted and not self.conversation.disturbed(now):
            try:
                self.jobs.ask(Job.TURN_RECORD, None, now)
            except RequestRefused:
                pass  # another job is in progress
            else:
                self._records.asked()
                self._recorded = move
                return
        asked_m = 0.0 if turns else float(move.data.split()[-1]) * INCH_M
        # nothing is learned from a slow stop before the requested distance: an obstacle may have
        # ended the move
        if not (self._rolled and abs(self.odometry.moved_m) < asked_m):
            self._surplus.learn(move, self.odometry.moved_m, self._spun_by_gyro_rad)

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
        self._surplus.learn(turn, 0.0, self._spun_by_gyro_rad)

    def _end_move(self, now: float) -> None:
        """End a motion after its last encoder count. If it was a controlled move, evaluate it."""
        move, self._last_move = self._last_move, None
        completed, self._moved_by = self._moved_by is not None, None
        if move is None:
            wrong_rad = self.odometry.rest()
            if wrong_rad and not self.conversation.disturbed(now):
                spun_rad = self.odometry.turn.spun_rad
                told_rad = spun_rad - wrong_rad
                why = SLIPS if is_of_another(told_rad + spun_rad, spun_rad) else OPPOSITE
                angles = math.degrees(told_rad), math.degrees(spun_rad)
                self._notice(CONTRADICTED.format(*angles) + why, halt=False)
            return
        done = self._done(move, now, completed=completed)
        stopped = self._may_have_stopped_a_copy(done, now)
        # if the odometry was reset during the move, only a part of the move is measured
        whole = self._surplus.is_known(move) and not self.odometry.begins_in_move
        twice = stopped and whole and done.has_run_twice
        slow = done.ended_late or done.lags
        disturbed = stopped or slow or self.conversation.disturbed(now)
        doubtful = disturbed and done.may_have_run_twice
        likely = stopped and not (completed and done.ended_early)
        if doubtful and not twice:
            error = done.asked * (1.0 if likely or slow else UNLIKELY)
            self.odometry.doubt.add(*((error**2, 0.0) if done.is_straight else (0.0, error**2)))
        self.odometry.rest(done.longest)
        if done.went_the_wrong_way and self._move is not None and not self._move.given_up:
            self._move.fail()
            self._notice(WRONG_WAY + DISCARDED, halt=True)
        elif twice:
            self.odometry.run_before(done.is_straight, self._expected(move))
            self._notice(RAN_TWICE, halt=False)
        elif completed and likely and doubtful and done.is_large:
            self._discard_goal()
        elif done.contradicts_the_server and not self.conversation.disturbed(now):
            self._stop_contradicted(done)
        elif completed and not (stopped and doubtful):
            self._learn_from(move, now)

    @property
    def _spun_by_gyro_rad(self) -> float:
        """The last turn as the server's gyro measures it, in rad. Its sign does not matter."""
        return self.odometry.turn.spun_rad / self._settings.heading_scale

    def _expected(self, move: Request) -> float:
        """Return how far a complete move really goes: forward in m, or to the left in rad."""
        turns = move.word in (words.MCR, words.MCL)
        scale = abs(self._settings.heading_scale) if turns else 1.0
        return scale * self._surplus.expected(move)

    def _done(self, move: Request, now: float, *, completed: bool) -> Done:
        free_s = min(now, self._port_free_s)
        ours, usual = self._settings, MartSettings()
        slowness = usual.speed_per_unit / ours.speed_per_unit
        if move.word in (words.MCR, words.MCL):
            slowness *= abs(ours.heading_scale) * ours.track_m / usual.track_m
        return Done(
            move,
            self.odometry.moved_m,
            self.odometry.turn.spun_rad,
            lasted_s=self._rested_s - self._started_s,
            quiet_s=free_s - self._rested_s + self._delay_s,
            expected=abs(self._expected(move)),
            completed=completed,
            stopped_again=self._copies_stopped_s >= self._rested_s,
            slowness=slowness,
            gyro_scale=abs(ours.heading_scale),
        )

    def _may_have_stopped_a_copy(self, done: Done, now: float) -> bool:
        """Return whether the driver may have stopped a second run of a controlled move.

        False if no stop was sent after the move, or if the move was complete and the server
        answered too soon for a second run.
        """
        quick = min(now, self._port_free_s) < self._first_copy_stop_s + LEAST_STOP_S
        no_time = quick and done.quiet_s < FULL * done.usual_s
        return done.stopped_again and not (done.completed and no_time)

    def _stop_contradicted(self, done: Done) -> None:
        """Discard the goal, because encoder and server have measured different angles of a turn."""
        self.odometry.doubt_turn(done.asked - abs(done.turned_rad))
        if self._move is not None:
            self._move.fail()
        asked_deg, seen_deg = math.degrees(done.asked), math.degrees(abs(done.turned_rad))
        self._notice(CONTRADICTED.format(asked_deg, seen_deg) + SLIPS + DISCARDED, halt=True)

    def _discard_goal(self) -> None:
        """Discard the goal, because the network may have delivered its last move twice."""
        if self._move is None or self._move.given_up:
            return
        self._move.fail()
        self._notice(
            "the server did not answer in time after a controlled move. The network may have"
            " delivered the move twice, so the driver has sent a stop. The driven distance is"
            " unknown, so the goal of cmd_pose is discarded: check the network, then send the goal"
            " again",
            halt=True,
        )
