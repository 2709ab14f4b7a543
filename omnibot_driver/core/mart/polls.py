# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The times at which queries are due, in each state of the robot's motion.

A sonar query takes 55 ms, so it is sent only at rest. This module knows queries and states; it does
not know the replies.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.mart.states import State
from omnibot_driver.core.mart.words import DOCKED, ENC, MCSTAT, RMRA, SFC, SRC, VOLTS, Word

MOTION_S: Final = 0.06
STILL: Final[Mapping[Word, float]] = {
    RMRA: 0.1,
    ENC: 0.1,
    MCSTAT: 0.5,
    VOLTS: 1.0,
    DOCKED: 1.0,
    SFC: 0.5,
    SRC: 0.5,
}
DRIVING: Final[Mapping[Word, float]] = {RMRA: MOTION_S, ENC: MOTION_S, MCSTAT: 0.5, VOLTS: 2.0}
TURNING: Final[Mapping[Word, float]] = {ENC: MOTION_S, RMRA: 0.15, MCSTAT: 0.5}
"""Periods in s of the queries in a turn on the spot. The voltage query VOLTS is left out: it would
crash a server that has just restarted, and the replies in a turn may not show a restart."""
PERIODS: Final[Mapping[State, Mapping[Word, float]]] = {
    State.STILL: STILL,
    State.DRIVING: DRIVING,
    State.REVERSING: DRIVING,
    State.TURNING: TURNING,
}
"""Period in s of each query, by state. The most urgent query is the first.

In all other states, the command port is busy, so no queries are sent.
"""
SONARS, SONARS_APART_S = (SFC, SRC), 0.4
"""The two sonars, and the least time in s between their queries. After less time, a late copy of
one sonar's reply could be taken for the other's reply."""


class Polls:
    """The schedule of the queries: when each query was last sent, and when it is due again."""

    def __init__(self) -> None:
        self._asked_s: dict[Word, float] = {}
        self._repeated: set[Word] = set()

    def connect(self) -> None:
        """Make all queries due."""
        self._asked_s.clear()
        self._repeated.clear()

    def due(self, state: State, now: float) -> list[Word]:
        """Return the queries that are due, the most urgent one first.

        The order is that of due time plus period, so that frequent queries cannot delay a rare
        query for ever.
        """
        periods = PERIODS.get(state, {})
        late = [word for word in periods if now >= self._at(word, state)]
        return sorted(late, key=lambda word: self._at(word, state) + periods[word])

    def asked(self, word: Word, now: float) -> None:
        """Record that the query was sent.

        After the query of one sonar, the other sonar's query must wait.
        """
        self._asked_s[word] = now
        if word in SONARS:
            for each in SONARS:
                earliest_s = now + SONARS_APART_S - STILL[each]
                self._asked_s[each] = max(self._asked_s.get(each, earliest_s), earliest_s)

    def asked_s(self, word: Word) -> float:
        """Return when the query was last sent; minus infinity if never."""
        return self._asked_s.get(word, -math.inf)

    def answered(self, word: Word) -> None:
        """Record that the query was answered."""
        self._repeated.discard(word)

    def missed(self, word: Word) -> None:
        """Make a query due at once, because it had no answer.

        If the repetition has no answer either, the query is due at its usual time.
        """
        if word not in self._repeated:
            self._repeated.add(word)
            self.press(word)
        else:
            self._repeated.remove(word)

    def press(self, word: Word) -> None:
        """Make the query due at once."""
        self._asked_s.pop(word, None)

    def wake_at(self, state: State) -> float:
        """Return when the next query for encoder or heading is due; infinite if there is none.

        The other queries are less frequent. They are sent at these times too.
        """
        frequent = (word for word in (ENC, RMRA) if word in PERIODS.get(state, {}))
        return min((self._at(word, state) for word in frequent), default=math.inf)

    def _at(self, word: Word, state: State) -> float:
        return self.asked_s(word) + PERIODS[state][word]
