# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The replies that may still come late or twice, so that they may be mistaken for other replies.

This module knows the commands and the forms of their replies; it does not know which request waits
for its reply. The caller passes the time.
"""

import math

from omnibot_driver.core.mart.replies import Fail, Ok
from omnibot_driver.core.mart.words import Form, Kind, Word


class LateReplies:
    """The replies of one server that are missing, and those that have come.

    ``delay_s``: longest time that a datagram may be on its way, in s.
    """

    def __init__(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.connect()

    def connect(self) -> None:
        """Begin a new connection, and forget all earlier replies."""
        self._owed_until_s: dict[Form, float] = {}
        self._copies_until_s: dict[Form, float] = {}
        self._answers: dict[Word, tuple[Ok | Fail, float]] = {}

    def heard(self, form: Form, now: float) -> None:
        """Record that a reply came. Its duplicate may come within ``delay_s``.

        ``form``: the kind of text after ``ok`` in the reply.
        """
        self._copies_until_s[form] = now + self.delay_s

    def answered(self, word: Word, reply: Ok, now: float) -> None:
        """Record that ``reply`` is the answer to ``word``.

        The caller has found this answer without the method ``Conversation.hear``. The driver can
        now recognise a later copy of the reply.
        """
        self._answers[word] = reply, now + self.delay_s

    def came(self, reply: Ok, now: float) -> None:
        """Record a late ``reply`` to an earlier request.

        No other late reply of the same form is expected. Nothing changes if ``reply`` may be a
        copy: an equal reply has answered a request in the last ``delay_s``.
        """
        if not self._has_come(reply, now):
            self._owed_until_s.pop(reply.form, None)

    def certain_from_s(self, word: Word) -> float:
        """Return the time from which ``word`` may be sent without confusion.

        From this time on, no late reply can be mistaken for the reply to ``word``.
        """
        return max(map(self.late_until_s, word.forms)) - word.least_s

    def late_until_s(self, form: Form) -> float:
        """Return the time until which a late or duplicate reply with the form ``form`` may come."""
        owed_s = self._owed_until_s.get(form, -math.inf)
        return max(owed_s, self._copies_until_s.get(form, -math.inf))

    def owes(self, form: Form, now: float) -> None:
        """Record that a missing reply with the form ``form`` may still come, within ``delay_s``."""
        until_s = now + self.delay_s
        self._owed_until_s[form] = max(self._owed_until_s.get(form, until_s), until_s)

    def settle(self, now: float) -> None:
        """Record that the server has answered the last request.

        Missing replies to earlier requests come within ``delay_s`` from now, or are lost.
        """
        for form, until_s in self._owed_until_s.items():
            self._owed_until_s[form] = min(until_s, now + self.delay_s)

    def _owed(self, word: Word, now: float) -> bool:
        return any(self._owed_until_s.get(form, -math.inf) > now for form in word.forms)

    def _owes_until(self, word: Word, sent_s: float) -> None:
        """Record that the reply to a request may still come.

        ``word``: the command of the request. ``sent_s``: time at which the request was sent.
        """
        until_s = sent_s + word.takes_s + 2 * self.delay_s
        for form in word.forms:
            self._owed_until_s[form] = max(self._owed_until_s.get(form, until_s), until_s)

    def _has_come(
        self,
        reply: Ok | Fail,
        now: float,
        *,
        but: Word | None = None,
        kinds: frozenset[Kind] = frozenset(Kind),
    ) -> bool:
        """Return whether a reply identical to ``reply`` came within the last ``delay_s``.

        ``but``: a command; replies to this command are ignored. ``kinds``: the kinds of commands
        whose replies are compared.
        """
        return isinstance(reply, Ok) and any(
            each == reply and until_s > now and word is not but and word.kind in kinds
            for word, (each, until_s) in self._answers.items()
        )
