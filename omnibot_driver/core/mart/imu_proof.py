# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether the IMU was proved alive just now, and by which command.

RST IMU proves it without a motion. Where the server has no such command, MCR SLOW 0 has to do. The
server gives an IMU up when RST IMU fails, so that is repeated before the driver believes it. Knows
replies and times; not what is started. Time is an argument.
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
"""So old a proof of the IMU may be when a motion starts."""
PROBE_S: Final = {RESET: 0.1, CHECK: 0.5}
"""A check takes at least about this time; half of what it took longer is the way of its reply."""
FAILS: Final = {RESET: 3, CHECK: 1}
"""After this many in a row the IMU is dead."""
REPEAT_S, DEAD_REPEAT_S = 0.1, 1.0


class ImuProof:
    """``word``: the command that proves it; ``dead``: the last checks found none; ``again_s``: not
    checked before.
    """

    def __init__(self) -> None:
        self.connect()

    def connect(self) -> None:
        """Begin a new connection: nothing is proved."""
        self.word: Word = RESET
        self.dead = False
        self.again_s = self._proved_s = -math.inf
        self._fails = 0

    def fresh(self, now: float) -> bool:
        """Whether a motion may start."""
        return now <= self._proved_s + PROVED_S

    def used(self) -> None:
        """A motion starts; the next one needs another proof."""
        self._proved_s = -math.inf

    def lost(self) -> None:
        """A motion found it dead."""
        self.dead = True

    @property
    def request(self) -> Request:
        """The request to send."""
        return RESET.request() if self.word is RESET else CHECK.request(0)

    def missed(self, now: float) -> None:
        """No reply came."""
        self.again_s = now + REPEAT_S

    def answered(self, word: Word, reply: Ok | Fail, took_s: float, now: float) -> bool:
        """Whether the reply is one that this knows."""
        if isinstance(reply, Ok):
            self.dead, self._fails = False, 0
            self._proved_s = now - max(0.0, took_s - PROBE_S[word]) / 2
            self.again_s = now
        elif reply.reason == UNSUPPORTED and word is RESET:
            self.word = CHECK
        elif reply.reason in (NO_IMU, IMU_LOST):
            self._fails += 1
            self.dead = self.dead or self._fails >= FAILS[word]
            self.again_s = now + (DEAD_REPEAT_S if self.dead else REPEAT_S)
        else:
            return False
        return True

    def retries(self, now: float) -> bool:
        """Whether a dead IMU is to be tried again, which moves nothing."""
        return self.dead and self.word is RESET and now >= self.again_s
