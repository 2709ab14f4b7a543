# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""After the stop port was used for a motion that is not known: what may be said then.

SL ends RM and B in a way that SM and SRM hang the server for good. So neither is said before the
server has shown that no motion is in progress, or that the robot moves: it tells its name, and
refuses RST IMU while a motion is in progress. Knows words and replies. Time is an argument.
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
"""A controlled move keeps the server silent; SL or SS ends it once it arrives."""
APART_S: Final = 0.4
"""Two counts so far apart tell whether the robot moves."""


class Asking(Stops):
    """The part of the pilot that asks what is in progress."""

    def _ask_what_moves(self, now: float) -> None:
        """From now on."""
        self._stopping = None
        self.conversation.give_up(now)
        self.state, self.motion = State.ASKING, Motion.UNKNOWN
        self.greeted = self._conflict = False
        self._custom_units = None
        self._asked_count = None
        self._name_from_s = now + 2 * self._delay_s
        self._named_s = -math.inf
        self._stop_again_s = now + STOP_AGAIN_S
        self._ask_s = now

    def _keep_asking(self, now: float) -> Packets:
        if self.conversation.pending is not None or now < self._ask_s:
            return ()
        self._ask_s = now + REPEAT_S
        if self._named_s >= self._name_from_s:
            return self._ask((words.ENC if self._conflict else words.RESET).request(), now)
        if now < self._stop_again_s:
            return self._greet(now)
        self._stop_again_s, self._name_from_s = now + STOP_AGAIN_S, now + 2 * self._delay_s
        self._conflict, self._asked_count = False, None  # it may have ended what moved before
        return self._send(LAST_HALTS[Motion.UNKNOWN], now) + self._greet(now)

    def _asked(self, answer: Answer, now: float) -> None:
        """One of the two was answered."""
        reply = answer.reply
        if answer.word is words.RESET:
            self._conflict = isinstance(reply, Fail) and reply.reason == words.CONFLICT
            if not self._conflict:
                self._sweep(now)
        elif not isinstance(reply, Fail):
            self._compare(signed(int(reply.number)), answer.when.from_s, now)

    def _compare(self, count: int, from_s: float, now: float) -> None:
        before, self._ask_s = self._asked_count, now + APART_S + self._delay_s
        if before is None or from_s < before[1]:
            self._asked_count = before or (count, now)
        elif abs(count - before[0]) > STRAY_COUNTS:
            self._sweep(now)
        else:
            self._lose(now, "the stop port has ended a motion that the server still believes in")

    def _sweep(self, now: float) -> None:
        """SRM and SM do no harm now."""
        if self._lost_told:
            self._lost_told = False
            self._notice("the server answers again; it is stopped first", halt=True)
        self.state, self.motion = State.UNKNOWN, Motion.UNKNOWN
        self._halt(now)

    def _unanswered(self, word: Word) -> None:
        """The server may have gone again."""
        self._named_s = -math.inf
