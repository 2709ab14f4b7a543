# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Probability that a wheel is at rest while the board keeps reporting the same speed for it.

When a wheel stops, the public firmware keeps reporting the wheel's last speed, usually 5 to 17 RPM.

This module works on reported speeds and the time between them.
"""

from collections import deque
from typing import Final

SAME_RPM: Final = 0.1
SLOWEST_RPM: Final = 4.5
FASTEST_RPM: Final = 23.5
"""``SLOWEST_RPM``, ``FASTEST_RPM``: usual range of the speed that the board keeps reporting for a
stopped wheel. A wheel with another reported speed still rolls, or is just starting."""
FAST_RPM: Final = 19.5
FELL_RPM: Final = 5.0
FELL_FAR_RPM: Final = 7.0
WITHIN_S: Final = 0.9
SWINGS_S: Final = 2.0
LOST_REPORTS: Final = 4
LOST_S: Final = 0.25
"""Limit for the mean time in s between the last ``LOST_REPORTS`` reports. If the mean time is above
the limit, reports are lost, or the board rarely sends reports."""
REPORT_S: Final = 0.2
"""Longest usual time in s between two reports.

After lost reports, the next report makes the stored speeds older by at most ``REPORT_S``, so that
the driver does not forget them too soon.
"""
HIDDEN_PART: Final = 0.3
"""Part of a time without reported speeds that is added to the age of the stored speeds.

The driver thus keeps the stored speeds for longer.
"""
FAST: Final[tuple[float, ...]] = (0.0, 0.1, 0.5, 1.0)
FAR: Final[tuple[float, ...]] = (0.0, 0.6, 1.0)
LONE: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
NEAR: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3)
FASTER: Final[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0, 0.1, 0.3, 0.6, 1.0)
FELL_IN_GAPS: Final[tuple[float, ...]] = (0.0, 0.6, 0.8, 0.9, 1.0)
GAPS: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.7, 0.8, 0.8, 1.0)
TUNED: Final[tuple[float, ...]] = (0.0, 0.1, 0.2, 0.3)
"""Probabilities that a wheel is at rest, by the number of repetitions of its reported speed.

The last value also holds for more repetitions. Each tuple is for one situation. ``FASTER`` is
assumed. The values in the other tuples were counted on the public firmware.
"""


class RestingWheel:
    """Estimator of the probability that a wheel is at rest.

    ``chance``: the probability, 0..1.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget all speeds. The next speed is treated as the first."""
        self._lately: deque[tuple[float, float]] = deque(maxlen=64)
        self._told_rpm = 0.0
        self._fell_at_s = -SWINGS_S
        self._fell_rpm = 0.0
        self._lone = False
        self._repeats = 0
        self._gaps = False
        """Whether reports were being lost when the reported speed last changed.

        If the user has set the controller's gains, lost reports are ignored: the value is False.
        """
        self._intervals_s: deque[float] = deque(maxlen=LOST_REPORTS)
        self._clock_s = 0.0
        self.chance = 0.0

    @property
    def swings(self) -> bool:
        """Whether the reported speed fell by ``FELL_FAR_RPM`` or more in the last ``SWINGS_S``."""
        return self._clock_s < self._fell_at_s + SWINGS_S

    def note(self, rpm: float, since_s: float) -> None:
        """Store an estimate of the wheel's speed, because the board has not reported a speed.

        ``since_s``: for how long the board has reported no speed, in s.
        """
        self._pass(HIDDEN_PART * since_s)
        self._lately.append((self._clock_s, rpm))

    def tell(self, rpm: float, since_s: float, *, tuned: bool = False) -> None:
        """Process a speed of the wheel that the board has reported, without its sign.

        ``since_s``: time since the previous report of the speed.

        ``tuned``: whether the user set the controller's gains.
        """
        self._intervals_s.append(since_s)
        lost = sum(self._intervals_s) > LOST_S * len(self._intervals_s)
        self._pass(min(since_s, REPORT_S) if lost else since_s)
        if abs(rpm - self._told_rpm) < SAME_RPM:
            self._repeats += 1
        else:
            # A single high speed comes from a delayed tick: the next tick then seems early.
            speeds = sorted({before for _, before in self._lately}, reverse=True)
            self._fell_rpm = speeds[1] - rpm if len(speeds) > 1 else 0.0
            self._lone = bool(speeds) and self._fell_rpm < FELL_FAR_RPM <= speeds[0] - rpm
            self._repeats = 0
            self._gaps = lost and not tuned
            if self._fell_rpm >= FELL_FAR_RPM:
                self._fell_at_s = self._clock_s
        self._told_rpm = rpm
        self._lately.append((self._clock_s, rpm))
        chances = self._chances(rpm)
        if chances and tuned:
            chances = TUNED if rpm < FASTEST_RPM else ()
        self.chance = chances[min(self._repeats, len(chances) - 1)] if chances else 0.0

    def _chances(self, rpm: float) -> tuple[float, ...]:
        """Return probabilities that the wheel is at rest, by the number of repeats of its speed.

        The result is empty if the wheel surely rolls.
        """
        # A wheel at such a speed rolls on, unless a late tick has made the speed wrong.
        if rpm >= FASTEST_RPM:
            return FASTER if self._fell_rpm >= FELL_FAR_RPM else ()
        if rpm <= SLOWEST_RPM:
            return ()
        if rpm > FAST_RPM:
            return FAST if self._fell_rpm >= FELL_RPM else ()
        if self._fell_rpm >= FELL_FAR_RPM:
            return FAR
        if self._gaps:
            return FELL_IN_GAPS if self._lone or self._fell_rpm >= FELL_RPM else GAPS
        if self._lone:
            return LONE
        return NEAR if self._fell_rpm >= FELL_RPM else ()

    def _pass(self, since_s: float) -> None:
        self._clock_s += since_s
        while self._lately and self._lately[0][0] < self._clock_s - WITHIN_S:
            self._lately.popleft()
