# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The exchange with the server: send one request, and find the reply to it by its form and time.

This module knows requests and replies; it does not know what the requests are for. The caller
passes the time.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

from omnibot_driver.core.mart.late_replies import LateReplies
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.replies import Fail, Ok, Other, Reply
from omnibot_driver.core.mart.words import (
    CONFLICT,
    ENC,
    KNOWN_FAILS,
    MCSTAT,
    NO_IMU,
    RMRA,
    UNSUPPORTED,
    Kind,
    Request,
    Word,
)
from omnibot_driver.core.packets import Packets

QUICKEST_S: Final = 0.1
"""Shortest wait in s for the reply to a query, or to a command that changes a motion.

The server's time to execute the command is added.
"""
SMOOTHING: Final = 0.2
LOSS, LOSS_S = 1.5, 0.02
"""Increase of ``trip_s``, the average duration of a query, after an unanswered query.

The new value is ``LOSS * trip_s + LOSS_S`` (s), at most ``delay_s``.
"""
SLOW_S, DISTURBED_S = 0.06, 5.0
"""Times in s for a disturbed network, in which a reply may answer an earlier query.

* ``SLOW_S``: an urgent query (PRESSING) that takes longer is a sign of a disturbance.
* ``DISTURBED_S``: duration of the disturbance after the last sign.
"""
PRESSING: Final = frozenset({ENC, RMRA, MCSTAT})
"""Urgent queries. The driver sends them even while the reply to an earlier query is late.

The driver then marks the answer to the urgent query as doubtful, because it may be the late reply.
"""

NUMBERS: Final = frozenset({Kind.QUERY, Kind.MOVE})
"""Kinds of commands whose replies are mostly only a number.

A copy of such a reply can be mistaken for the reply to a query.
"""

AT_ONCE: Final = frozenset({CONFLICT, NO_IMU, UNSUPPORTED})
"""Failure texts with which the server may answer a check of the IMU at once.

Any other early reply belongs to another request, because a check takes time.
"""


@dataclass(frozen=True, slots=True)
class Pending:
    """A request whose reply has not come yet.

    ``until_s``: time at which the driver stops waiting for the reply.
    """

    request: Request
    sent_s: float
    until_s: float

    @property
    def word(self) -> Word:
        """The command of the request."""
        return self.request.word


@dataclass(frozen=True, slots=True)
class Answer:
    """A reply, together with the request that it answers.

    ``took_s``: time from the request to the reply, in s.

    ``when``: time at which the value in the reply was measured.
    """

    request: Request
    reply: Ok | Fail
    took_s: float
    when: Moment

    @property
    def word(self) -> Word:
        """The command of the answered request."""
        return self.request.word


class Conversation(LateReplies):
    """The exchange of requests and replies with one server.

    * ``delay_s``: longest time that a datagram may be on its way, in s.
    * ``discarded``: number of replies that match no pending request.
    * ``trip_s``: average duration of a query, in s; each unanswered query increases it.
    * ``answered_trip_s``: average duration of answered queries, in s.
    * ``missed_s``: time in s of the last sign that a reply was lost.
    """

    def __init__(self, delay_s: float) -> None:
        super().__init__(delay_s)
        self.discarded = 0

    def connect(self) -> None:
        """Begin a new connection, and forget all earlier requests and replies."""
        super().connect()
        self.pending: Pending | None = None
        self.trip_s = self.answered_trip_s = 0.0
        self._disturbed_s = self._doubled_s = self.missed_s = -math.inf

    def may_ask(self, word: Word, now: float) -> bool:
        """Return whether ``word`` may be sent now.

        Every command waits while a request is pending. A query that is not urgent (PRESSING) also
        waits while a late reply could be mistaken for the reply to ``word``.
        """
        if self.pending is not None:
            return False
        return word.kind is not Kind.QUERY or word in PRESSING or not self._owed(word, now)

    def disturbed(self, now: float) -> bool:
        """Return whether the network has recently lost, duplicated or delayed a datagram."""
        return now < self._disturbed_s + DISTURBED_S

    def doubles(self, now: float) -> bool:
        """Return whether duplicate or late replies came recently."""
        return now < self._doubled_s + DISTURBED_S

    def ask(self, request: Request, now: float, patience_s: float | None = None) -> Packets:
        """Return the packets with the request, and begin to wait for its reply.

        ``patience_s``: longest wait in s; None for the usual wait after this command.
        """
        if patience_s is None:
            patience_s = self._patience_s(request.word)
        self.pending = Pending(request, now, now + patience_s)
        return ((request.word.channel, request.data),)

    def give_up(self, now: float) -> Word | None:
        """Stop waiting for the pending request; return its command, or None without a request.

        The reply is then expected as a late reply. Exception: the code that stops a controlled move
        waits for the move's reply itself.
        """
        if self.pending is None:
            return None
        word = self.pending.word
        if word.kind is not Kind.MOVE:
            self._owes_until(word, self.pending.sent_s)
        self.pending = None
        return word

    def hurry(self, until_s: float) -> None:
        """Limit the wait for the reply to the pending request: it ends at ``until_s`` or before."""
        if self.pending is not None:
            self.pending = replace(self.pending, until_s=min(self.pending.until_s, until_s))

    def overdue(self, now: float) -> Word | None:
        """Give up the pending request if its reply is overdue, and return the request's command.

        Return None if no reply is overdue.
        """
        if self.pending is None or now < self.pending.until_s:
            return None
        self.missed_s = now
        if self.pending.word.kind is Kind.QUERY:
            self.trip_s = min(self.delay_s, LOSS * self.trip_s + LOSS_S)
            self._disturbed_s = now
        return self.give_up(now)

    def hear(self, reply: Reply, now: float) -> Answer | None:
        """Return the reply with its request, or None if the reply is late, duplicate or foreign.

        The caller must not pass replies to HELLO, because HELLO may be sent while another request
        is pending.
        """
        pending = self.pending
        if isinstance(reply, Ok):
            self.heard(reply.form, now)
        if (
            pending is None
            or isinstance(reply, Other)
            or not _matches(reply, pending, now)
            or self._is_copy(pending.word, reply, now)
        ):
            self.discarded += 1
            if isinstance(reply, Ok):
                self.came(reply, now)
                self._disturbed_s = self._doubled_s = now
            return None
        self.pending = None
        took_s = now - pending.sent_s
        if pending.word.kind is Kind.QUERY:
            self.trip_s += SMOOTHING * (took_s - self.trip_s)
            self.answered_trip_s += SMOOTHING * (took_s - self.answered_trip_s)
        if pending.word in PRESSING and isinstance(reply, Ok) and took_s > SLOW_S:
            self._disturbed_s = now
        doubtful = self._owed(pending.word, now) or self._has_come(reply, now, but=pending.word)
        self._answers[pending.word] = reply, now + self.delay_s
        from_s = pending.sent_s
        if doubtful or self.disturbed(now):
            from_s = min(from_s, now - self.delay_s)  # it may answer an earlier query
        when = Moment(now - took_s / 2, from_s, now, doubtful)
        return Answer(pending.request, reply, took_s, when)

    def _is_copy(self, word: Word, reply: Ok | Fail, now: float) -> bool:
        """Return whether ``reply`` seems to be a copy of the reply to another command.

        True if the pending command, ``word``, is a query, ``reply`` differs from the last reply to
        this query, and ``reply`` equals a recent reply to another query or to a controlled move.
        """
        if word.kind is not Kind.QUERY:
            return False  # equal replies are usual: RMCS reports the same angle as RMRA
        before, _ = self._answers.get(word, (reply, now))
        return reply != before and self._has_come(reply, now, but=word, kinds=NUMBERS)

    def _patience_s(self, word: Word) -> float:
        """Return how long the driver waits for the reply to ``word``, in s.

        The wait is short for queries and changes of a motion, because the robot may be moving.
        """
        longest_s = 2 * self.delay_s
        if word.kind in (Kind.QUERY, Kind.CHANGE):
            longest_s = min(longest_s, max(QUICKEST_S, 3 * self.trip_s))
        return word.takes_s + longest_s


def _matches(reply: Ok | Fail, pending: Pending, now: float) -> bool:
    word = pending.word
    refused = word.kind is Kind.CHECK and isinstance(reply, Fail) and reply.reason in AT_ONCE
    if now < pending.sent_s + word.least_s and not refused:
        return False
    if isinstance(reply, Ok):
        return reply.form in word.forms
    return reply.reason in word.fails or (bool(reply.reason) and reply.reason not in KNOWN_FAILS)
