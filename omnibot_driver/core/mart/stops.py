# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The reasons to stop a motion, and the stop itself.

A motion is also stopped if the driver does not know what the robot does. This module knows the
wanted command, measurements and the stop commands; it does not know how a motion begins. The caller
passes the time.
"""

import math
from abc import ABC, abstractmethod
from typing import Final

from omnibot_driver.core.commands.orders import Drive, GoTo
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.ground import Ground
from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.required_motion import STANDING, moving_order, required_motion
from omnibot_driver.core.mart.states import (
    HALTS,
    LAST_HALTS,
    ROLLING,
    Motion,
    State,
)
from omnibot_driver.core.mart.stopping import ANSWERS, ROUNDS, SLOW_STOP, Stopping, is_slow_stop
from omnibot_driver.core.mart.words import Form
from omnibot_driver.core.packets import NO_PACKETS, Packets

BLIND_S, TRIPS = 0.8, 5
"""Terms of the longest time for which the robot may drive without a new measurement.

This time is BLIND_S (s), plus TRIPS times the average duration of an exchange.
"""
FROZEN_S, FROZEN_TIMES = 0.5, 3
"""Limits for a heading that stays constant. The driver stops the robot when both limits are
reached, because the IMU may be dead, or the robot stuck.

``FROZEN_S``: limit, in s, of the time for which the heading is constant. Twice the average duration
of a query is added to it.

``FROZEN_TIMES``: limit of the number of replies with the same heading. On a slow network, only few
replies come within the time limit, and they may be equal by chance.
"""
NO_START_S: Final = 1.5
"""Longest allowed time in s from the start of a motion until the robot moves."""
LATE: Final = " while the robot drives: check the network"
STUCK: Final = (
    "the robot is commanded to move, but does not move: check motors, wheels and power, and"
    " whether another program stops it"
)
HALF_STUCK: Final = (
    "one wheel does not turn: check its motor, wiring and power; forward motion is refused until"
    " the command ends"
)
UNCONTROLLED: Final = (Motion.REFERENCE, Motion.REVERSE, Motion.SPIN)
CREEP_MPS, CREEP_RADPS = 0.01, 0.02
"""Limits in m/s and rad/s. A robot whose measured speed or turn rate exceeds one of them certainly
moves."""
BLOCKED_S: Final = 0.6
"""Time in s for which a wheel must stand still in a drive before it is regarded as blocked."""
STUCK_S, COASTS_S = 0.5, 0.2
"""Times in s for which the left wheel, which has no encoder, may turn unseen.

``STUCK_S``: time before the driver stops a robot that does not seem to move. The left wheel may
turn in this time if only the right wheel is stuck.

``COASTS_S``: time after the driver has stopped the robot because a wheel is blocked. The server
ends the measurement when the right wheel is at rest, but the left wheel may still coast.
"""
LOST_REPEAT_S: Final = 1.0
NAMES: Final = {
    Motion.REFERENCE: "RM",
    Motion.REVERSE: "B",
    Motion.SPIN: "R or L",
    Motion.STRAIGHT: "TF or TB",
    Motion.TURN: "MCR or MCL",
    Motion.UNKNOWN: "a motion of another program",
    Motion.NONE: "nothing",
}


class Stops(Ground, ABC):
    """The part of the pilot that stops motions."""

    def _order(self, now: float) -> Drive | GoTo | None:
        return moving_order(self._wanted, now)

    def _wish(self, now: float) -> tuple[Motion, BodyTwist]:
        return required_motion(self._order(now), self._settings.track_m)

    def _agrees(self, now: float) -> bool:
        """Return whether the motion in progress is what the current command or job needs."""
        motion, twist = self._wish(now)
        if self.motion in (Motion.STRAIGHT, Motion.TURN):
            return self._move is not None or self.jobs.moving or self._rescue
        if motion is not self.motion:
            return False
        if motion is Motion.SPIN:
            turned_s = now - self._begun_s if self.state is State.TURNING else 0.0
            disturbed = self.conversation.disturbed(now)
            return self._turns.fits(
                twist.yaw_rate_radps, now, turned_s=turned_s, disturbed=disturbed
            )
        return True

    def _why_stop(self, now: float) -> str:
        """Return why the current motion must not continue, as a sentence for the user.

        Return "wanted" if another motion is commanded; empty if the motion may continue.
        """
        if self.state not in (State.STARTING, State.MOVING, *ROLLING):
            return ""
        if self.health.tripped:
            return f"the motor board reports {self.health.tripped}"
        if not self._agrees(now):
            return "wanted"
        if self.state not in ROLLING:
            return ""
        odometry = self.odometry
        blind_s = BLIND_S + TRIPS * self.conversation.trip_s
        if self._heading_is_told and now - max(odometry.heading.told_s, self._begun_s) > blind_s:
            return f"the server does not report the relative heading{LATE}"
        if now - max(odometry.wheel.told_s, self._begun_s) > blind_s:
            return f"the server does not report the encoder count{LATE}"
        if (
            odometry.wheel.told_s - self._begun_s > NO_START_S
            and abs(odometry.speeds.means[0]) < CREEP_MPS
            and abs(odometry.speeds.means[1]) < CREEP_RADPS
        ):
            return STUCK
        if self.state is State.DRIVING and self.loop.blocked_s > BLOCKED_S:
            return HALF_STUCK
        longest_s = FROZEN_S + 2 * self.conversation.trip_s
        frozen = odometry.heading.same >= FROZEN_TIMES and self._frozen_s > longest_s
        if self._heading_is_told and frozen:
            if self.motion is not Motion.SPIN and abs(odometry.speeds.means[0]) < CREEP_MPS:
                return STUCK
            return "the relative heading does not change: the IMU is dead, or the robot cannot turn"
        return ""

    @property
    def _heading_is_told(self) -> bool:
        return self.state is State.DRIVING or self.motion in self.health.heading_told

    @property
    def _frozen_s(self) -> float:
        """Time in s for which the reported heading in this motion has been constant."""
        odometry = self.odometry
        return odometry.heading.told_s - max(odometry.heading.changed_s, self._begun_s)

    def _halt(self, now: float, why: str = "", *, arrived: bool = False) -> None:
        """Begin to stop any motion in progress.

        ``why``: the fault, for a notice to the user; empty without a fault. A fault also discards
        the user's command, unless this motion is already refused until the command ends.

        ``arrived``: whether it is certain that the server received the start of the motion.
        """
        if why:
            self._notice(f"{why}; robot stopped", halt=self._blocked is not self.motion)
            self._turns.forget_setting()
        if self.jobs.moving:
            self.jobs.cancel(
                f"{why or 'the reply to the move was lost'}; the robot was stopped; call again if"
                " the topic `docked` is false"
            )
        pending = self.conversation.pending
        answers = ANSWERS.get(self.motion, ())
        owed = int(pending is not None and any(form in answers for form in pending.word.forms))
        # a copy of the reply to the check may have been mistaken for the reply to the start
        owed += now < self._start_owed_until_s and self.conversation.doubles(now)
        self.conversation.give_up(now)
        move = self._start if self.motion in (Motion.STRAIGHT, Motion.TURN) else None
        self.odometry.stopping(now)
        self._stopping = Stopping(
            self.motion,
            now,
            delay_s=self._delay_s,
            started_s=-math.inf if arrived else self._started_s,
            owed=owed,
            move=move,
            planned=not why,
        )
        self.state = State.STOPPING

    def _keep_stopping(self, now: float) -> Packets:
        stopping = self._stopping
        assert stopping is not None
        if stopping.failed and now >= stopping.wake_at:
            if self.motion is Motion.UNKNOWN and not self.greeted:
                self._ask_what_moves(now)
                return NO_PACKETS
            self._lose()
            return self._repeat_lost(now)
        said = stopping.due(now)
        packets = self._send(said, now)
        if said:
            self.proof.stopped(now)
            self.commanded = STANDING
            if not self.greeted or stopping.asks_name(now):
                packets += self._greet(now)
        return packets

    def _stopped(self, now: float) -> None:
        """End the stop of a motion after the server's answer; evaluate how this motion ended."""
        stopping, self._stopping = self._stopping, None
        self._moved_by = None  # the move was cut short
        self.conversation.settle(now)
        assert stopping is not None
        result, motion = stopping.result, stopping.motion
        if motion is not Motion.UNKNOWN and stopping.rounds >= ROUNDS:
            self.conversation.missed_s = now  # maybe a restart left a stop command unanswered
        if Form.INTEGER in ANSWERS.get(motion, ()):
            self.conversation.owes(Form.INTEGER, now)
        if result is None and motion is not Motion.UNKNOWN and not self.conversation.doubles(now):
            result = stopping.doubtful_result  # a repeated stop has found nothing to stop
        if stopping.move is not None and result is None:
            for form in stopping.move.forms:
                self.conversation.owes(form, now)  # the reply to the move
        elif stopping.move is not None and isinstance(result, Ok):
            self.conversation.answered(stopping.move, result, now)
        if stopping.began:
            self.odometry.wheel.started()
        elif (
            stopping.began is False
            and (motion in UNCONTROLLED or self._refused)  # a controlled move ends by itself
            and not self.conversation.doubles(now)
        ):
            self.odometry.refused()
        self._rolled = result is not None and self._is_slow_stop(result, motion, now)
        slow = stopping.planned and self._rolled
        told = isinstance(result, Ok) and result.form is Form.INTEGER
        if motion is Motion.SPIN and (told or slow or result is None):
            uncounted_s = max(0.0, stopping.began_s - self.odometry.wheel.told_s)
            self._turns.stopped(
                result.number if isinstance(result, Ok) else None,
                uncounted_s,
                now - self._begun_s,
                disturbed=self.conversation.disturbed(now),
            )
        if motion is Motion.STRAIGHT:
            self.odometry.doubt.end_straight()
        if slow:
            self._once(SLOW_STOP)
        elif isinstance(result, Fail):
            self._failed(motion, result, now)
        elif result is None and motion is not Motion.UNKNOWN and not self._refused:
            lost = self._begun_s < self._started_s and self._seems_present
            if not lost:
                self._appears(now)  # the server knows of no motion, so maybe it was restarted
        if result is None:
            self._switch_off.doubt()
            # the motion had begun, but the server knows of none: the motors may run on
            self._runs_on |= motion in UNCONTROLLED and self._begun_s >= self._started_s
        if motion is Motion.UNKNOWN:
            self._negative_sweep = result is None
            self._swept_s = now
            self.greeted = True
        self._rest(now)

    def _is_slow_stop(self, reply: Reply, motion: Motion, now: float) -> bool:
        return is_slow_stop(reply, motion, now - self._started_s - self.conversation.trip_s)

    def _may_be_count(self, reply: Reply) -> bool:
        """Return whether a number in a reply may be an encoder count instead of a turn's angle."""
        stopping = self._stopping
        assert stopping is not None
        if stopping.motion is not Motion.SPIN:
            return False
        counted_s = max(self.odometry.wheel.told_s, self._started_s)
        unseen_s = max(0.0, stopping.began_s - counted_s)
        return self._turns.may_be_count(reply, unseen_s, self.conversation.trip_s)

    def _lose(self, why: str = "") -> None:
        """Regard the server as lost, and report that once.

        A lost server does not answer stops, and may be moving the robot. Motion is refused.
        """
        self._stopping = None
        self.state = State.LOST
        self._said_lost_s = -math.inf
        if self._lost_told:
            return
        self._lost_told = True
        self.lost += 1
        why = why or f"the server does not answer the command that stops {NAMES[self.motion]}"
        self._notice(
            f"server lost: {why}; motion is refused; cut the motor power if the robot moves, then"
            " restart the server",
            halt=True,
        )

    def _outlives(self, reply: Reply, now: float) -> None:
        """Detect a stop port that still waits for the end of the motion that it should stop.

        The stop port still waits if the server answers a stop command after the driver has used the
        stop port. The port could then hang the next forward drive (RM); see
        docs/internals/mart_protocol.md.

        A reply with a number is ignored. It answers an earlier query, or the stop command of a turn
        on the spot. Such a stop command leaves the stop port free.
        """
        if not isinstance(reply, Ok) or self.motion is Motion.SPIN:
            return
        network = self.conversation
        asked = network.pending is not None or now < network.late_until_s(Form.NOTHING)
        if self.state is State.ASKING and asked:
            return  # maybe the reply to RST IMU or MSM
        if reply.form is Form.NOTHING and reply.form in ANSWERS.get(self.motion, ()):
            self.health.outlives()

    def _repeat_lost(self, now: float) -> Packets:
        if now < self._said_lost_s + LOST_REPEAT_S:
            return NO_PACKETS
        self._said_lost_s = now
        unknown = self.motion is Motion.UNKNOWN
        said = LAST_HALTS[self.motion] if unknown else HALTS[self.motion]
        return self._send(said, now) + self._greet(now)

    @abstractmethod
    def _learn_standing(self) -> None:
        """Record that the present motor units are too small to turn the motors."""

    @abstractmethod
    def _ask_what_moves(self, now: float) -> None:
        """Begin to ask which motion is in progress, after the driver has used the stop port."""

    def _obstacle(self, reply: Fail, motion: Motion) -> str:
        """Return why a motion failed, as text. Refuse its direction if the cause is an obstacle."""
        if reply.reason in words.OBSTACLES:
            self._block(motion, reply.reason)
            return f"the controller reports an obstacle ({reply.reason})"
        if reply.reason in (words.NO_MOTION, words.NOT_IN_MOTION):
            return (
                "the server knows of no motion: it was restarted, or another program has stopped"
                " the robot"
            )
        if reply.reason == words.UNSUPPORTED:
            return "the server does not know the command that starts this motion: update the server"
        return (
            f"the controller has ended the motion ({reply.reason or 'no reason given'}): look for"
            " an obstacle, or another program that commands the robot"
        )

    def _failed(self, motion: Motion, reply: Fail, now: float) -> None:
        if motion is Motion.STRAIGHT and reply.reason in words.OBSTACLES:
            self._notice(f"an obstacle has ended the move ({reply.reason})", halt=False)
        elif reply.reason in words.OBSTACLES:
            self._block(motion, reply.reason)
        elif reply.reason == words.NO_START and motion in UNCONTROLLED:
            self._learn_standing()
        elif reply.reason == words.IMU_LOST:
            self.imu.lost()
            self._notice(self.health.refusal, halt=True)
        else:
            self._notice(self._obstacle(reply, motion), halt=True)

    def _block(self, motion: Motion, why: str) -> None:
        """Refuse the direction of ``motion`` until the user's command ends or is zero."""
        if self._blocked is not motion:
            self._blocked = motion
            where = "behind" if motion is Motion.REVERSE else "in front"
            self._notice(
                f"obstacle {where} ({why}); this direction is refused until the command ends",
                halt=False,
            )
