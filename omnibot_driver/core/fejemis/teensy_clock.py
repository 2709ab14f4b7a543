# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""When was it by our clock, at this time of a Teensy? And what stamps the readings of both.

A line comes late, never early, so the arrivals lie above a straight line over the Teensy's time
(`core/timing/clock_fit.py`). A time that leaves that line by more than a line of text can be late,
or that is before it, was damaged on the way, or the board has restarted.
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import ImuReading, Reading, SampleBoundary
from omnibot_driver.core.timing.clock_fit import ClockFit

TICK_S: Final = 0.01
EARLY_S: Final = 0.005
"""A time that is ahead of the arrivals by more was not measured yet."""
LATE_S: Final = 1.0
"""One that is behind by more is another time, even where the host was busy."""
AGAIN: Final = 3
AGAIN_AFTER_S: Final = 0.05
AGREE_S: Final = 0.1
"""Three such times in a row that agree with each other, over at least this time, are those of a
board that has restarted. Lines that waited while the host was stalled arrive at once."""
SMALLEST_STEP_S: Final = 1e-6


class TeensyClock:
    """Of one board. ``restarted``: it began anew with the time that was seen last."""

    def __init__(self) -> None:
        self.restarted = False
        self.begin()

    def begin(self) -> None:
        """Nothing is known of it."""
        self._fit: ClockFit | None = None
        self._odd: tuple[float, float] | None = None
        self._odds = 0
        """The first of these times, and when it came."""
        self._last_s = 0.0
        self._low_s = 0.0

    @property
    def known(self) -> bool:
        """Whether a time has been seen."""
        return self._fit is not None

    @property
    def skew_ppm(self) -> float:
        """How much faster it runs than ours."""
        return 0.0 if self._fit is None else (TICK_S / self._fit.slope_s - 1.0) * 1e6

    def host_s(self, board_s: float) -> float:
        """When it was by our clock."""
        assert self._fit is not None
        tick = int(board_s / TICK_S)
        return self._fit.at(tick) + board_s - tick * TICK_S

    def board_s(self, host_s: float) -> float:
        """Which time of the board this was, if nothing had come late."""
        assert self._fit is not None
        near_s = host_s - self.host_s(self._last_s) + self._last_s
        return near_s + (host_s - self.host_s(near_s))

    def see(self, board_s: float, now: float) -> bool:
        """A line with this time came. False: it cannot be the board's time."""
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
        """Whether it goes on from times that were as odd."""
        if self._odd is None or abs((board_s - self._odd[0]) - (now - self._odd[1])) >= AGREE_S:
            self._odd, self._odds = (board_s, now), 1
            return False
        self._odds += 1
        if self._odds < AGAIN or now - self._odd[1] < AGAIN_AFTER_S:
            return False
        self.restarted = board_s < self._last_s  # lines that had waited before are in the past
        self._begin_at(board_s, now)
        return True

    def _begin_at(self, board_s: float, now: float) -> None:
        tick = int(board_s / TICK_S)
        self._fit = ClockFit(TICK_S, (tick, now - (board_s - tick * TICK_S)))


class StampedReadings:
    """The readings of one call, with the stamps that they were given: a ``ReadingClock``.

    Stamps of one kind of reading go forward, and are not later than the call.
    """

    skew_ppm = 0.0
    """Of the drive board's clock."""

    def __init__(self) -> None:
        self._last: dict[type, float] = {}
        self.begin()

    def begin(self) -> None:
        """A call."""
        self.readings: list[Reading] = []
        self._stamps: list[float] = []

    def add(self, reading: Reading, stamp_s: float, now: float) -> None:
        """One more."""
        kind = type(reading)
        stamp_s = min(stamp_s, now)
        last_s = self._last.get(kind)
        if last_s is not None and stamp_s <= last_s:
            stamp_s = last_s + SMALLEST_STEP_S
        self._last[kind] = stamp_s
        self.readings.append(reading)
        self._stamps.append(stamp_s)

    def restart(self) -> None:
        """The board's own times tell."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """As they were added."""
        return self._stamps if len(self._stamps) == len(readings) else [now] * len(readings)

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Of one."""
        return self._stamps[0] if self._stamps else now
