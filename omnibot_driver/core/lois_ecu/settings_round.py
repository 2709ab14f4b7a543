# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands of one round that writes all settings to a LOIS ECU, and their order.

``opening`` decides when a round begins.
"""

from collections.abc import Iterable, Iterator
from typing import Final

from omnibot_driver.core.lois_ecu.messages import (
    PERIOD_OFF,
    PERIOD_ONCE,
    Command,
    SetPeriod,
    SetTerminalMode,
    Setting,
    Stream,
    TerminalMode,
    WriteSetting,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

ROUNDS: Final = 5
FAST_TICKS_MS: Final = 200
"""Limit for the period of the tick reports, in ms.

Each write delays the next tick report, so only some of the first ``ROUNDS`` settings rounds write a
longer period.
"""
BOOT_LEFT_SHORT_CORRECTION: Final = 1.0761719
"""Value of the setting LEFT_SHORT_CORRECTION in the public firmware after a boot."""


def slow_ticks(settings: LoisEcuSettings) -> bool:
    """Return whether the period of the tick reports is longer than ``FAST_TICKS_MS``.

    Only some settings rounds write such a period, because each write delays the next tick report.
    """
    return settings.periods_ms.get(Stream.TICKS, 0) > FAST_TICKS_MS


def dates_come_periodically(settings: LoisEcuSettings) -> bool:
    """Return whether the user has set a period of the GPS date.

    In this case, a request for one date is harmful: it ends the periodic sending of dates.
    """
    return settings.periods_ms.get(Stream.GPS_DATE, PERIOD_OFF) < PERIOD_ONCE


def sets_ticks(command: Command) -> bool:
    """Return whether ``command`` sets the period of the tick reports."""
    return isinstance(command, SetPeriod) and command.stream is Stream.TICKS


def left_short_correction(settings: LoisEcuSettings) -> WriteSetting:
    """Return the command that writes LEFT_SHORT_CORRECTION, which the terminal mode overwrites.

    If the user has not set it, the command writes the value that the board has after a boot.
    """
    setting = Setting.LEFT_SHORT_CORRECTION
    return WriteSetting(setting, settings.written.get(setting, BOOT_LEFT_SHORT_CORRECTION))


def round_commands(
    settings: LoisEcuSettings, number: int, *, ticks: bool, correction: bool, date: bool
) -> list[Command]:
    """Return the commands of a round of settings, in an order that changes from round to round.

    * ``number``: number of the round, from 1.
    * ``ticks``: whether the round writes the period of the tick reports.
    * ``correction``: whether the setting LEFT_SHORT_CORRECTION may have been overwritten.
    * ``date``: whether the round requests a date.
    """
    rest = list(_writes(settings, ticks=ticks, correction=correction))
    # The board cannot receive while it sends reports. With a constant order, it could miss the same
    # line in each round.
    place = number * len(rest) // ROUNDS % len(rest)
    after, before = _repeating(rest[place:], settings), _repeating(rest[:place], settings)
    # This request comes last: the board answers at once, and would miss the next line.
    asked = [SetPeriod(Stream.GPS_DATE, PERIOD_ONCE)] if date else []
    if settings.with_sum:
        return [*after, *before, *asked]
    # The mode overwrites the left short correction, which could be lost with a single line.
    mode = SetTerminalMode(TerminalMode.HOST_WITHOUT_SUM)
    again = left_short_correction(settings)
    return [mode, again, *after, again, *before, again, *asked]


def _writes(settings: LoisEcuSettings, *, ticks: bool, correction: bool) -> Iterator[Command]:
    """Yield the commands that write settings, except the terminal mode."""
    if correction or not settings.with_sum:
        yield left_short_correction(settings)
    yield WriteSetting(Setting.RPM_LOW_PASS, settings.low_pass)
    for stream, period_ms in settings.periods_ms.items():
        if stream is not Stream.TICKS or ticks:
            yield SetPeriod(stream, period_ms)
    for setting, number in settings.written.items():
        yield WriteSetting(setting, number)


def _repeating(commands: Iterable[Command], settings: LoisEcuSettings) -> Iterator[Command]:
    """Yield ``commands``. A command for a long period of the tick reports is yielded twice.

    The board may lose a line, and the driver writes a long period less often than other settings.
    """
    for command in commands:
        yield command
        if sets_ticks(command) and slow_ticks(settings):
            yield command
