# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is asked when, while nothing else is: each query at its own pace, by the state of motion.

Encoder and heading come first, and take turns; a sonar takes 55 ms, so it is asked only
while the robot stands. Knows queries and states; time is an argument.
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
TURNING: Final[Mapping[Word, float]] = {ENC: MOTION_S, RMRA: 0.15, MCSTAT: 0.5, VOLTS: 2.0}
PERIODS: Final[Mapping[State, Mapping[Word, float]]] = {
    State.STILL: STILL,
    State.DRIVING: DRIVING,
    State.REVERSING: DRIVING,
    State.TURNING: TURNING,
}
"""By state, the most pressing first. In all others the command port is busy."""
SONARS, SONARS_APART_S = (SFC, SRC), 0.4
"""Both report the same where nothing is near. A copy of one reply is not to be the other's."""


class Polls:
    """The times of the last queries."""

    def __init__(self) -> None:
        self._asked_s: dict[Word, float] = {}

    def connect(self) -> None:
        """Everything is due."""
        self._asked_s.clear()

    def due(self, state: State, now: float) -> list[Word]:
        """The queries whose time has come, first the one that is late by most of its periods: where
        an exchange takes longer than a period, each has its turn.
        """
        periods = PERIODS.get(state, {})
        late = [word for word in periods if now >= self._at(word, state)]
        return sorted(late, key=lambda word: self._at(word, state) + periods[word])

    def asked(self, word: Word, now: float) -> None:
        """Note that the query was sent."""
        self._asked_s[word] = now
        if word in SONARS:
            for each in SONARS:
                earliest_s = now + SONARS_APART_S - STILL[each]
                self._asked_s[each] = max(self._asked_s.get(each, earliest_s), earliest_s)

    def press(self, word: Word) -> None:
        """Make the query due at once."""
        self._asked_s.pop(word, None)

    def wake_at(self, state: State) -> float:
        """The time of the next query."""
        return min((self._at(word, state) for word in PERIODS.get(state, {})), default=math.inf)

    def _at(self, word: Word, state: State) -> float:
        return self._asked_s.get(word, -math.inf) + PERIODS[state][word]
