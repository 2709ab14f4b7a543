# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pairs gyro and acceleration lines, which carry neither time nor number, into samples of the IMU.

The board sends both lines of a sample in one cycle, always in the same order, every ``PERIOD_S``. A
pair is a first line and the second line that follows it, even if late, without another gyro or
acceleration line between them. If the second line of one sample and the first line of the next
sample are both lost, the two remaining lines look like a pair. Three observations reveal such a
false pair:

- between its two lines comes a line of a kind that never comes within a pair;
- its second line comes ``PAIR_WITHIN_S`` or more after the first. Such a pair waits for the next
  pose: the times of two poses tell how many samples lie between them;
- a pose follows in the same read, and its time shows that fewer lines came since the previous pose
  than the board has sent. So a pair is returned only at this pose, or at the end of its read.

One case remains undetected: the lines come late, but less than ``PAIR_WITHIN_S`` apart, and no pose
follows in the read that completes the pair. Until the order of the two lines is known, some samples
are left out.
"""

import itertools
import math
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.fejemis.messages import Acceleration, Attitude, Gyro

Kind = Literal["gyro", "acc"]

PERIOD_S: Final = 0.01
PAIR_WITHIN_S: Final = 0.005
"""Longest allowed delay in s between two lines that are accepted as a pair without further
evidence."""
KNOWN_S: Final = 0.025
SUREST_S: Final = 0.05
"""Limit of the evidence, in s, that shows which line of a sample comes first.

The evidence is the sum of the pauses before gyro lines, minus the sum of those before acceleration
lines: the pause before the first line of a sample is longer. From ``KNOWN_S`` on, the order is
known.
"""
MARKED_S: Final = PERIOD_S
"""Evidence in s that is added to the pause between a gyro and an acceleration line if another
periodic line comes in this pause. That line shows that a control cycle has ended in the pause."""
PATIENCE: Final = 60
"""Count of lines after which the order is decided even if the evidence is weak.

Neither order gains evidence if the board sends both lines half a period apart."""
MOST: Final = 10
"""Limit of a number that is kept for each kind of line: the count of lines that came outside of
pairs, minus the count of lines that came within pairs."""
UNPOSED: Final = 20
"""Largest count of gyro or acceleration lines for which a pair waits for the next pose; after more
lines, the pair is rejected."""


@dataclass(slots=True)
class Pair:
    """A gyro and an acceleration line, probably of one sample; ``at``: when the second line came.

    ``pose_s``: the board's time of the last pose before the pair. ``skipped``: count of incomplete
    samples before the pair. ``doubtful``: whether the pair must wait for a pose.
    """

    gyro: Gyro
    acceleration: Acceleration
    at: float
    pose_s: float
    skipped: int
    doubtful: bool


Oriented = tuple[Attitude, float]
"""An orientation, and the time in s at which it arrived."""


class ImuPairs:
    """Pairs the lines of the IMU; ``take`` returns pairs and orientations in order of arrival."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget all lines and their order, because the board's streams start again."""
        self.first: Kind | None = None
        """The keyword of a sample's first line; None while unknown."""
        self._evidence_s = 0.0
        """Evidence in s that gyro lines come first; if negative, that acceleration lines do."""
        self._seen = 0
        self._last: tuple[Kind, Gyro | Acceleration, float] | None = None
        self._waiting: tuple[Gyro | Acceleration, float] | None = None
        self._between: set[str] = set()
        """The kinds of lines that have come since the last gyro or acceleration line."""
        self._outside: dict[str, int] = {}
        """For each other kind of line: count of lines outside of pairs, minus count within
        pairs."""
        self._skipped = 0
        self._queue: deque[Pair | Oriented] = deque()
        self._pose_s = -math.inf
        self._counts: dict[Kind, int] = {"gyro": 0, "acc": 0}
        """Count of lines since the last pose, by kind."""

    def gyro(self, gyro: Gyro, now: float) -> None:
        """Take a gyro line."""
        self._line("gyro", gyro, now)

    def acceleration(self, acceleration: Acceleration, now: float) -> None:
        """Take an acceleration line."""
        self._line("acc", acceleration, now)

    def other(self, kind: str) -> None:
        """Take a line of a ``kind`` other than gyro and acceleration.

        The board sends such lines with every second sample.
        """
        self._between.add(kind)
        if self._waiting is not None and self._outside.get(kind, 0) >= 0:
            self._waiting = None
            self._skipped += 1

    def attitude(self, attitude: Attitude, now: float) -> None:
        """Take an orientation; ``take`` returns it after all pairs that came before it."""
        self.other("imupose")
        self._queue.append((attitude, now))

    def pose(self, time_s: float) -> None:
        """Take the board's time of a pose, and decide on the pairs since the previous pose."""
        self.other("pose")
        periods = (time_s - self._pose_s) / PERIOD_S
        if abs(periods) < 0.5:
            return  # the same line came twice
        counted = 0.0 < periods < math.inf
        lacking = counted and all(count < round(periods) for count in self._counts.values())
        for pair in [item for item in self._queue if isinstance(item, Pair)]:
            if lacking or not counted:
                self._reject(pair)
            pair.doubtful = False
        self._pose_s = time_s
        self._counts = {"gyro": 0, "acc": 0}

    def take(self) -> list[Pair | Oriented]:
        """Return the decided pairs and the orientations among them, in order of arrival.

        Called after a pose and at the end of a read.
        """
        taken: list[Pair | Oriented] = []
        while self._queue:
            item = self._queue[0]
            if isinstance(item, Pair) and item.doubtful:
                if max(self._counts.values()) <= UNPOSED:
                    break
                self._reject(item)
                continue
            taken.append(self._queue.popleft())
        return taken

    def _reject(self, pair: Pair) -> None:
        """Remove a pair whose two lines are probably of different samples."""
        at = next(at for at, item in enumerate(self._queue) if item is pair)
        del self._queue[at]
        lost = pair.skipped + 2
        for item in itertools.islice(self._queue, at, None):
            if isinstance(item, Pair):
                item.skipped += lost
                return
        self._skipped += lost

    def _line(self, kind: Kind, line: Gyro | Acceleration, now: float) -> None:
        last = self._last
        if last is not None and last[:2] == (kind, line):
            return  # the same line came twice
        self._last = kind, line, now
        between, self._between = self._between, set()
        self._counts[kind] += 1
        if last is not None and last[0] != kind:
            self._learn(kind, now - last[2], marked=bool(between))
        if self.first is None:
            return
        waiting, self._waiting = self._waiting, None
        if kind == self.first:
            self._skipped += waiting is not None
            self._waiting = line, now
            self._place(between, 1)
        elif waiting is None:
            self._skipped += 1
            self._place(between, -1)
        else:
            self._pair(waiting, line, now, between)

    def _pair(
        self,
        waiting: tuple[Gyro | Acceleration, float],
        line: Gyro | Acceleration,
        now: float,
        between: set[str],
    ) -> None:
        first, at = waiting
        late = now - at >= PAIR_WITHIN_S
        usual = all(self._outside.get(kind, 0) < 0 for kind in between)
        self._place(between, -1)
        if late and not usual:
            self._skipped += 2
            return
        gyro, acceleration = (first, line) if isinstance(first, Gyro) else (line, first)
        assert isinstance(gyro, Gyro)
        assert isinstance(acceleration, Acceleration)
        pair = Pair(gyro, acceleration, now, self._pose_s, self._skipped, doubtful=late)
        self._queue.append(pair)
        self._skipped = 0

    def _place(self, kinds: set[str], step: int) -> None:
        """Record that lines of these ``kinds`` came outside (``step`` 1) or within (-1) a pair."""
        for kind in kinds:
            self._outside[kind] = max(-MOST, min(MOST, self._outside.get(kind, 0) + step))

    def _learn(self, kind: Kind, pause_s: float, *, marked: bool) -> None:
        """Learn which line of a sample comes first: the line with the longer pauses before it."""
        evidence_s = min(max(pause_s, 0.0), PERIOD_S) + (MARKED_S if marked else 0.0)
        self._evidence_s += evidence_s if kind == "gyro" else -evidence_s
        self._evidence_s = max(-SUREST_S, min(SUREST_S, self._evidence_s))
        self._seen += 1
        undecided = self.first is None and self._seen >= PATIENCE
        if abs(self._evidence_s) < KNOWN_S and not undecided:
            return
        first: Kind = "gyro" if self._evidence_s >= 0.0 else "acc"
        if first != self.first:
            self.first, self._waiting = first, None
            self._outside.clear()
