# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversion of a Teensy's time into the host's time, and stamps for the readings of both boards.

A line comes late, never early, so the arrivals lie above a straight line over the Teensy's time
(`core/timing/clock_fit.py`). A time that is later than a line can be, or earlier than possible, was
damaged, or the board has restarted.
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import ImuReading, Reading, SampleBoundary
from omnibot_driver.core.timing.clock_fit import ClockFit

TICK_S: Final = 0.01
EARLY_S: Final = 0.005
"""Largest time in s by which a line may seem early; beyond, its time cannot be true."""
LATE_S: Final = 1.0
"""Largest delay of a line in s, even if the host was busy; beyond, its time is another one."""
AGAIN: Final = 3
AGAIN_AFTER_S: Final = 0.05
AGREE_S: Final = 0.1
"""Difference in s between times that agree.

``AGAIN`` implausible times in a row that agree, over ``AGAIN_AFTER_S`` or longer, belong to a board
that has restarted. Lines that waited while the host was stalled arrive at once."""
SMALLEST_STEP_S: Final = 1e-6


class TeensyClock:
    """Clock of one board; ``restarted``: the last time seen began a new time base."""

    def __init__(self) -> None:
        self.restarted = False
        self.begin()

    def begin(self) -> None:
        """Forget all times of the board."""
        self._fit: ClockFit | None = None
        self._odd: tuple[float, float] | None = None
        self._odds = 0
        """The first of the implausible times, with its arrival, and their count."""
        self._last_s = 0.0

    @property
    def known(self) -> bool:
        """Whether a time has been seen."""
        return self._fit is not None

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock runs than the host's, in ppm."""
        return 0.0 if self._fit is None else (TICK_S / self._fit.slope_s - 1.0) * 1e6

    def host_s(self, board_s: float) -> float:
        """Return the host's time at a time of the board, in s."""
        assert self._fit is not None
        tick = int(board_s / TICK_S)
        return self._fit.at(tick) + board_s - tick * TICK_S

    def board_s(self, host_s: float) -> float:
        """Return the board's time at a time of the host, in s, as if without delay."""
        assert self._fit is not None
        near_s = host_s - self.host_s(self._last_s) + self._last_s
        return near_s + (host_s - self.host_s(near_s))

    def see(self, board_s: float, now: float) -> bool:
        """Take the time in a line that has just come; return whether it can be the board's."""
        self.restarted = False
        if self._fit is not None:
            late_s = now - self.host_s(board_s)
            if not -EARLY_S <= late_s <= LATE_S and not self._is_new_time(board_s, now):
                return False
        else:
            self._begin_at(board_s, now)
        self._odd = None
        self._last_s = board_s
        tick = int(board_s / TICK_S)
        assert self._fit is not None
        self._fit.see((tick, now - (board_s - tick * TICK_S)), cut=False)
        return True

    def _is_new_time(self, board_s: float, now: float) -> bool:
        """Return whether enough implausible times agree, and then begin anew with this one."""
        if self._odd is None or abs((board_s - self._odd[0]) - (now - self._odd[1])) >= AGREE_S:
            self._odd, self._odds = (board_s, now), 1
            return False
        self._odds += 1
        if self._odds < AGAIN or now - self._odd[1] < AGAIN_AFTER_S:
            return False
        self.restarted = board_s < self._last_s  # if it is later, earlier lines had only waited
        self._begin_at(board_s, now)
        return True

    def _begin_at(self, board_s: float, now: float) -> None:
        tick = int(board_s / TICK_S)
        self._fit = ClockFit(TICK_S, (tick, now - (board_s - tick * TICK_S)))


class StampedReadings:
    """The readings of one call with their stamps; a ``ReadingClock``.

    The stamps of one kind of reading increase, and are not later than the call.
    """

    skew_ppm = 0.0
    """How much faster the drive board's clock runs than the host's, in ppm."""

    def __init__(self) -> None:
        self._last: dict[type, float] = {}
        self.begin()

    def begin(self) -> None:
        """Begin a call, without readings."""
        self.readings: list[Reading] = []
        self._stamps: list[float] = []

    def add(self, reading: Reading, stamp_s: float, now: float) -> None:
        """Add a reading with its stamp."""
        kind = type(reading)
        stamp_s = min(stamp_s, now)
        last_s = self._last.get(kind)
        if last_s is not None and stamp_s <= last_s:
            stamp_s = last_s + SMALLEST_STEP_S
        self._last[kind] = stamp_s
        self.readings.append(reading)
        self._stamps.append(stamp_s)

    def restart(self) -> None:
        """Do nothing: the stamps come from the board's own times."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Return the stamps of the readings, as they were added."""
        return self._stamps if len(self._stamps) == len(readings) else [now] * len(readings)

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Return the stamp of a single reading."""
        return self._stamps[0] if self._stamps else now
