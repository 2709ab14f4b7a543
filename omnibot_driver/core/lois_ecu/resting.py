# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Whether a wheel stands when the board keeps reporting the same speed for it.

The public firmware keeps the speed of the last tick of a wheel that stands. A wheel that comes to
rest slows down before, and its last tick tells 5 to 17 RPM: then that number stays. A wheel that
rolls on steadily repeats a number too, but not one that it has just fallen to. Knows speeds as
the board reports them, one for each group, and how long ago; no filter.
"""

from collections import deque
from typing import Final

SAME_RPM: Final = 0.1
SLOWEST_RPM: Final = 4.5
FASTEST_RPM: Final = 19.5
"""A wheel that starts tells less; one that is faster ticks once more before it stands."""
STEEP_RPM: Final = 25.0
FASTEST_STEEP_RPM: Final = 23.5
"""A wheel that has fallen by this comes to rest within one tick from this speed."""
FELL_RPM: Final = 5.0
FELL_FAR_RPM: Final = 7.0
WITHIN_S: Final = 0.9
SWINGS_S: Final = 2.0
HIDDEN_PART: Final = 0.3
"""The clock runs at this part of its speed while no speeds are reported."""
STEEP: Final[tuple[float, ...]] = (0.0, 0.3, 1.0)
FAR: Final[tuple[float, ...]] = (0.0, 0.6, 1.0)
LONE: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
NEAR: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3)
"""Chance that it stands, by the number of repetitions: of a fast wheel after a steep fall, after a
far fall, after a far fall from a speed that was reported once, and after a shorter fall. Counted on
the public firmware with the gains that it boots with, and with better ones, with which no wheel
falls like this."""


class RestingWheel:
    """``chance`` that the wheel stands, 0..1."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew: the next speed is the first."""
        self._lately: deque[tuple[float, float]] = deque(maxlen=64)
        self._told_rpm = 0.0
        self._fell_at_s = -SWINGS_S
        self._fell_rpm = 0.0
        self._lone = False
        self._repeats = 0
        self._clock_s = 0.0
        self.chance = 0.0

    @property
    def swings(self) -> bool:
        """Whether the reported speed fell far in the last ``SWINGS_S``."""
        return self._clock_s < self._fell_at_s + SWINGS_S

    def note(self, rpm: float, since_s: float) -> None:
        """Take an estimated speed where none was reported. The last reported speed is kept."""
        self._pass(HIDDEN_PART * since_s)
        self._lately.append((self._clock_s, rpm))

    def tell(self, rpm: float, since_s: float) -> None:
        """A speed without its sign, ``since_s`` after the one before."""
        self._pass(since_s)
        if abs(rpm - self._told_rpm) < SAME_RPM:
            self._repeats += 1
        else:
            # A lone fast tick is one that came late: the next one seems to be early.
            speeds = sorted({before for _, before in self._lately}, reverse=True)
            self._fell_rpm = speeds[1] - rpm if len(speeds) > 1 else 0.0
            self._lone = bool(speeds) and self._fell_rpm < FELL_FAR_RPM <= speeds[0] - rpm
            self._repeats = 0
            if self._fell_rpm >= FELL_FAR_RPM:
                self._fell_at_s = self._clock_s
        self._told_rpm = rpm
        self._lately.append((self._clock_s, rpm))
        self.chance = 0.0
        steep = self._fell_rpm >= STEEP_RPM
        if not SLOWEST_RPM < rpm < (FASTEST_STEEP_RPM if steep else FASTEST_RPM):
            return
        chances: tuple[float, ...] = (0.0,)
        if steep and rpm > FASTEST_RPM:
            chances = STEEP
        elif self._fell_rpm >= FELL_FAR_RPM:
            chances = FAR
        elif self._lone:
            chances = LONE
        elif self._fell_rpm >= FELL_RPM:
            chances = NEAR
        self.chance = chances[min(self._repeats, len(chances) - 1)]

    def _pass(self, since_s: float) -> None:
        self._clock_s += since_s
        while self._lately and self._lately[0][0] < self._clock_s - WITHIN_S:
            self._lately.popleft()
