# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The check that the IMU works (RST IMU, or MCR SLOW 0), and the results of the last checks.

After a failed RST IMU, the server does not use the IMU until RST IMU succeeds. This module knows
replies and times; it does not know which motion is started. The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.words import (
    CHECK,
    IMU_LOST,
    NO_IMU,
    RESET,
    UNSUPPORTED,
    Request,
    Word,
)

PROVED_S: Final = 0.2
"""A motion starts only if the last successful check of the IMU is at most this old, in s."""
PROBE_S: Final = {RESET: 0.1, CHECK: 0.5}
"""Usual duration of each check of the IMU, in s. Half of any excess is regarded as the delay of the
reply, and so as the age of the result."""
EARLY: Final = 4
"""Number of failed checks of the IMU in a row after which the driver tells the user that the server
answers too fast. Each of these checks gets only a reply that comes too early."""
FAILS: Final = {RESET: 3, CHECK: 1}
"""After this number of failed checks in a row, the IMU is regarded as dead."""
REPEAT_S, DEAD_REPEAT_S = 0.1, 1.0


class ImuProof:
    """The results of the last checks of the IMU.

    ``word``: the command for the check. ``dead``: whether the last checks found no working IMU.
    ``transit_s``: how much longer than usual the last successful check took, in s.
    """

    def __init__(self) -> None:
        self.connect()

    def connect(self) -> None:
        """Begin a new connection, and forget the results of earlier checks."""
        self.word: Word = RESET
        self.dead = False
        self.transit_s = 0.0
        self.again_s = self._proved_s = -math.inf
        self._fails = self._early = 0
        self._came_early = False

    def fresh(self, now: float) -> bool:
        """Return whether the last successful check is recent enough for a motion to start."""
        return now <= self._proved_s + PROVED_S

    def used(self) -> None:
        """Record that a motion starts, so that the next motion needs a new check."""
        self._proved_s = -math.inf

    def lost(self) -> None:
        """Record that the server has reported a dead IMU during a motion."""
        self.dead = True

    @property
    def request(self) -> Request:
        """The request that checks the IMU."""
        return RESET.request() if self.word is RESET else CHECK.request(0)

    def came_early(self) -> None:
        """Record an ``ok`` that came before the server can have done the check in progress."""
        self._came_early = True

    def missed(self, now: float) -> None:
        """Record that a check was not answered; the next check is due after REPEAT_S."""
        self.again_s = now + REPEAT_S
        self._early = self._early + 1 if self._came_early else 0
        self._came_early = False

    @property
    def trouble(self) -> str:
        """A text for the user if the server answers each check too early; otherwise empty."""
        if self._early < EARLY:
            return ""
        return (
            "the driver starts no motion, because the IMU is not checked: the server answers"
            f" {self.request.data.decode()} in less than {self.word.least_s:g} s, but the check"
            " takes longer; update the server"
        )

    def answered(self, word: Word, reply: Ok | Fail, took_s: float, now: float) -> bool:
        """Evaluate the reply to a check; return False for a reply that is not evaluated here.

        This method evaluates successes, a dead IMU, and a server that does not know RST IMU.
        ``took_s``: time in s from check to reply.
        """
        if isinstance(reply, Ok):
            self.dead, self._fails = False, 0
            self.transit_s = max(0.0, took_s - PROBE_S[word])
            self._proved_s = now - self.transit_s / 2
            self.again_s = now
        elif reply.reason == UNSUPPORTED and word is RESET:
            self.word = CHECK
        elif reply.reason in (NO_IMU, IMU_LOST):
            self._fails += 1
            self.dead = self.dead or self._fails >= FAILS[word]
            self.again_s = now + (DEAD_REPEAT_S if self.dead else REPEAT_S)
        else:
            return False
        self._early, self._came_early = 0, False
        return True

    def retries(self, now: float) -> bool:
        """Return whether the driver must now repeat the check of a dead IMU.

        Only the check RST IMU is repeated, because it does not move the robot.
        """
        return self.dead and self.word is RESET and now >= self.again_s
