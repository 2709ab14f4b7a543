# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Stopping one motion: what is said until the server has answered it. The stop never waits.

The right word goes out at once, over whatever else was asked, and again until it is answered. A
start may still be on its way, and be overtaken. So a reply counts only where it must answer a stop
that was sent when no copy of the start could come any more, and a bare ``ok`` only where none is
owed to the start; a repeated stop brings a plainer one. The stop port comes
last, alone: right behind SM or SRM it would race with them, and hang a port. Knows words, replies
and times; not why it is stopped.
"""

import math
from typing import Final

from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.states import HALTS, LAST_HALTS, Motion
from omnibot_driver.core.mart.words import NO_MOTION, NOT_IN_MOTION, Form, Word

REPEAT_S: Final = 0.3
ROUNDS: Final = 3
"""So often it is said before the stop port is."""
STOP_PORT_TIMES: Final = 3
ANSWERS: Final = {
    Motion.REFERENCE: (Form.NOTHING,),
    Motion.REVERSE: (Form.NOTHING,),
    Motion.SPIN: (Form.NOTHING, Form.INTEGER),
    Motion.UNKNOWN: (Form.NOTHING, Form.INTEGER),
}
"""What follows ``ok`` when the server has stopped it."""
ASK_NAME_S: Final = 0.9
"""After the first stop of a controlled move, which ends within this time."""


class Stopping:
    """``started_s``: when the start was sent; ``owed``: replies to other requests that look alike;
    ``move``: the controlled move whose own reply ends it.
    """

    def __init__(
        self,
        motion: Motion,
        now: float,
        *,
        delay_s: float,
        started_s: float,
        owed: int = 0,
        move: Word | None = None,
    ) -> None:
        self.motion, self.move = motion, move
        self.began_s = now
        self.result: Ok | Fail | None = None
        """The reply of the motion itself, where there was one."""
        self.began: bool | None = None
        """Whether the motion had begun; None where the replies do not tell."""
        self.wake_at = now
        self.last_port = 0
        """How often the stop port was used as the last resort."""
        self._delay_s = delay_s
        self._said_s = now
        self._sure_from_s = started_s + delay_s
        self._own_from_s = started_s + 2 * delay_s
        self._unsure_until_s = -math.inf
        self._owed = owed > 0
        self._rounds = 0
        self._negative: set[str] = set()
        longest_s = max((word.takes_s for word in HALTS[motion]), default=0.0)
        self._patience_s = (3.0 if move is not None else longest_s) + 2 * delay_s
        self._silent_from_s = now + self._patience_s

    def due(self, now: float) -> tuple[Word, ...]:
        """What to say now."""
        if now < self.wake_at:
            return ()
        silent = self._rounds >= ROUNDS and now >= self._silent_from_s
        if silent and now <= self._said_s + self._delay_s:
            self.wake_at = self._said_s + self._delay_s + 0.01
            return ()
        self.wake_at = now + REPEAT_S
        if silent:
            self.last_port += 1
            return LAST_HALTS[self.motion]
        self._rounds += 1
        self._said_s = now
        if now < self._sure_from_s:
            self._unsure_until_s = now + 2 * self._delay_s
        return HALTS[self.motion]

    def asks_name(self, now: float) -> bool:
        """Whether the server is asked for its name too: the reply to a move may have been lost,
        and the one that names it has finished the move.
        """
        return self.move is not None and now >= self.began_s + ASK_NAME_S

    @property
    def failed(self) -> bool:
        """Neither port has brought an answer."""
        return self.last_port >= STOP_PORT_TIMES

    def hear(self, reply: Reply, now: float) -> bool:
        """Whether it is over by this reply."""
        if self.move is not None:
            return self._hear_move(reply, self.move, now)
        if self.last_port:
            return False  # the stop port may have left the server unable to begin or end anything
        if not self._is_answer(reply):
            return False
        self._silent_from_s = now + self._patience_s
        none = isinstance(reply, Fail) and reply.reason in (NO_MOTION, NOT_IN_MOTION)
        if now >= self._own_from_s:  # it answers the start or a stop: all others have come
            if not none and not _is_number(reply):
                self.began = True
            elif none and self._rounds == 1:
                self.began = self.began or False
        if isinstance(reply, Ok) and self._owed and reply.form is Form.NOTHING:
            return False
        if isinstance(reply, Ok | Fail) and not none:
            self.result = reply
        if now < self._unsure_until_s:
            return False
        if none and isinstance(reply, Fail):
            self._negative.add(reply.reason)
        return self.motion is not Motion.UNKNOWN or len(self._negative) == len(HALTS[self.motion])

    def _is_answer(self, reply: Reply) -> bool:
        words = HALTS[self.motion]
        if isinstance(reply, Ok):
            return reply.form in ANSWERS.get(self.motion, ())
        return isinstance(reply, Fail) and any(reply.reason in word.fails for word in words)

    def _hear_move(self, reply: Reply, move: Word, now: float) -> bool:
        if isinstance(reply, Ok) and reply.form not in move.forms:
            return False
        if not isinstance(reply, Ok | Fail):
            return False
        self.result = reply
        return True


def _is_number(reply: Reply) -> bool:
    return isinstance(reply, Ok) and reply.form is not Form.NOTHING
