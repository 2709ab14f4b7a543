# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The stop of one motion: the commands to send until the server has acknowledged the stop.

If the network delivers a stop command before the start command, the motion begins after the stop.
So a single reply to a stop command does not always prove that the motion has ended. This module
knows commands, replies and times; it does not know why the robot is stopped.
"""

import math
from typing import Final

from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.states import HALTS, LAST_HALTS, Motion
from omnibot_driver.core.mart.words import (
    NO_MOTION,
    NO_START,
    NOT_IN_MOTION,
    SLOW_STOPS,
    Form,
    Word,
)

REPEAT_S: Final = 0.3
ROUNDS: Final = 3
"""Number of stop commands that the driver sends to the command port before it uses the stop
port."""
STOP_PORT_TIMES: Final = 3
ANSWERS: Final = {
    Motion.REFERENCE: (Form.NOTHING,),
    Motion.REVERSE: (Form.NOTHING,),
    Motion.SPIN: (Form.NOTHING, Form.INTEGER),
    Motion.UNKNOWN: (Form.NOTHING, Form.INTEGER),
}
"""For each motion: the forms of the reply ``ok`` by which the server reports the end of this
motion."""
ASK_NAME_S: Final = 0.9
"""Time in s from the first stop command for a controlled move until the driver asks for the
server's name.

By then, the move has usually ended.
"""

SLOW_STOP: Final = (
    "the wheels still turned 0.6 s after the server's stop. The motors are off now, and the driver"
    " continues. Possible causes: a heavy or fast robot, a slope, or a motor that the"
    " server left on"
)
NO_START_S: Final = 0.75
"""Longest duration, in s, of a controlled turn (MCR, MCL) in which no wheel has turned.

If no wheel turns, the server replies 0.6 s after the start; otherwise, after more than 0.75 s.
"""


def is_slow_stop(reply: Reply, motion: Motion, lasted_s: float) -> bool:
    """Return whether a motion failed only because the wheels did not stop in time.

    The motors are off after this failure. ``lasted_s``: time from the start of the motion to the
    reply, without the transit times.
    """
    if not isinstance(reply, Fail):
        return False
    # the reply NO_START to a turn that has certainly begun is wrong: the turn did not stop in time
    turned = motion is Motion.TURN and lasted_s > NO_START_S
    return reply.reason in SLOW_STOPS or (turned and reply.reason == NO_START)


class Stopping:
    """The stop of one motion.

    * ``began_s``: time of the first stop command.
    * ``owed``: number of earlier requests whose late replies would look like replies to a stop.
    * ``move``: the controlled move to stop, whose reply ends the stop; None for another motion.
    * ``planned``: whether the motion is stopped without a fault.
    * ``rounds``: number of times that the driver has sent the usual stop commands (``HALTS``).
    * ``strange``: an unexpected ``fail`` reply, which is shown to the user if the stop does not
      succeed; may be empty.
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
        planned: bool = False,
    ) -> None:
        self.motion, self.move, self.planned = motion, move, planned
        self.began_s = now
        self.result: Ok | Fail | None = None
        """The reply that shows how the stopped motion ended; None if there is no such reply."""
        self.began: bool | None = None
        """Whether the motion had begun before the stop command; None if the replies do not show it.
        """
        self.wake_at = now
        self.last_port = 0
        """Number of times that the stop port was used as the last resort."""
        self._delay_s = delay_s
        self._said_s = now
        self._sure_from_s = started_s + delay_s
        self._own_from_s = started_s + 2 * delay_s
        self._unsure_until_s = -math.inf
        self._owed = owed
        self._doubtful: list[tuple[Ok, bool]] = []
        self.rounds = 0
        self.strange = ""
        self._negative: set[str] = set()
        longest_s = max((word.takes_s for word in HALTS[motion]), default=0.0)
        self._patience_s = (3.0 if move is not None else longest_s) + 2 * delay_s
        self._silent_from_s = now + self._patience_s

    def due(self, now: float) -> tuple[Word, ...]:
        """Return the commands to send now."""
        if now < self.wake_at:
            return ()
        silent = self.rounds >= ROUNDS and now >= self._silent_from_s
        # SL or SS would run at the same time as an SM or SRM just sent, and could hang a port
        if silent and now <= self._said_s + self._delay_s:
            self.wake_at = self._said_s + self._delay_s + 0.01
            return ()
        self.wake_at = now + REPEAT_S
        if silent:
            self.last_port += 1
            return LAST_HALTS[self.motion]
        self.rounds += 1
        self._said_s = now
        if now < self._sure_from_s:  # the start may still come, after this stop
            self._unsure_until_s = now + 2 * self._delay_s
        return HALTS[self.motion]

    def asks_name(self, now: float) -> bool:
        """Return whether to send HELLO together with the stop of a controlled move.

        The server's answer proves that the move has ended, even if the move's own reply is lost.
        """
        return self.move is not None and now >= self.began_s + ASK_NAME_S

    @property
    def failed(self) -> bool:
        """Whether the server has left the stop commands on both ports unanswered."""
        return self.last_port >= STOP_PORT_TIMES

    def hear(self, reply: Reply, now: float) -> bool:
        """Evaluate a reply; return whether it proves that the motion has ended."""
        if self.move is not None:
            return self._hear_move(reply, self.move, now)
        if self.last_port:
            return False  # after the stop port, the server may be unable to begin or end anything
        if not self._is_answer(reply):
            if isinstance(reply, Fail):
                self.strange = f"fail {reply.reason}".strip()
            return False
        self._silent_from_s = now + self._patience_s
        none = isinstance(reply, Fail) and reply.reason in (NO_MOTION, NOT_IN_MOTION)
        if now >= self._own_from_s:  # from this time on, a reply answers the start or a stop
            if not none and not _is_number(reply):
                self.began = True
            elif none and self.rounds == 1:
                self.began = self.began or False
        if isinstance(reply, Ok) and self._owed > 0 and reply.form is Form.NOTHING:
            self.doubt(reply)
            return False
        if isinstance(reply, Ok | Fail) and not none:
            self.result = reply
        if now < self._unsure_until_s:
            return False
        if none and isinstance(reply, Fail):
            self._negative.add(reply.reason)
            self.strange = self.strange or f"fail {reply.reason}"
        return self.motion is not Motion.UNKNOWN or len(self._negative) == len(HALTS[self.motion])

    def doubt(self, reply: Ok, *, likely: bool = True) -> None:
        """Record a doubtful reply. It may answer the stop command, be late, or be a copy.

        ``likely``: whether the number in the reply is plausible for a reply to the stop command.
        """
        if reply.form in ANSWERS.get(self.motion, ()):
            self._doubtful.append((reply, likely))

    @property
    def doubtful_result(self) -> Ok | None:
        """The most probable reply to the stop command among the doubtful replies, or None.

        It is the last reply with a plausible number, or else the last reply. None if earlier
        requests may have caused all doubtful replies.
        """
        if len(self._doubtful) <= self._owed:
            return None
        likely = [reply for reply, likely in self._doubtful if likely]
        return likely[-1] if likely else self._doubtful[-1][0]

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
        if isinstance(reply, Ok) and now < self._own_from_s:
            return False  # maybe the reply to a copy of another request; HELLO decides
        self.result = reply
        self.began = isinstance(reply, Ok) or None
        return True


def _is_number(reply: Reply) -> bool:
    return isinstance(reply, Ok) and reply.form is not Form.NOTHING
