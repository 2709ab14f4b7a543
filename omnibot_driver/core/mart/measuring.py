# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The evaluation of replies to queries: encoder counts, headings, and motion without a command.

This module knows replies and their use; it does not know when a query is sent. The caller passes
the time.
"""

import math
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Answer
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.relative_heading import MOST_RAD, OLD_RAD
from omnibot_driver.core.mart.replies import Fail, signed
from omnibot_driver.core.mart.starts import Starts
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.mart.wheel_count import STRAY_COUNTS

STRAY_AGAIN_S: Final = 3.0
ROLLS_S, ROLLS_AFTER_MOVE_S, ROLLS_LONG_S = 0.3, 0.6, 1.2
"""Times in s for which a robot may coast after the end of a motion.

* ``ROLLS_S``: after a stop.
* ``ROLLS_AFTER_MOVE_S``: after a controlled move. A failed move ends while the robot coasts.
* ``ROLLS_LONG_S``: after a reply which says that the wheels did not stop in time.
"""


class Measuring(Starts):
    """The part of the class ``Pilot`` that receives measurements."""

    def _measured(self, answer: Answer, now: float) -> None:
        word, reply = answer.word, answer.reply
        if isinstance(reply, Fail):
            if word is words.ENC:
                self.health.encoder_failed(reply.reason)
            return
        if word is words.ENC:
            self._counted(signed(int(reply.number)), answer.when, now)
        elif word is words.RMRA:
            if answer.when.is_uncertain and self.health.is_voltage(reply.number):
                return
            before_rad = self.odometry.heading.angle_rad
            changed = self._turned(reply.number, answer.when, now)
            if self._shows_restart(before_rad):
                if before_rad is not None:
                    self.health.restarted()
                    self._appears(now)
                self.jobs.forget_log()
            elif reply.number and self._started_s < self.appeared_s <= answer.when.from_s:
                self.jobs.log_may_be_lost = False  # a restarted server reports zero until RM
            if self.state is State.STILL and not answer.when.doubtful:
                self.health.rests(math.radians(reply.number))
            certain = answer.when.from_s >= self._begun_s and not answer.when.doubtful
            if changed and certain and self.state in (State.REVERSING, State.TURNING):
                self.health.heading_changed(self.motion)
        else:
            if answer.when.doubtful and word is not words.MCSTAT:
                return
            uncertain = answer.when.is_uncertain
            self.readings += self.health.measured(word, reply, now, uncertain=uncertain)
            self.loop.volts = self.health.volts_or(self._settings.nominal_volts)

    def _shows_restart(self, before_rad: float | None) -> bool:
        """Return whether the current heading is exactly zero because the server was restarted.

        ``before_rad``: the previous heading, or None. If it was near zero, the heading may be zero
        without a restart.
        """
        if self.state is not State.STILL or not self.odometry.heading.is_zero:
            return False
        if before_rad is None:
            return self._started_s < self.appeared_s
        return abs(before_rad) > OLD_RAD

    def _turned(self, degrees: float, when: Moment, now: float) -> bool:
        """Process a reported heading; return whether it is plausible and has changed."""
        changed = self.odometry.turned(degrees, when)
        if self.state is State.DRIVING and not abs(math.radians(degrees)) < MOST_RAD:
            self._halt(
                now,
                "the controller's clock was set, which makes the server's headings wrong; the"
                " driver begins the drive again",
            )
        return changed

    def _counted(self, count: int, when: Moment, now: float) -> None:
        spun = self.state is State.STILL and self.odometry.motion is Motion.SPIN
        if spun and when.doubtful and now < self._rested_s + self._delay_s:
            return  # the number may be the angle in the reply to the stop
        wheel = self.odometry.wheel
        before = None if wheel.may_begin_anew else wheel.last
        reading = self.odometry.counted(count, when)
        if reading is None:
            return
        self.health.encoder_answers()
        self.readings.append(reading)
        _speed, rate = self.odometry.speeds.means
        if self.state is State.STILL:
            rested = when.from_s >= self._rested_s and self.odometry.wheel.certain
            if rested and self.odometry.motion is not Motion.NONE:
                self._end_move(now)
                before = None  # this change of the count belongs to the ended motion
            self._watch_stray(before, count, now)
        elif self.state is State.TURNING:
            self._turns.seen_radps = rate
        else:
            self._fresh = True
            self._learn(reading, now)

    def _watch_stray(self, before: int | None, count: int, now: float) -> None:
        """Stop the robot if its encoder counts change although it should be at rest.

        Possible causes: a late duplicate of a start, another client, or a push.
        """
        self._counted_at_rest += 1
        rolls_s = ROLLS_AFTER_MOVE_S if self._moved_last else ROLLS_S
        if self._rolled:
            rolls_s = ROLLS_LONG_S
        ended_s = max(self._rested_s, self._copies_stopped_s)
        if self._counted_at_rest < 2 or now - ended_s < rolls_s or before is None:
            return
        if abs(count - before) <= STRAY_COUNTS:
            self._stood_s = now
            return
        if now - self._stray_s < STRAY_AGAIN_S:
            return
        # in a disturbed network, the cause may be a copy or an unanswered start
        if not self.conversation.disturbed(now):
            self.health.strays(now)
        # the robot has not been at rest since the last start, or since a restart of the server
        unknown = self._stood_s < max(self.appeared_s, self._started_s)
        if unknown:
            self.odometry.lose_turn()
        swept = self._negative_sweep and self._swept_s > max(self._started_s, self._stood_s)
        if unknown and swept:
            self._stray_s = now
            self._rescue, self._negative_sweep = True, False  # if this fails: sweep again
            self._switch_off.doubt()
            self._notice(
                "robot moves, but the server knows of no motion; the driver switches the motors"
                " off with MCS. If the server does not support MCS, the driver commands a turn of"
                " 1 degree, which stops the robot",
                halt=True,
            )
            return
        self._notice(
            "robot moves without a command (a late copy of a command, another client, or a push);"
            " the driver stops the robot",
            halt=True,
        )
        self._runs_on = unknown
        self.motion = Motion.UNKNOWN
        self._halt(now)
