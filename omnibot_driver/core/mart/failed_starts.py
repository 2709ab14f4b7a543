# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the ``Pilot`` does after a start command that the server answers by a failure.

This module knows the failure texts and their usual causes; it does not start motions, and reads no
clock.
"""

from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.adjusting import Adjusting
from omnibot_driver.core.mart.replies import Fail
from omnibot_driver.core.mart.states import Motion

AGAIN_S: Final = 1.0
"""Time in s from a failed start until the driver tries again."""
NO_STARTS: Final = 3
"""After this number of starts of B (backward), R or L (turns) in a row that do not turn the
right-hand wheel, the driver gives up. Each start may turn the left wheel, and so move the robot."""
REFERENCE_FAILS: Final = 2
"""Number of failed starts of RM (forward drive) in a row after which the driver gives up.

One failed start is normal after a stop that took long.
"""


class FailedStarts(Adjusting):
    """The part of ``Pilot`` that evaluates failed starts."""

    def _start_failed(self, reply: Fail, now: float, *, arrived: bool) -> None:
        """Stop the robot after a failed start, because the robot may move in spite of the failure.

        ``arrived``: whether the server has certainly received this start command, and a late copy
        of the command is unlikely.
        """
        word = self._start
        assert word is not None
        self._refused = True
        self._again_s = now + AGAIN_S
        if reply.reason == words.CONFLICT:
            self._switch_off.refused()
            self.motion = Motion.UNKNOWN
            why = (
                "another motion is in progress: the network has delivered the command twice, or"
                " another program commands the robot"
            )
        elif word is words.RM and self._is_of_another(reply, now):
            if reply.reason in ("", words.NO_START):
                self.health.reference_failed(now)
            if not reply.reason and self.health.reference_fails == 1:
                self._again_s = now  # after a long stop, RM fails once, also on an intact server
            why = "the driver tries again"
            if self.health.reference_fails >= REFERENCE_FAILS:
                self._blocked, self.health.reference_fails = Motion.REFERENCE, 0
                why = (
                    "check whether the motors are stuck or without power; forward motion is refused"
                    " until the command is zero or expires"
                )
        elif reply.reason == words.NO_START:
            why = self._not_turned()
        else:
            why = self._obstacle(reply, self.motion)
        if word in (words.R, words.L) and reply.reason == words.UNSUPPORTED:
            self._turns.refused()
        failed = f"{word.text} failed ({reply.reason or 'no reason given'})"
        self._halt(now, f"{failed}: {why}", arrived=arrived)

    def _not_turned(self) -> str:
        """Count a start that has not turned the right-hand wheel.

        Return a text that tells the user what the driver does now.
        """
        self._no_starts += 1
        if self._no_starts < NO_STARTS:
            return "the right wheel has not turned, so the driver tries again"
        self._blocked, self._no_starts = self.motion, 0
        return (
            "the right wheel has not turned, so check whether it is stuck or without power; this"
            " motion is refused until the command is zero or expires"
        )

    def _is_of_another(self, reply: Fail, now: float) -> bool:
        """Return whether an earlier motion may be the cause of the failure of RM (forward drive).

        If RM reports an obstacle, the result is False if the front sonar confirms the obstacle, or
        if it is the second such report in a row.
        """
        if reply.reason not in words.OBSTACLES or self.health.obstacle(Motion.REFERENCE, now):
            self._obstacle_told = False
            return reply.reason not in words.OBSTACLES
        told, self._obstacle_told = self._obstacle_told, True
        return not told
