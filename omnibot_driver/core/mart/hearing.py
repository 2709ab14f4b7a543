# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the driver does when a reply comes, and when a reply does not come in time.

This module knows the driver's states and the replies; it does not know the next request.
"""

import math
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import QUICKEST_S, SLOW_S, Answer
from omnibot_driver.core.mart.ground import GREET_S
from omnibot_driver.core.mart.measuring import Measuring
from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.spot_turns import SETTING_REFUSED
from omnibot_driver.core.mart.states import ROLLING, Motion, State
from omnibot_driver.core.mart.switch_off import NO_MCS
from omnibot_driver.core.mart.words import Form, Kind, Word

BLIND_PART: Final = 0.15
"""Limit for a relative change of the motors' units that the server does not answer.

Above the limit, the driver stops the robot if the robot's turn is computed from the units.
"""


class Hearing(Measuring):
    """The part of ``Pilot`` that evaluates the server's replies."""

    def hear(self, data: bytes, now: float) -> None:
        """Evaluate a datagram from the command port."""
        self._next_s = -math.inf
        if self.jobs.collecting:
            self.heard_s = now
            self.jobs.piece(data, now)
            return
        for reply in self.decoder.feed(data, now):
            self._hear(reply, now)

    def _hear(self, reply: Reply, now: float) -> None:
        self._hears(now)
        if isinstance(reply, Ok) and reply.form is Form.NAME:
            self._named(reply, now)
            return
        last_port = self._stopping is not None and self._stopping.last_port
        if last_port or self.state in (State.LOST, State.ASKING):
            self._outlives(reply, now)
        if self.state is State.LOST:
            return
        if self._stopping is not None:
            late = isinstance(reply, Ok) and self._may_be_late(reply, now)
            if isinstance(reply, Ok):
                self.conversation.heard(reply.form, now)
            likely = not self._may_be_count(reply)
            if late or not likely:
                if isinstance(reply, Ok):
                    self._stopping.doubt(reply, likely=likely)
                return
            if self._stopping.hear(reply, now):
                self._stopped(now)
            return
        answer = self.conversation.hear(reply, now)
        if answer is not None:
            self._answered(answer, now)
        elif self.state is State.REVERSING and isinstance(reply, Ok) and reply.form is Form.NOTHING:
            self.loop.answered_again()
            self._predict_turn()
        elif self.state is State.CHECKING and isinstance(reply, Ok) and reply.form is Form.NOTHING:
            self.imu.came_early()

    def _may_be_late(self, reply: Ok, now: float) -> bool:
        """Return whether a reply that comes after a stop command may belong to an earlier request.

        Examples are the ``ok`` to the start, an encoder count, and copies of them.
        """
        late = now < self.conversation.late_until_s(reply.form)
        if reply.form is Form.INTEGER and late:
            self.conversation.came(reply, now)
        return late and reply.form in (Form.NOTHING, Form.INTEGER)

    def _named(self, reply: Ok, now: float) -> None:
        if reply.text != "BBB":
            self._once(
                f"another server answers HELLO with '{reply.text}' instead of 'BBB'; motion is"
                " refused; check `port`"
            )
            self.health.stranger = reply.text
            return
        self.health.stranger = ""
        if self._stopping is not None and self._stopping.asks_name(now):
            self._stopped(now)  # the port is free, so the move is over and its reply was lost
        if self.state is State.MOVING and now >= self._started_s + GREET_S:
            self._free_s = min(self._free_s, now + self._delay_s)  # the reply may be on its way
        if now >= self._started_s + 2 * self._delay_s and not self._greeted_before:
            if not self._port_is_free:
                self._port_free_s = now
            self._port_is_free = True  # the server would execute a copy of the move before HELLO
        self._hurry(now)
        if self.state is State.ASKING:
            self._named_s = now
        if self.state is State.LOST:
            self._ask_what_moves(now)
            self._named_s = self._name_from_s
        if self.state is State.ASKING:
            self._ask_s = max(self._ask_s, now + self._delay_s)  # earlier replies may still come

    def _hurry(self, now: float) -> None:
        """Shorten the wait for a missing reply, because the server has answered a later HELLO.

        The server answers in order, so the missing reply is lost or about to come.
        """
        greeted_s = self._greeted_of_name(now)
        network = self.conversation
        pending = network.pending
        if pending is None or greeted_s <= pending.sent_s:
            return
        if self.state is State.STARTING:
            if self._seems_present:
                self._present_s = now
            if greeted_s >= self._started_s + self._delay_s:  # HELLO has not overtaken the start
                network.hurry(now + min(self._delay_s, 3 * max(self._trip_s, now - greeted_s)))
        elif (self.state in ROLLING or self._may_run_on) and network.answered_trip_s < SLOW_S:
            network.hurry(now)

    @property
    def _trip_s(self) -> float:
        """Estimated time in s from a request to its reply at the moment.

        It is the average duration of the answered queries, or the delay of the last check of the
        IMU if that was longer.
        """
        return max(self.conversation.answered_trip_s, self.imu.transit_s)

    def _greeted_of_name(self, now: float) -> float:
        """Return the earliest time at which the HELLO that was just answered may have been sent.

        The answer may be to the oldest unanswered HELLO. Minus infinity if the time is unknown.
        """
        longest_s = min(2 * self._delay_s, QUICKEST_S + 3 * self._trip_s)
        recent = [each for each in self._greetings if each >= now - longest_s]
        self._greetings = recent[1:]
        return recent[0] if recent else -math.inf

    def _named_in_a_move(self, now: float) -> None:
        """Stop any motion, because the server has answered HELLO during a move.

        The move is over and its reply was lost, or the server was restarted.
        """
        self._appears(now)
        self._moved_by = None
        if self.motion is Motion.STRAIGHT:
            self.odometry.doubt.end_straight()
        self.motion = Motion.UNKNOWN
        self._halt(now)

    def _answered(self, answer: Answer, now: float) -> None:
        word, reply = answer.word, answer.reply
        if self.state is State.ASKING:
            self._asked(answer, now)
        elif word.kind is Kind.QUERY:
            self._polls.answered(word)
            self._measured(answer, now)
        elif word.kind is Kind.CHECK:
            self._checked(answer, now)
        elif word.kind is Kind.START:
            self._started(answer, now)
        elif word.kind is Kind.CHANGE:
            if isinstance(reply, Fail):
                self._halt(now, self._obstacle(reply, self.motion))
                return
            self._obeyed_s = now
            if reply.form is Form.DECIMAL:
                self._turned(reply.number, answer.when, now)
        elif word.kind is Kind.MOVE:
            self._moved(reply, now, sure=not answer.when.doubtful)
        elif word is words.SSP:
            if not self._turns.answered(reply):
                # a copy of this reply may look like the reply to the check
                self.imu.again_s = now + self._delay_s
                self._once(SETTING_REFUSED)
        elif word in (words.MCS, words.MSM):
            self._switch_off.answered(word, reply)
            self._rescue &= not self._switch_off.underway
            if word is words.MCS and self._runs_on and self._switch_off.underway:
                self._rolled = True  # the robot coasts after MCS, not after the stop before it
        else:
            self.jobs.answered(answer, now)
            self.state = State.SERVING if self.jobs.collecting else State.STILL

    def _missed(self, word: Word, now: float) -> None:
        if self.state is State.ASKING:
            self._unanswered(word)
        elif word.kind is Kind.START:
            self._halt(now, f"the controller did not answer {word.text}")
        elif word.kind is Kind.MOVE:
            if self._move is not None and self.motion is Motion.STRAIGHT:
                self._move.cut()
            self._halt(now)  # the reply is lost or late; the rest of the goal is planned again
        elif word.kind is Kind.CHECK:
            self.state = State.STILL
            self.imu.missed(now)
            if why := self.imu.trouble:
                self._once(why)
        elif word in (words.MCS, words.MSM):
            if self._switch_off.missed(word, disturbed=self.conversation.disturbed(now)):
                self._once(NO_MCS)
        elif word.kind is Kind.SERVICE:
            self.state = State.STILL
            self.jobs.missed(word, now)
        elif word.kind is Kind.CHANGE and self._probes:
            return  # nothing was to be changed
        elif word.kind is Kind.CHANGE:
            self.loop.missed()
            if self.odometry.left_over_right is not None and self.loop.part > BLIND_PART:
                self._halt(now)  # the turn would be unknown; the motion is started again
        else:
            self._polls.missed(word)
