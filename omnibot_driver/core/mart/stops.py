# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The stop of a motion, and what happens if the server does not answer the stop.

This module knows the stop commands and the replies to them; it does not know how a motion begins,
or why it must end. The caller passes the time.
"""

import math
from abc import ABC, abstractmethod
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.required_motion import STANDING
from omnibot_driver.core.mart.states import HALTS, LAST_HALTS, Motion, State
from omnibot_driver.core.mart.stop_reasons import StopReasons
from omnibot_driver.core.mart.stopping import ANSWERS, ROUNDS, SLOW_STOP, Stopping, is_slow_stop
from omnibot_driver.core.mart.words import Form
from omnibot_driver.core.packets import NO_PACKETS, Packets

UNCONTROLLED: Final = (Motion.REFERENCE, Motion.REVERSE, Motion.SPIN)
LOST_REPEAT_S: Final = 1.0
STRANGE_ROUNDS: Final = 6
"""Number of stop commands after which the driver reports an unexpected reply to a stop."""
STRANGE: Final = (
    "the server answers a stop by '{}', so the driver does not know whether a motion is in"
    " progress, and starts no motion. The driver expects 'fail no motion in progress' (SRM) and"
    " 'fail no motion' (SM): check that the server is a MART controller, and update it"
)
NAMES: Final = {
    Motion.REFERENCE: "RM",
    Motion.REVERSE: "B",
    Motion.SPIN: "R or L",
    Motion.STRAIGHT: "TF or TB",
    Motion.TURN: "MCR or MCL",
    Motion.UNKNOWN: "a motion of another program",
    Motion.NONE: "nothing",
}


class Stops(StopReasons, ABC):
    """The part of ``Pilot`` that stops motions."""

    def _halt(self, now: float, why: str = "", *, arrived: bool = False) -> None:
        """Begin to stop any motion in progress.

        ``why``: the fault, for a notice; empty without a fault. If the driver does not refuse this
        motion yet (``_blocked``), a fault also discards the user's command.

        ``arrived``: whether the server has certainly received the motion's start command.
        """
        if why:
            # a blocked motion is refused until its command ends
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
            if stopping.strange and stopping.rounds == STRANGE_ROUNDS and not self.greeted:
                self._once(STRANGE.format(stopping.strange))
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
        """Detect whether the server's stop port still waits for the end of an old motion.

        The next forward drive (RM) could then be impossible to stop; see
        docs/internals/mart_protocol.md.
        """
        # the stop command of a turn on the spot leaves the stop port free
        if not isinstance(reply, Ok) or self.motion is Motion.SPIN:
            return
        network = self.conversation
        asked = network.pending is not None or now < network.late_until_s(Form.NOTHING)
        if self.state is State.ASKING and asked:
            return  # maybe the reply to RST IMU or MSM
        # ``ok`` to a stop: the server was not restarted, so its stop port still waits, and could
        # mistake the start of RM for the end of the old motion (a number would answer an earlier
        # query)
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
        """Refuse the direction of ``motion`` until the user ends the command, or commands zero."""
        if self._blocked is not motion:
            self._blocked = motion
            where = "behind" if motion is Motion.REVERSE else "in front"
            self._notice(
                f"obstacle {where} ({why}); this direction is refused until the command is"
                " zero or expires",
                halt=False,
            )
