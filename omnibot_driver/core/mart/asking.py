# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Queries that show which motion is in progress after the driver has used the stop port.

The stop port is the server's second UDP port. After its use, SM or SRM on the first port may hang
the server (docs/internals/mart_protocol.md). This module knows commands and replies; it does not
know why the stop port was used. The caller passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.conversation import Answer
from omnibot_driver.core.mart.replies import Fail, signed
from omnibot_driver.core.mart.states import LAST_HALTS, Motion, State
from omnibot_driver.core.mart.stopping import REPEAT_S
from omnibot_driver.core.mart.stops import Stops
from omnibot_driver.core.mart.wheel_count import STRAY_COUNTS
from omnibot_driver.core.mart.words import Word
from omnibot_driver.core.packets import Packets

STOP_AGAIN_S: Final = 3.0
"""Interval in s at which the driver repeats the stop commands SL and SS to a silent server.

SL and SS end a controlled move, during which the server is silent.
"""
APART_S: Final = 0.4
"""Least time in s between two encoder counts that are compared to see whether the robot moves."""


class Asking(Stops):
    """The part of ``Pilot`` that finds out which motion is in progress."""

    def _ask_what_moves(self, now: float) -> None:
        self._stopping = None
        self.conversation.give_up(now)
        self.state, self.motion = State.ASKING, Motion.UNKNOWN
        self.greeted = self._conflict = self._released = False
        self._turns.forget_setting()
        self._asked_count = None
        self._name_from_s = now + 2 * self._delay_s
        self._named_s = -math.inf
        self._stop_again_s = now + STOP_AGAIN_S
        self._ask_s = now

    def _stop_at_once(self, now: float) -> None:
        """In the states LOST and ASKING, make the driver send the next stop command at once."""
        if self.state is State.LOST:
            self._said_lost_s = -math.inf
        elif self.state is State.ASKING:
            self.conversation.give_up(now)
            self._named_s = self._stop_again_s = self._ask_s = -math.inf

    def _keep_asking(self, now: float) -> Packets:
        if self.conversation.pending is not None or now < self._ask_s:
            return ()
        self._ask_s = now + REPEAT_S
        if self._named_s >= self._name_from_s:
            word = words.RESET
            if self._conflict:
                word = words.ENC if self._released else words.MSM
            return self._ask(word.request(), now)
        if now < self._stop_again_s:
            return self._greet(now)
        self._stop_again_s, self._name_from_s = now + STOP_AGAIN_S, now + 2 * self._delay_s
        self._conflict, self._asked_count = False, None  # SL, SS may have ended a motion
        return self._send(LAST_HALTS[Motion.UNKNOWN], now) + self._greet(now)

    def _asked(self, answer: Answer, now: float) -> None:
        reply = answer.reply
        if answer.word is words.RESET:
            self._conflict = isinstance(reply, Fail) and reply.reason == words.CONFLICT
            if not self._conflict:
                self._sweep(now)
        elif answer.word is words.MSM:
            self._released, self._conflict = True, False
            self._ask_s = self.conversation.certain_from_s(words.RESET)
        elif not isinstance(reply, Fail):
            self._compare(signed(int(reply.number)), answer.when.from_s, now)

    def _compare(self, count: int, from_s: float, now: float) -> None:
        before, self._ask_s = self._asked_count, now + APART_S + self._delay_s
        if before is None or from_s < before[1]:
            self._asked_count = before or (count, now)
        elif abs(count - before[0]) > STRAY_COUNTS:
            self._sweep(now)
        else:
            # the left wheel, which has no encoder, may turn; the stops that the driver sends to a
            # lost server end this motion
            self._lose("the right wheel is at rest, but the server still reports a motion")

    def _sweep(self, now: float) -> None:
        """Begin to stop a motion of unknown kind with the commands SRM and SM.

        The queries have shown that these commands cannot hang the server now.
        """
        if self._lost_told:
            self._lost_told = False
            self._notice("the server answers again; the driver first stops any motion", halt=True)
        self.state, self.motion = State.UNKNOWN, Motion.UNKNOWN
        self._halt(now)

    def _unanswered(self, word: Word) -> None:
        """Record that the server may be gone, because it did not answer the query ``word``.

        The driver sends HELLO until the server answers with its name.
        """
        self._named_s = -math.inf
