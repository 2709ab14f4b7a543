# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Converts a Teensy's time to the host's time, and gives all readings their timestamps.

The conversion is a straight line just below all arrival times (docs/internals/time.md).
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import ExtraReading, ImuReading, Reading, SampleBoundary
from omnibot_driver.core.timing.clock_fit import ClockFit

TICK_S: Final = 0.01
EARLY_S: Final = 0.005
"""Longest time, in s, by which a line may seem to arrive before the board has sent it.

If a line seems to arrive even earlier, its board time is implausible.
"""
LATE_S: Final = 1.0
"""Longest plausible delay of a line in s, even if the host was busy."""
WAITED_S: Final = 1.0
"""Time in s, from the first line after a stall of the driver, in which a line is accepted however
late it is: it may have waited during the stall.
"""
AGAIN: Final = 3
AGAIN_AFTER_S: Final = 0.05
AGREE_S: Final = 0.1
"""Tolerance in s. Board times agree if they advance like their arrival times within this tolerance.

The clock begins anew if at least ``AGAIN`` implausible board times in a row agree, over at least
``AGAIN_AFTER_S``.
"""
EARLIES_WITHIN_S: Final = 1.0
"""Limit, in s, for the time from the first to the last of three lines that seem early.

If the board times of the three lines agree, the clock was begun with a late line. The clock then
begins anew.
"""
FASTEST: Final = 1.001
"""How fast a board's clock runs at most, as a multiple of the host's."""
SMALLEST_STEP_S: Final = 1e-6
"""Smallest step in s between two timestamps of one kind of reading.

A smaller step might disappear when timestamps are rounded to the nanosecond.
"""


class TeensyClock:
    """Clock of one board.

    ``restarted``: whether the newest time from the board shows that the board has restarted.
    """

    def __init__(self) -> None:
        self.restarted = False
        self.begin()

    def begin(self) -> None:
        """Forget all times of the board."""
        self._fit: ClockFit | None = None
        self._odd: tuple[float, float] | None = None
        self._odds = 0
        """Number of successive board times that are implausible, but agree with each other.

        ``_odd``: the first of these board times, and its time of arrival.
        """
        self._earlies: list[tuple[float, float]] = []
        """Board time and arrival time of each line that, by this clock, arrived too early.

        The lines are early by at most ``LATE_S``. Their board times agree with each other
        (``AGREE_S``).
        """
        self._last_s = 0.0
        self.connect()

    def connect(self) -> None:
        """Begin a new connection: keep the board's times, but forget an earlier stall."""
        self._stalled, self._waited_until = False, -math.inf

    def stalled(self) -> None:
        """Record a stall of the driver. The next lines may have waited until its end."""
        self._stalled = True

    @property
    def known(self) -> bool:
        """Whether the board has sent a time."""
        return self._fit is not None

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock runs than the host's, in parts per million."""
        return 0.0 if self._fit is None else (TICK_S / self._fit.slope_s - 1.0) * 1e6

    def host_s(self, board_s: float) -> float:
        """Convert a time of the board to the host's time, in s."""
        assert self._fit is not None
        tick = int(board_s / TICK_S)
        return self._fit.at(tick) + board_s - tick * TICK_S

    def board_s(self, host_s: float) -> float:
        """Convert a time of the host to the board's time, in s: the inverse of ``host_s``."""
        assert self._fit is not None
        near_s = host_s - self.host_s(self._last_s) + self._last_s
        return near_s + (host_s - self.host_s(near_s))

    def see(self, board_s: float, now: float) -> bool:
        """Receive the board time of a line that came at ``now``; return whether it is plausible."""
        self.restarted = False
        if self._stalled:
            self._stalled, self._waited_until = False, now + WAITED_S
        if self._fit is not None:
            late_s = now - self.host_s(board_s)
            latest_s = math.inf if now < self._waited_until else LATE_S
            plausible = -EARLY_S <= late_s <= latest_s and board_s >= self._last_s - EARLY_S
            early = -LATE_S <= late_s < -EARLY_S and self._began_late(board_s, now)
            if not plausible and not early and not self._is_new_time(board_s, now):
                return False
        else:
            self._begin_at(board_s, now)
        self._odd = None
        if self._earlies and board_s <= self._earlies[-1][0]:
            self._earlies = []  # that time was damaged, because the board's time only increases
        self._last_s = board_s
        tick = int(board_s / TICK_S)
        assert self._fit is not None
        self._fit.see((tick, now - (board_s - tick * TICK_S)), cut=False)
        return True

    def _is_new_time(self, board_s: float, now: float) -> bool:
        """Begin the clock anew if enough implausible board times in a row agree with each other.

        Return whether the clock has begun anew.
        """
        if self._odd is None or abs((board_s - self._odd[0]) - (now - self._odd[1])) >= AGREE_S:
            self._odd, self._odds = (board_s, now), 1
            return False
        self._odds += 1
        # Lines that arrive in a shorter time may only have waited for a stalled host.
        if self._odds < AGAIN or now - self._odd[1] < AGAIN_AFTER_S:
            return False
        # A board that restarted after its last line cannot have run for longer than the time since
        # then. A board that did not restart has run for longer; its lines only arrive late.
        assert self._fit is not None
        since_s = now - self.host_s(self._last_s)
        self.restarted = board_s < max(self._last_s, since_s * FASTEST)
        self._begin_at(board_s, now)
        return True

    def _began_late(self, board_s: float, now: float) -> bool:
        """Begin the clock anew if the clock began with a line that arrived late.

        The proof is three (``AGAIN``) lines that are too early by this clock and whose board times
        agree. Return whether the clock has begun anew.
        """
        agree = all(
            before_s < board_s
            and now - at <= EARLIES_WITHIN_S
            and abs((board_s - before_s) - (now - at)) < AGREE_S
            for before_s, at in self._earlies
        )
        self._earlies = [*self._earlies, (board_s, now)] if agree else [(board_s, now)]
        if len(self._earlies) < AGAIN:
            return False
        self._begin_at(board_s, board_s + min(at - early_s for early_s, at in self._earlies))
        return True

    def _begin_at(self, board_s: float, now: float) -> None:
        tick = int(board_s / TICK_S)
        self._fit = ClockFit(TICK_S, (tick, now - (board_s - tick * TICK_S)))
        self._earlies = []


class StampedReadings:
    """The readings that one call of the board returns, with their timestamps; a ``ReadingClock``.

    Timestamps of one kind of reading differ by at least ``SMALLEST_STEP_S``.
    """

    skew_ppm = 0.0
    """How much faster the drive board's clock runs than the host's, in parts per million."""

    def __init__(self) -> None:
        self._last: dict[type, float] = {}
        self.begin()

    def begin(self) -> None:
        """Discard the readings when ``FejemisBoard.receive``, ``flush`` or ``elapse`` begins."""
        self.readings: list[Reading] = []
        self._stamps: list[float] = []

    def add(self, reading: Reading, stamp_s: float, now: float) -> None:
        """Add a reading with the timestamp ``stamp_s``, or ``now`` if ``stamp_s`` is later.

        If necessary, the timestamp is raised to ``SMALLEST_STEP_S`` after the last timestamp of
        this kind of reading.
        """
        kind = type(reading.content if isinstance(reading, ExtraReading) else reading)
        least_s = self._last.get(kind, -math.inf) + SMALLEST_STEP_S
        stamp_s = self._last[kind] = max(min(stamp_s, now), least_s)
        self.readings.append(reading)
        self._stamps.append(stamp_s)

    def restart(self) -> None:
        """Do nothing, because the timestamps come from the times that the board sends."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Return the timestamps of the readings that were added with ``add``.

        ``readings``: the added readings. If their number is wrong, each gets the timestamp ``now``.
        """
        return self._stamps if len(self._stamps) == len(readings) else [now] * len(readings)

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Return the timestamp of the first reading that was added; ``now`` if there is none."""
        return self._stamps[0] if self._stamps else now
