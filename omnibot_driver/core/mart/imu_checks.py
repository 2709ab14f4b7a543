# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The check of the IMU that precedes a motion, and what its reply changes.

This module knows when a check may be sent; it does not know which motions need one. The caller
passes the time.
"""

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Answer
from omnibot_driver.core.mart.failed_starts import AGAIN_S, FailedStarts
from omnibot_driver.core.mart.ground import GAP_LONGEST_S
from omnibot_driver.core.mart.replies import Fail
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.packets import NO_PACKETS, Packets


class ImuChecks(FailedStarts):
    """The part of ``Pilot`` that checks the IMU."""

    def _check(self, now: float) -> Packets:
        """Return the request that checks the IMU; no packets while the check must wait.

        Reasons to wait:

        * The check is not due.
        * A late reply could be mistaken for the reply to the check.
        * After a short silence, a heading must first show whether the server was restarted.
        """
        word = self.imu.word
        if now < max(self.imu.again_s, self.conversation.certain_from_s(word)):
            return NO_PACKETS
        waits = self.odometry.heading.told_s < self._gap_s and now < self._gap_s + GAP_LONGEST_S
        if waits or self._is_quiet(now):
            return NO_PACKETS
        self._require(word)
        self.state = State.CHECKING
        if word is words.CHECK:
            self.odometry.wheel.may_begin_anew = True
        return self._ask(self.imu.request, now)

    def _checked(self, answer: Answer, now: float) -> None:
        self.state = State.STILL
        reply, was_dead = answer.reply, self.imu.dead
        if self.imu.answered(answer.word, reply, answer.took_s, now):
            if self.imu.dead and not was_dead:
                self.jobs.cancel(self.health.refusal)
                self._notice(self.health.refusal, halt=True)
            if self.imu.word is not answer.word:
                self.imu.again_s = now + self._delay_s  # a copy may look like the next reply
            return
        self._again_s = self.imu.again_s = now + AGAIN_S
        reason = reply.reason if isinstance(reply, Fail) else ""
        why = f"the check of the IMU failed: {reason or 'the server gives no reason'}"
        if reason == words.CONFLICT:
            why += "; look for another program that commands the robot"
            self.jobs.cancel(why)
            self._switch_off.refused()
            self.motion = Motion.UNKNOWN
            self._halt(now, why)
        else:
            self._notice(why, halt=True)
