# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The start of motions, and of jobs such as a download.

This module knows the wanted motion and the start commands; it does not know when a motion must end.
The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.commands.orders import EmergencyStop, GoTo
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import SLOW_S, Answer
from omnibot_driver.core.mart.ground import ESTOP_REPEAT_S, GREET_S, STARTS_UP_S
from omnibot_driver.core.mart.imu_checks import ImuChecks
from omnibot_driver.core.mart.jobs import RECORD_S, Job
from omnibot_driver.core.mart.replies import Fail
from omnibot_driver.core.mart.required_motion import is_turn_ramped
from omnibot_driver.core.mart.spot_turns import SLOW_UNITS
from omnibot_driver.core.mart.states import (
    HALTS,
    HARMFUL_LATE,
    NEEDS_IMU,
    STARTS,
    WHILE,
    Motion,
    State,
)
from omnibot_driver.core.mart.switch_off import RELEASE
from omnibot_driver.core.mart.words import Form, Kind, Request
from omnibot_driver.core.packets import NO_PACKETS, Packets

NAME_WAIT_S: Final = 2.0
"""Longest time in s for which a controlled move waits until all earlier HELLOs have arrived.

After this time, the driver sends the move anyway. Answers to HELLO then cannot show whether a copy
of the move is running.
"""
TIMED_OUT_S: Final = 0.5
"""After a start, the server waits at least this time in s before it reports that no wheel turns."""
STRAIGHT_S_PER_IN, TURN_S_PER_DEG = 0.5, 0.06
"""Longest duration of a controlled move: 3 s, plus this time in s for each inch or degree."""


class Starts(ImuChecks):
    """The part of the class ``Pilot`` that starts motions."""

    def _act(self, now: float) -> Packets:
        if self.state is State.STILL:
            return self._act_still(now)
        if self.state in (State.DRIVING, State.REVERSING) and self._fresh:
            return self._adjust(now)
        return NO_PACKETS

    def _act_still(self, now: float) -> Packets:
        self._use_turn_record()
        if setting := self._spin_setting(now):
            return self._ask(setting, now)
        switch_off = self._switch_off.needed and (self._rescue or self._runs_on)
        if not (self._rolled_out or self._rescue or switch_off):
            return NO_PACKETS  # a start would reset the count before the coasting was measured
        if isinstance(self._wanted, EmergencyStop) and now - self._estop_said_s >= ESTOP_REPEAT_S:
            self._estop_said_s = now
            self.proof.stopped(now)
            return self._send(HALTS[Motion.UNKNOWN], now)
        starts_up = now < self.appeared_s + STARTS_UP_S
        if self._switch_off.underway or switch_off or (starts_up and self._switch_off.needed):
            return self._switch_motors_off(now)  # safe while the server starts up, too
        if starts_up:
            return NO_PACKETS
        if self._rescue:
            return self._begin(words.MCR.request("SLOW", 1), now)
        if self.imu.retries(now):
            return self._check(now)
        start = self._next_start(now)
        if self._switch_off.needed and (start is None or now < self._again_s or self.refusal):
            return self._switch_motors_off(now)
        if start is None:
            self._name_awaited_s = math.inf  # the next move has its own wait
            return self._job(now)
        if now < self._again_s:
            return NO_PACKETS
        if why := self.refusal:
            self._notice(why, halt=True)
            return NO_PACKETS
        if self._copies_may_come(now) or self._name_may_come(start, now):
            return NO_PACKETS
        if start.word in NEEDS_IMU and not self.imu.fresh(now):
            return self._check(now)
        return self._begin(start, now)

    def _spin_setting(self, now: float) -> Request | None:
        """Return the request that sets the speed of a turn on the spot, if it must be sent now."""
        motion, twist = self._wish(now)
        if motion is not Motion.SPIN or is_turn_ramped(self._wanted, now):
            return None
        if self.refusal or now < self.appeared_s + STARTS_UP_S:
            return None
        network = self.conversation
        if network.disturbed(now) and now < network.certain_from_s(words.SSP):
            return None  # a copy of another reply could look like the reply to SSP
        return self._turns.setting(twist.yaw_rate_radps, now, self._delay_s)

    def _switch_motors_off(self, now: float) -> Packets:
        """Return the next request of a switch-off; no packets while this request must wait.

        MCS switches both motors off. Then MSM ends this direct control, so that moves work again.
        """
        request = self._switch_off.next()
        # before this time, a late reply could be mistaken for the reply to this request
        certain_s = self.conversation.certain_from_s(request.word)
        if request is RELEASE:
            # before this time, a duplicate of MCS could arrive after MSM
            certain_s = max(certain_s, self._harmful_s + self._delay_s)
        if now < certain_s:
            return NO_PACKETS
        self._require(request.word)
        if request.word in HARMFUL_LATE:
            self._harmful_s = now
        self._switch_off.sent()
        return self._ask(request, now)

    def _copies_may_come(self, now: float) -> bool:
        """Return whether a late copy of an earlier command could still harm a motion.

        The copy of a move would block the command port. The copy of a stop would end the motion.
        """
        moves = self.odometry.wheel.from_s < self._harmful_s + self._delay_s
        return moves or now < self._halted_s + self._delay_s

    def _name_may_come(self, start: Request, now: float) -> bool:
        """Return whether ``start`` must wait, because a HELLO may still be on its way.

        Only a controlled move waits, for at most ``NAME_WAIT_S``.
        """
        # if the check of the IMU is fresh, the driver has already waited before the check
        if start.word.kind is not Kind.MOVE or self.imu.fresh(now):
            return False
        if now >= self._greeted_s + self._delay_s:
            self._name_awaited_s = math.inf
            return False
        self._name_awaited_s = min(self._name_awaited_s, now)
        return now < self._name_awaited_s + NAME_WAIT_S

    def _next_start(self, now: float) -> Request | None:
        order = self._order(now)
        if isinstance(order, GoTo):
            return self._next_goal_move(order, now)
        motion, twist = self._wish(now)
        if motion is Motion.NONE or motion is self._blocked:
            return None
        if motion is Motion.SPIN:
            if is_turn_ramped(self._wanted, now):
                return None  # the server cannot change the rate of a turn, so the ramp ends first
            return self._turns.request(twist.yaw_rate_radps)
        if self.health.obstacle(motion, now):
            self._block(motion, "seen by the sonar")
            return None
        if motion is Motion.REFERENCE:
            units = self.loop.first_units(twist.vx_mps, twist.yaw_rate_radps)
            return words.RM.request(units)
        return words.B.request("SLOW")

    def _begin(self, start: Request, now: float) -> Packets:
        self._require(start.word)
        self._moved_last = start.word.kind is Kind.MOVE
        self.state, self.motion = State.STARTING, STARTS[start.word]
        self._recorded, self._port_is_free = None, False
        self._port_free_s, self._start_owed_until_s = math.inf, -math.inf
        # an answer to a HELLO from before the move does not prove that no duplicate of the move is
        # running
        self._greeted_before = now < self._greeted_s + self._delay_s
        self._start, self._refused, self._runs_on = start.word, False, False
        self._name_awaited_s = math.inf
        self._started_s = self._present_s = now
        self.imu.used()
        _, twist = self._wish(now)
        self.commanded = twist
        if start.word in HARMFUL_LATE:
            self._harmful_s = now
        self.proof.moved()
        self.odometry.speeds.forget()
        self.odometry.begin(self.motion, now)
        self._switch_off.begins(straight=self.motion is Motion.STRAIGHT)
        if start.word.kind is Kind.MOVE:
            self._last_move = start
            # the driver must not learn from the length of a docking move, which ends at the dock,
            # or of a turn that begins with the robot in motion
            self._moved_by = None if self.jobs.moving or self._rescue else start
            self._greet_s, self._free_s = now + GREET_S, math.inf
            self.state = State.MOVING
            self.commanded = None
        elif self.motion is Motion.REFERENCE:
            self.loop.begin(int(start.data.split()[1]), False, now)
        elif self.motion is Motion.REVERSE:
            self.loop.begin(SLOW_UNITS, True, now)
        else:
            self._turns.begin(twist.yaw_rate_radps)
        self._predict_turn()
        return self.conversation.ask(start, now, _longest_s(start) + 2 * self._delay_s)

    def _started(self, answer: Answer, now: float) -> None:
        if isinstance(answer.reply, Fail):
            # a restarted server has forgotten the speed of turns on the spot
            forgot = self.motion is Motion.SPIN and self._turns.may_be_forgotten(now)
            if answer.took_s - self.conversation.trip_s > TIMED_OUT_S:
                if not forgot:
                    self._learn_standing()
                self._doubt_the_left_wheel(answer.took_s)
            network = self.conversation
            quiet = not (answer.when.doubtful or network.disturbed(now))
            arrived = quiet and network.trip_s < SLOW_S
            self._start_failed(answer.reply, now, arrived=arrived)
            return
        if self.motion is Motion.REFERENCE:
            self.loop.started()
            self.health.reference_answers()
            self._obstacle_told = False
        self._no_starts, self.health.heading_changes = 0, 0
        self.state = WHILE[self.motion]
        self._begun_s = now
        # until then, the reply may be a copy of the ok to RST IMU
        copies_s = self._started_s + 2 * self._delay_s
        sure = not self.conversation.disturbed(now) or now >= copies_s
        self.odometry.started(now, sure=sure and not answer.when.doubtful)
        if not sure:  # the start's own reply may still come
            self._start_owed_until_s = self._started_s + answer.word.takes_s + 2 * self._delay_s
        self._polls.press(words.RMRA)
        self._polls.press(words.ENC)

    def _job(self, now: float) -> Packets:
        request = self.jobs.next(now, stands=self.proof.proved)
        if request is None:
            return NO_PACKETS
        if request.word in NEEDS_IMU:
            if why := self.refusal:
                self.jobs.cancel(why)
                return NO_PACKETS
            if self._copies_may_come(now):
                return NO_PACKETS
            if not self.imu.fresh(now):
                return self._check(now)
        elif now < self.conversation.certain_from_s(request.word):
            return NO_PACKETS  # a copy of another reply could look like the reply to the request
        if Form.FILE in request.word.forms:
            if now < self._file_s + 2 * self._delay_s:
                return NO_PACKETS  # a copy of the last request would bring another file
            self._file_s = now
        self.jobs.sent(request, now)
        if request.word in STARTS:
            return self._begin(request, now)
        self._require(request.word)
        self.state = State.SERVING
        if request.word in HARMFUL_LATE:
            self._harmful_s = now
        patience_s = None
        if self.jobs.job is Job.TURN_RECORD:
            patience_s = RECORD_S + 3 * self.conversation.trip_s
        return self.conversation.ask(request, now, patience_s)


def _longest_s(start: Request) -> float:
    """Return how long the server may take to answer the start command, in s."""
    if start.word.kind is not Kind.MOVE:
        return start.word.takes_s
    asked = float(start.data.split()[-1])
    straight = STARTS[start.word] is Motion.STRAIGHT
    return min(
        start.word.takes_s, 3.0 + asked * (STRAIGHT_S_PER_IN if straight else TURN_S_PER_DEG)
    )
