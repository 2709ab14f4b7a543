# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writing of settings to a board that acknowledges nothing and loses single lines.

Each setting is written in several rounds. A GPS date, and ticks with the set period, confirm the
settings.
"""

import math
from collections import deque
from collections.abc import Iterable
from itertools import pairwise
from statistics import median
from typing import Final

from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.codec import encode_command
from omnibot_driver.core.lois_ecu.messages import (
    PERIOD_ONCE,
    Command,
    SetPeriod,
    SetTerminalMode,
    Stream,
    TerminalMode,
)
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.settings_round import (
    ROUNDS,
    dates_come_periodically,
    left_short_correction,
    round_commands,
    sets_ticks,
    slow_ticks,
)

# The pause between two rounds is longer than the time for which the board cannot receive.
ROUND_S: Final = 0.15
LINE_S: Final = 0.02
# For up to 13 ms, the board may receive nothing. Without a pause, the beginning of a set-point and
# the end of another line could form a motion command. Even the beginning of a Stop is dangerous:
# with the end of a setting, it could command full duty.
AFTER_SET_POINT_S: Final = 0.015
"""Shortest time in s from any set-point to a setting, and from a set-point other than zero to a
*side command*. A side command, for example for the LED, is neither a set-point nor a setting."""
LONGEST_WAIT_S: Final = 0.5
"""Longest time in s for which set-points may delay a setting. On a very busy computer, a set-point
may be due each time that a setting could be sent."""
AWAY_S: Final = (0.05, 0.09, 0.13, 0.17)
"""Delays in s, used in turn, from a report to a round of settings or to a request of a GPS date.

The board cannot receive while it sends. After a constant delay, the board could be
sending every time.
"""
CONFIRMED_WITHIN: Final = 0.35
"""Largest accepted difference between the measured and the set period of the tick reports, as a
fraction of the set period. Within it, the set period is confirmed."""
DATE_AGAIN_S: Final = 3.0
"""Shortest time in s between two calls of ``ask_date`` that request the GPS date."""
TICKS_DUE_S: Final = 1.5
"""Longest wait for a tick report, in s since the last one, before the driver sets its period again.

Only for a period above ``FAST_TICKS_MS``.
"""
MOST_ROUNDS: Final = 40
RECOVER_AFTER_S: Final = 3.0
"""Time in s without an answer after which the driver restores the board's normal mode. The time is
longer than a boot (2 s)."""
UNANSWERED_S: Final = 5.0
"""Time in s without the requested GPS date after which the driver restores the normal mode.

The driver does this even if the board sends other reports.
"""
RESYNC: Final = b"::"
"""Two extra colons between a line with a checksum and a line without.

If the board expects no checksums, these two lines could otherwise become a motion command by the
loss of two characters.
"""


class SettingsWriter:
    """Queue of commands that write settings. ``due`` returns the lines to write now.

    ``points``: the set-points that were sent, which show whether the robot drives.
    """

    def __init__(self, settings: LoisEcuSettings, points: SetPoints) -> None:
        self.settings = settings
        self._points = points
        self._in_period = self._answered = False
        self.unanswered_since_s = math.inf
        """Time in s since which the board has sent no GPS date: the last call of ``begin``.

        Infinity once a date has arrived.
        """
        self._queue: deque[tuple[float, Command]] = deque()
        self._others: deque[tuple[float, Command]] = deque()
        """Commands that are not settings, for example for the LED. Each has the earliest time at
        which it may be sent. If the board restarts, the driver still sends these commands."""
        self._rounds_left = 0
        self._round_at_s = math.inf
        self._date_asked_at_s, self._dates_asked = -math.inf, 0
        self._arrivals: deque[float] = deque(maxlen=6)
        self._ticks_at_s = self._ticks_written_at_s = -math.inf
        self._rounds = self._repeated = 0
        self.overwritten = False
        """Whether the driver has written the terminal mode. This also overwrites the setting "left
        short correction", so the driver must write that setting again."""

    @property
    def confirmed(self) -> bool:
        """Whether the settings are confirmed.

        They are confirmed when a GPS date has arrived, and ticks arrive with the period in the
        settings.
        """
        return self._answered and self._in_period

    @property
    def done(self) -> bool:
        """Whether each queued command has been sent as many times as required."""
        return not self._queue and not self._others and not self._rounds_left

    @property
    def ignored(self) -> bool:
        """Whether the board seems to ignore the settings.

        True if the settings are still unconfirmed after the driver has written them ``2 * ROUNDS``
        times, twice as often as usual.
        """
        return self._rounds - self._repeated >= 2 * ROUNDS and not self.confirmed

    @property
    def wake_at(self) -> float:
        """Time at which to call ``due`` next. It is infinity while nothing can be sent."""
        return min(self._settings_at, self._others_at)

    @property
    def _waits(self) -> bool:
        """Whether the driver must wait until the robot stops before it writes more settings.

        While the robot drives, the driver writes at most ``ROUNDS`` rounds: each written gain
        resets the controller of a wheel.
        """
        # A round that has begun is completed: a later command of the round may restore what an
        # earlier one has overwritten.
        return self._points.driving and self._rounds >= ROUNDS and not self._queue

    @property
    def _others_at(self) -> float:
        if not self._others:
            return math.inf
        return max(self._others[0][0], self._points.moved_at_s + AFTER_SET_POINT_S)

    @property
    def _settings_at(self) -> float:
        if self._waits:
            return math.inf
        if self._queue:
            at_s = self._queue[0][0]
        elif self._rounds_left:
            at_s = self._round_at_s
        else:
            return math.inf
        return self.after_set_points(at_s)

    def after_set_points(self, at_s: float) -> float:
        """Return when to write a line that is due at ``at_s``: not directly after a set-point."""
        if self._points.stopped_at_s < math.inf:  # the line may have waited until this Stop
            at_s = max(at_s, self._points.stopped_at_s)
        apart_s = self._points.said_at_s + AFTER_SET_POINT_S
        return max(at_s, min(apart_s, at_s + LONGEST_WAIT_S))

    def begin(self, now: float) -> None:
        """Start to write all settings, after a connection, a restart or a change of settings."""
        self._queue.clear()
        self._arrivals.clear()
        self._rounds_left, self._round_at_s = ROUNDS, now
        self.unanswered_since_s = now
        self._rounds = self._repeated = 0
        self._in_period = self._answered = False

    def repeat(self, now: float) -> None:
        """Write all settings again, as soon as no motion is commanded.

        Call this method if a wheel does not start. The board may lack the low-pass coefficient, or
        expect checksums although the driver sends none.
        """
        if self.done:
            self._rounds_left, self._round_at_s = ROUNDS, now
            self._repeated += ROUNDS

    def write(self, command: Command, now: float) -> None:
        """Queue a command that is not a setting, to be sent ``ROUNDS`` times.

        The new command replaces the queued commands of the same type.
        """
        self._others = deque(one for one in self._others if type(one[1]) is not type(command))
        for count in range(ROUNDS):
            self._queue_other(now + count * ROUND_S, command)

    def _queue_other(self, at_s: float, command: Command) -> None:
        self._others.append((at_s, command))
        self._others = deque(sorted(self._others, key=lambda entry: entry[0]))

    def ask_date(self, now: float) -> None:
        """Request one GPS date.

        Do nothing if dates come periodically, or if a date was requested recently.
        """
        if dates_come_periodically(self.settings) or now < self._date_asked_at_s + DATE_AGAIN_S:
            return
        self._date_asked_at_s = now
        at_s = now + AWAY_S[self._dates_asked % len(AWAY_S)]
        self._dates_asked += 1
        self._queue_other(at_s, SetPeriod(Stream.GPS_DATE, PERIOD_ONCE))

    @property
    def ticks_period_s(self) -> float:
        """Measured period of the tick reports in s. It is infinity until four of them have come."""
        if len(self._arrivals) < 4:
            return math.inf
        return median(after - before for before, after in pairwise(self._arrivals))

    def ticks_came(self, now: float) -> None:
        """Record the arrival of ticks, and check whether they come with the period in the settings.

        While the settings are unconfirmed, also schedule the next round.
        """
        self._arrivals.append(now)
        self._ticks_at_s = now
        wanted = self.settings.periods_ms.get(Stream.TICKS)
        period_s = self.ticks_period_s
        if period_s == math.inf:
            return
        wanted_s = period_s if wanted is None else wanted / 1000
        self._in_period = abs(period_s - wanted_s) <= CONFIRMED_WITHIN * wanted_s
        tried = self._rounds - self._repeated
        if not self.confirmed and self.done and tried < MOST_ROUNDS:
            away_s = AWAY_S[self._rounds % len(AWAY_S)]
            self._rounds_left, self._round_at_s = 1, now + away_s

    def date_came(self) -> None:
        """Record that a GPS date arrived. The date shows that the board obeys requests."""
        if self._rounds and not self._answered:
            self._answered = True
            self.unanswered_since_s = math.inf
            # A request for one date ended the periodic sending. The following rounds restore the
            # period.
            if dates_come_periodically(self.settings):
                self._rounds_left = max(self._rounds_left, ROUNDS - 1)

    def due(self, now: float) -> bytes:
        """Return the lines to write now, possibly none."""
        found: list[Command] = []
        if now >= self._others_at:
            found += _taken(self._others, now)
        if now >= self._settings_at:
            self._begin_round(now)
            found += _taken(self._queue, now)
        if any(map(sets_ticks, found)):
            self._ticks_written_at_s = now
        return b"".join(map(self._encoded, found))

    def _encoded(self, command: Command) -> bytes:
        """Return ``command`` as bytes, with a checksum if the user's setting says so.

        * Stop never has a checksum.
        * A terminal mode may be sent twice, with and without a checksum. A Stop may follow.
        """
        # If two zeros of a Stop with a checksum were lost, the board would read the checksum as a
        # duty.
        if command == outbound.STOP:
            return encode_command(command, with_sum=False)
        line = outbound.lines(command, with_sum=self.settings.with_sum)
        # A board that has just booted obeys only a line with a checksum. A board that expected
        # checksums has ignored the earlier Stops.
        if isinstance(command, SetTerminalMode) and (self._repeated or not self.confirmed):
            stop = [] if self._points.driving else [outbound.STOP]
            line = _both_forms(command) + outbound.lines(*stop, with_sum=False)
        return line

    def _begin_round(self, now: float) -> None:
        """Begin the next round: queue the commands that write all settings.

        Do nothing if no round is left, or if commands of the previous round still wait to be sent.
        """
        if self._queue or not self._rounds_left:
            return
        self._rounds_left -= 1
        self._rounds += 1
        self._round_at_s = max(now, self._round_at_s) + ROUND_S
        at_s = now
        # Another program may have switched the board's checksums off while the robot rolls. The
        # board then ignores a Stop with a checksum. With ``checksum: false``, a Stop follows each
        # terminal mode instead.
        if self.settings.with_sum and self._rounds <= ROUNDS and not self.confirmed:
            self._queue.append((now, outbound.STOP))
            at_s += LINE_S  # a write of its own: its beginning must not meet the end of a setting
        # The board sends no dates after a boot. So each round requests one date.
        periodic = self._answered and dates_come_periodically(self.settings)
        for command in round_commands(
            self.settings,
            self._rounds,
            ticks=self._writes_ticks(now),
            correction=self.overwritten,
            date=not periodic,
        ):
            self._queue.append((at_s, command))
            at_s += LINE_S
        self._round_at_s = max(self._round_at_s, at_s)

    def _writes_ticks(self, now: float) -> bool:
        """Return whether the round of settings that begins now writes the tick reports' period.

        Each write delays the next tick report. Only tick reports at undisturbed intervals can
        confirm the period.
        """
        # If each round wrote a long period, no tick report might come until the rounds are over.
        awaited = self._ticks_written_at_s > self._ticks_at_s > now - TICKS_DUE_S
        return not (awaited and slow_ticks(self.settings)) and (
            self._rounds <= ROUNDS or not self._rounds % 3
        )

    def recovery(self) -> bytes:
        """Return the lines that restore the normal mode of a board that is silent or does not obey.

        The last lines are Stops, so the caller must not call this method while motion is commanded.
        """
        self.overwritten = True
        mode = TerminalMode.HOST if self.settings.with_sum else TerminalMode.HOST_WITHOUT_SUM
        # The mode is sent with and without a checksum, because the board's setting may be
        # unexpected.
        back = SetTerminalMode(mode)
        correction = encode_command(
            left_short_correction(self.settings), with_sum=self.settings.with_sum
        )
        # The board may have obeyed a damaged line earlier, and ignored each Stop after that line.
        stop = outbound.lines(outbound.STOP, outbound.STOP, with_sum=self.settings.with_sum)
        return _both_forms(back) + correction + stop


def _both_forms(mode: SetTerminalMode) -> bytes:
    # A board that expects no checksums stores the surplus characters of the first line until the
    # next ``:``. Without RESYNC, the stored characters and a second line that has lost its ``:``
    # and one more character could form a motion command.
    return encode_command(mode, with_sum=True) + RESYNC + encode_command(mode, with_sum=False)


def _taken(queue: deque[tuple[float, Command]], now: float) -> Iterable[Command]:
    while queue and now >= queue[0][0]:
        yield queue.popleft()[1]
