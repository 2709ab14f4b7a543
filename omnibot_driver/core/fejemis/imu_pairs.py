# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Combines gyro and acceleration lines into samples of the IMU.

After a loss of lines, a pair may be false: its two lines come from two samples.
"""

import itertools
import math
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.fejemis.messages import Acceleration, Attitude, Gyro

Kind = Literal["gyro", "acc"]

PERIOD_S: Final = 0.01
# The lines carry neither time nor number. Every ``PERIOD_S``, the board sends both lines of a
# sample in one cycle, always in the same order. A false pair is detected in two ways. A line of
# another kind comes between its lines, and usually lines of this kind do not come there. Or the
# time between its lines is long, so the pair waits for the next pose, and this pose shows that
# lines are missing since the previous pose. One kind of false pair remains undetected: both lines
# are late, but close together, and no later pose is in the read.
PAIR_WITHIN_S: Final = 0.005
"""Limit, in s, for the time between a gyro line and an acceleration line that form a pair.

If the time reaches this limit, the pair is used only if the next pose shows that no lines are
missing.
"""
SILENT_S: Final = 0.1
"""Limit, in s, for a time without gyro and acceleration lines.

After a longer time, pairs of these lines wait for the next pose, which shows whether lines are
missing.
"""
WARY_S: Final = 1.0
"""Time in s after a stall of the driver in which new pairs of lines wait for the next pose.

The kernel's buffer may have overflowed. The next pose shows whether lines are missing.
"""
KNOWN_S: Final = 0.025
SUREST_S: Final = 0.05
"""``KNOWN_S``, ``SUREST_S``: limits, in s, for the evidence which line of a sample comes first.

From a magnitude of ``KNOWN_S`` on, the sign of the evidence decides. The magnitude never exceeds
``SUREST_S``.
"""
MARKED_S: Final = PERIOD_S
"""Time in s that is added to a pause between a gyro and an acceleration line.

The driver adds this time if another line came in this pause, because the two lines then probably
belong to different samples.
"""
PATIENCE: Final = 60
"""Number of measured intervals after which the driver decides which line of a sample comes first.

The intervals are between a gyro line and an acceleration line. The driver decides earlier if the
evidence is strong enough (``KNOWN_S``).
"""
MOST: Final = 10
"""Largest magnitude of the counters which show whether a kind of line comes within IMU pairs."""
UNPOSED: Final = 20
"""Limit for the number of gyro lines, and of acceleration lines, since the last pose.

Above this limit, the driver rejects a doubtful pair of these lines instead of waiting for the next
pose.
"""


@dataclass(slots=True)
class Pair:
    """A gyro and an acceleration line, probably of one sample.

    * ``at``: arrival time of the second line, in s.
    * ``pose_s``, ``next_pose_s``: board times of the poses before and after the pair; infinity if
      the next pose has not arrived.
    * ``skipped``: number of incomplete samples since the previous pair.
    * ``doubtful``: whether the pair must wait for the next pose.
    """

    gyro: Gyro
    acceleration: Acceleration
    at: float
    pose_s: float
    skipped: int
    doubtful: bool
    next_pose_s: float = math.inf


Oriented = tuple[Attitude, float]
"""An orientation, and the time in s at which it arrived."""


class ImuPairs:
    """Forms pairs: a gyro and an acceleration line of the same IMU sample.

    ``take`` returns pairs and orientations in order of arrival.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget all received lines and their order, because a new stream of lines begins."""
        self.first: Kind | None = None
        """The kind of line, gyro or acceleration, that comes first in a sample; None while
        unknown."""
        self._evidence_s = 0.0
        """Sum of the intervals before gyro lines, minus the sum before acceleration lines, in s.

        A positive sum shows that the gyro line comes first, because the longer interval precedes
        the first line.
        """
        self._seen = 0
        self._last: tuple[Kind, Gyro | Acceleration, float] | None = None
        self._waiting: tuple[Gyro | Acceleration, float] | None = None
        self._between: set[str] = set()
        """The kinds of lines that arrived since the last gyro or acceleration line."""
        self._outside: dict[str, int] = {}
        """A counter for each kind of line, except gyro and acceleration lines.

        The counter is positive if this kind usually comes between two pairs, and negative if it
        comes within a pair.
        """
        self._skipped = 0
        self._silent = False
        """Whether more than ``SILENT_S`` passed between two successive gyro or acceleration lines.

        If True, each new pair is doubtful. The next pose, or the rejection of a doubtful pair,
        resets this flag.
        """
        self._stalled, self._wary_until = False, -math.inf
        self._queue: deque[Pair | Oriented] = deque()
        self._pose_s = -math.inf
        self._counts: dict[Kind, int] = {"gyro": 0, "acc": 0}
        """How many gyro and acceleration lines arrived since the last pose."""

    def stalled(self) -> None:
        """Record a stall of the driver, after which lines may be missing."""
        self._stalled = True

    def gyro(self, gyro: Gyro, now: float) -> None:
        """Receive a gyro line."""
        self._line("gyro", gyro, now)

    def acceleration(self, acceleration: Acceleration, now: float) -> None:
        """Receive an acceleration line."""
        self._line("acc", acceleration, now)

    def other(self, kind: str) -> None:
        """Receive a line that is neither a gyro nor an acceleration line. ``kind``: its keyword.

        A pair that waits for its second line is given up if lines of this kind do not usually come
        within a pair.
        """
        self._between.add(kind)
        if self._waiting is not None and self._outside.get(kind, 0) >= 0:
            self._waiting = None
            self._skipped += 1

    def attitude(self, attitude: Attitude, now: float) -> None:
        """Receive an orientation; ``take`` returns it after all pairs that came before it."""
        self.other("imupose")
        self._queue.append((attitude, now))

    def pose(self, time_s: float) -> None:
        """Receive the board's time of a pose, and accept or reject all waiting pairs.

        Pairs are rejected if both gyro and acceleration lines are missing since the previous pose,
        or if the time since then is unknown.
        """
        self.other("pose")
        periods = (time_s - self._pose_s) / PERIOD_S
        if abs(periods) < 0.5:
            return  # the same line came twice
        counted = 0.0 < periods < math.inf
        lacking = counted and all(count < round(periods) for count in self._counts.values())
        for pair in [item for item in self._queue if isinstance(item, Pair)]:
            if lacking or not counted:
                self._reject(pair)
            pair.doubtful, pair.next_pose_s = False, time_s
        self._silent = False
        self._pose_s = time_s
        self._counts = {"gyro": 0, "acc": 0}

    def take(self) -> list[Pair | Oriented]:
        """Return the pairs and orientations in order of arrival, up to the first doubtful pair.

        Call this method after a pose and at the end of a read.
        """
        taken: list[Pair | Oriented] = []
        while self._queue:
            item = self._queue[0]
            if isinstance(item, Pair) and item.doubtful:
                if max(self._counts.values()) <= UNPOSED:
                    break
                self._silent = False
                self._reject(item)
                continue
            taken.append(self._queue.popleft())
        return taken

    def _reject(self, pair: Pair) -> None:
        """Remove a pair, and count its two lines as two incomplete samples."""
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
        if self._stalled:
            self._stalled, self._wary_until = False, now + WARY_S
        between, self._between = self._between, set()
        self._counts[kind] += 1
        self._silent |= last is not None and now - last[2] > SILENT_S
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
        doubtful = late or self._silent or now < self._wary_until
        pair = Pair(gyro, acceleration, now, self._pose_s, self._skipped, doubtful)
        self._queue.append(pair)
        self._skipped = 0

    def _place(self, kinds: set[str], step: int) -> None:
        """Change the counters which show whether a kind of line comes within IMU pairs.

        ``kinds``: kinds of lines that have come. ``step``: 1 if the lines came between two pairs,
        -1 if within a pair.
        """
        for kind in kinds:
            self._outside[kind] = max(-MOST, min(MOST, self._outside.get(kind, 0) + step))

    def _learn(self, kind: Kind, pause_s: float, *, marked: bool) -> None:
        """Learn which line of a sample comes first.

        The line that comes first has the longer interval before it.
        """
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
