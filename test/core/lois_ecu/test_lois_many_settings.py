# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Many settings are written to a board that is asked for slow tick reports."""

from dataclasses import replace

import pytest
from lois_bench import FIRMWARE, Bench, configure
from lois_drives import HOST_GAINS

from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.lois_ecu import Setting, Stream
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.codec import encode_command
from omnibot_driver.core.lois_ecu.messages import PERIOD_OFF, SetPeriod
from omnibot_driver.core.lois_ecu.opening import ROUNDS, SettingsWriter
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

OTHERS = (Stream.HEADING, Stream.GPS_POSITION, Stream.GPS_TIME, Stream.GPS_DATE)
SLOW = dict.fromkeys((Stream.ODOMETRY, *OTHERS), 1000)
CORRECTIONS = {setting: 1.0 for setting in Setting if setting.name.endswith("CORRECTION")}


ALL = replace(HOST_GAINS, written={**HOST_GAINS.written, **CORRECTIONS})


def writer_of(bench: Bench) -> SettingsWriter:
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    return board._ecu._upkeep.writer


def longest_gap_s(bench: Bench, ours: LoisEcuSettings) -> float:
    """Change a setting while the robot drives, and return the longest time without ticks, in s."""
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    bench.drive_on(0.3, 2.0)
    bench.events.clear()
    configure(bench, replace(ours, low_pass=0.2))
    longest_s = 0.0
    for _ in range(50):
        bench.drive_on(0.3, 0.1)
        longest_s = max(longest_s, bench.now - board._ecu.translation.counts.came_at_s)
    return longest_s


@FIRMWARE
@pytest.mark.parametrize("ticks_ms", [300, 400, 500])
def test_ticks_keep_coming_while_many_settings_are_written(firmware: str, ticks_ms: int) -> None:
    """A setting changes in a drive, and the driver writes all settings.

    The settings are finally confirmed while the robot still drives. No tick report is so late that
    the driver regards the board as lost.
    """
    ours = replace(ALL, periods_ms={Stream.TICKS: ticks_ms, **SLOW})
    bench = Bench(firmware, ours)
    bench.run(10.0)
    assert longest_gap_s(bench, ours) < bench.session.board.traits.unheard_s
    assert not [event for event in bench.events if isinstance(event, StateChanged)]
    assert writer_of(bench).confirmed


def periods_written(bench: Bench, ticks_ms: int) -> int:
    """Set the period of the ticks, and return how many times the driver has written it."""
    before = len(bench.written)
    configure(bench, LoisEcuSettings(periods_ms={Stream.TICKS: ticks_ms}))
    bench.run(3.0)
    line = encode_command(SetPeriod(Stream.TICKS, ticks_ms))
    return sum(data.count(line) for _, data in bench.written[before:])


def test_a_long_period_is_written_four_times() -> None:
    """The driver writes a period of 0.5 s for the tick reports at least four times.

    The board's own period, 0.4 s, is so close to 0.5 s that the driver cannot detect whether the
    board has received the setting.
    """
    bench = Bench("firmware", own_periods=True)
    bench.run(5.0)
    assert periods_written(bench, 500) >= 4


def test_a_period_is_written_although_no_ticks_come() -> None:
    """The driver writes the period of the tick reports although another program turned them off."""
    bench = Bench("firmware", own_periods=True)
    bench.run(1.0)
    bench.robot.receive(encode_command(SetPeriod(Stream.TICKS, PERIOD_OFF)), bench.now, 0)
    bench.run(2.0)
    assert periods_written(bench, 500) >= 2 * ROUNDS
