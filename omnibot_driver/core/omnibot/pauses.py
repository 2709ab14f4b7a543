# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Where the line was idle, and how far that may be trusted.

A board sends a tick's frames at once, so a pause of its line stands between frames. An adapter that
collects bytes makes pauses of its own, anywhere. Which of the two a pause is, only frames can tell:
this module counts how often pauses stood where they should. It knows places and times; not what is
in a frame, nor which frames are believed (``decoder``).
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.omnibot import evidence
from omnibot_driver.core.omnibot.lattice import Gap

IDLE_S: Final = 0.1
"""Longer than any adapter keeps a byte back (16 ms), and ten times the board's 10 ms tick."""
LATE_S: Final = 0.011
"""While the board runs its line is never idle for longer, unless bytes were lost; an adapter that
collects bytes for longer shows pauses of its own."""
GAP_S: Final = 4e-3
"""No frame is sent with such a pause in it."""
BYTE_S: Final = 10 / 115200
"""To send one, by the manual."""
TICK_BYTES: Final = 14 + 9 + 15
"""All that one tick can bring. More at once after a pause means that we were late, not the line."""
PAUSES_TO_TRUST: Final = 16
"""So many pauses that stood where they should, and they are taken for the line's own."""


class Pauses:
    """``gaps``: those within the bytes held.

    ``sharp``: as a rule, the first byte that comes after a pause begins a frame; ``between``: as a
    rule, a frame begins somewhere in what comes after it. ``certain``: both have held for so long
    that once more changes nothing. ``byte_s``: how long the line takes for a byte.
    """

    def __init__(self, byte_s: float) -> None:
        self._byte_s = byte_s
        self.gaps: list[Gap] = []
        self.doubt()

    def doubt(self) -> None:
        """They may have deceived us."""
        self.sharp = self.between = self.certain = False
        self._sharp = self._between = 0

    def add(self, pause_s: float, arrived: int, place: int) -> None:
        """Before the bytes that arrived now, and are to be held from this place on."""
        if pause_s - arrived * self._byte_s <= GAP_S:
            return
        sharp, between = self.sharp, self.between
        if pause_s > LATE_S:
            sharp = sharp or between  # bytes were lost here, and hardly whole frames
            self._trust(sharp=False, between=False)
        width = 1 if sharp else arrived
        price = evidence.KNOWN_GAP if between else evidence.GAP
        self.gaps.append((place, place + width, price))

    def stood_between(self, pause_s: float, arrived: int) -> None:
        """What came after this pause began with a frame and ended with one."""
        if pause_s - arrived * self._byte_s > GAP_S:
            self._trust(sharp=True, between=True)

    def compare(self, ends: Sequence[int]) -> None:
        """Do they end where frames begin? Then they are the line's, not the adapter's."""
        start = 0
        for end in ends:
            for first, before, _ in self.gaps:
                if start <= first < end:
                    self._trust(sharp=first == start, between=first == start or end < before)
            start = end

    def within(self, start: int, end: int) -> bool:
        """Whether the line was idle between the first and the last of these bytes."""
        for first, before, _ in self.gaps:  # noqa: SIM110 - the call of a generator costs more
            if start < first < end and before <= end:
                return True
        return False

    def forget(self, count: int) -> None:
        """The first bytes are held no longer."""
        if self.gaps and self.gaps[-1][0] < count:
            self.gaps = []
        elif self.gaps:
            self.gaps = [(a - count, b - count, p) for a, b, p in self.gaps if a >= count]

    def _trust(self, *, sharp: bool, between: bool) -> None:
        if sharp and between and self.certain:
            return
        most = 2 * PAUSES_TO_TRUST
        self._sharp = min(self._sharp + 1, most) if sharp else max(self._sharp - 4, 0)
        self._between = min(self._between + 1, most) if between else max(self._between - 4, 0)
        self.sharp = self._sharp >= PAUSES_TO_TRUST
        self.between = self._between >= PAUSES_TO_TRUST
        self.certain = self._sharp == self._between == most
