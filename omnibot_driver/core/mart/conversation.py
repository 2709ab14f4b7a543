# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One request at a time, and which reply belongs to it.

Replies carry no number, and datagrams are lost, doubled and late. So a reply is matched by its
form, its reason and the least time its command takes; what matches nothing is late, and discarded.
After a query that was not answered, none with the same form of reply is asked until its reply can
no longer come. Those that the robot is driven by cannot wait: their answers are marked as doubtful,
and their reader compares them with what is expected. Time is an argument.
"""

import math
from dataclasses import dataclass
from typing import Final

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
    Form,
    Kind,
    Request,
    Word,
)
from omnibot_driver.core.packets import Packets

QUICKEST_S: Final = 0.1
"""Less patience than this a query never needs."""
SMOOTHING: Final = 0.2
LOSS, LOSS_S = 1.5, 0.02
"""A query that was not answered may have been given up too soon: the next is waited for longer."""
SLOW_S, DISTURBED_S = 0.06, 5.0
"""A network on which an exchange takes longer, or a datagram is lost or comes twice, may do so
again: for this time no reply is certain to belong to the last question."""
PRESSING: Final = frozenset({ENC, RMRA, MCSTAT})
"""Asked at once, whatever reply may still come."""

AT_ONCE: Final = frozenset({CONFLICT, NO_IMU, UNSUPPORTED})
"""A check that is refused, or finds no IMU, may be answered before its least time."""


@dataclass(frozen=True, slots=True)
class Pending:
    """What was asked and not answered yet; given up at ``until_s``."""

    request: Request
    sent_s: float
    until_s: float

    @property
    def word(self) -> Word:
        """Its command."""
        return self.request.word


@dataclass(frozen=True, slots=True)
class Answer:
    """A reply with what it answers. ``took_s``: from the sending to the arrival; ``when``: what it
    tells was so.
    """

    request: Request
    reply: Ok | Fail
    took_s: float
    when: Moment

    @property
    def word(self) -> Word:
        """The command that is answered."""
        return self.request.word


class Conversation:
    """``delay_s``: how long a datagram may be on its way. ``discarded``: late replies so far;
    ``trip_s``: what a query takes, on average.
    """

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.discarded = 0
        self.connect()

    def connect(self) -> None:
        """Nothing was asked."""
        self.pending: Pending | None = None
        self._owed_until_s: dict[Form, float] = {}
        self._copies_until_s: dict[Form, float] = {}
        self._answers: dict[Word, tuple[Ok | Fail, float]] = {}
        self.trip_s = 0.0
        self._disturbed_s = self._doubled_s = -math.inf

    def may_ask(self, word: Word, now: float) -> bool:
        """Whether nothing is asked, and no late reply can be taken for its own."""
        if self.pending is not None:
            return False
        return word.kind is not Kind.QUERY or word in PRESSING or not self._owed(word, now)

    def heard(self, form: Form, now: float) -> None:
        """A reply of this form came; a copy of it may be late."""
        self._copies_until_s[form] = now + self.delay_s

    def certain_from_s(self, word: Word) -> float:
        """From when on the word's own reply cannot be mistaken for a copy of an earlier one."""
        until = [
            each.get(form, -math.inf)
            for form in word.forms
            for each in (self._copies_until_s, self._owed_until_s)
        ]
        return max(until) - word.least_s

    def disturbed(self, now: float) -> bool:
        """Whether the network has shown lately that it loses, doubles or delays datagrams."""
        return now < self._disturbed_s + DISTURBED_S

    def doubles(self, now: float) -> bool:
        """Whether replies have come lately that nothing was asked for: copies, or late ones."""
        return now < self._doubled_s + DISTURBED_S

    def owes(self, form: Form, now: float) -> None:
        """A reply of this form may still be on its way."""
        until_s = now + self.delay_s
        self._owed_until_s[form] = max(self._owed_until_s.get(form, until_s), until_s)

    def settle(self, now: float) -> None:
        """The server has answered the latest of all: earlier replies are on their way, or lost."""
        for form, until_s in self._owed_until_s.items():
            self._owed_until_s[form] = min(until_s, now + self.delay_s)

    def _owed(self, word: Word, now: float) -> bool:
        return any(self._owed_until_s.get(form, -math.inf) > now for form in word.forms)

    def ask(self, request: Request, now: float, takes_s: float | None = None) -> Packets:
        """Send a request that is to be answered; ``takes_s``: at most, if not as its word says."""
        patience_s = self._patience_s(request.word)
        if takes_s is not None:
            patience_s = takes_s + 2 * self.delay_s
        self.pending = Pending(request, now, now + patience_s)
        return ((request.word.channel, request.data),)

    def give_up(self, now: float) -> Word | None:
        """The pending request is not waited for any more: what it was."""
        if self.pending is None:
            return None
        word = self.pending.word
        self._owes_until(word, self.pending.sent_s)
        self.pending = None
        return word

    def overdue(self, now: float) -> Word | None:
        """The pending request, where its time is over; it is given up."""
        if self.pending is None or now < self.pending.until_s:
            return None
        if self.pending.word.kind is Kind.QUERY:
            self.trip_s = min(self.delay_s, LOSS * self.trip_s + LOSS_S)
            self._disturbed_s = now
        return self.give_up(now)

    def hear(self, reply: Reply, now: float) -> Answer | None:
        """What this answers; None for what is late, or doubled."""
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
                if not self._has_come(reply, now):
                    self._owed_until_s.pop(reply.form, None)
                if reply.form is not Form.NAME:
                    self._disturbed_s = self._doubled_s = now
            return None
        self.pending = None
        took_s = now - pending.sent_s
        if pending.word.kind is Kind.QUERY:
            self.trip_s += SMOOTHING * (took_s - self.trip_s)
        if pending.word in PRESSING and isinstance(reply, Ok) and took_s > SLOW_S:
            self._disturbed_s = now
        doubtful = self._owed(pending.word, now) or self._has_come(reply, now, but=pending.word)
        self._answers[pending.word] = reply, now + self.delay_s
        from_s = pending.sent_s
        if doubtful or self.disturbed(now):
            from_s = min(from_s, now - self.delay_s)  # an answer to a question before
        when = Moment(now - took_s / 2, from_s, now, doubtful)
        return Answer(pending.request, reply, took_s, when)

    def _is_copy(self, word: Word, reply: Ok | Fail, now: float) -> bool:
        """Whether another query was answered so just now, and this one was not before: the reply
        has come twice, and its own is still to come.
        """
        if word.kind is not Kind.QUERY:
            return False  # RMCS tells the angle that RMRA has just told
        before, _ = self._answers.get(word, (reply, now))
        return reply != before and self._has_come(reply, now, but=word, kind=Kind.QUERY)

    def _has_come(
        self, reply: Ok | Fail, now: float, *, but: Word | None = None, kind: Kind | None = None
    ) -> bool:
        """Whether a command was answered so just now."""
        return isinstance(reply, Ok) and any(
            each == reply and until_s > now and word is not but and kind in (None, word.kind)
            for word, (each, until_s) in self._answers.items()
        )

    def _owes_until(self, word: Word, sent_s: float) -> None:
        """The reply to this may still come."""
        until_s = sent_s + word.takes_s + 2 * self.delay_s
        for form in word.forms:
            self._owed_until_s[form] = max(self._owed_until_s.get(form, until_s), until_s)

    def _patience_s(self, word: Word) -> float:
        """Queries are short of patience: what drives is not to be blind for long."""
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
