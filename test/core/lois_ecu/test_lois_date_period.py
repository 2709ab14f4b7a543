# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the period with which the board sends the GPS date, and of requests for one date.

The driver requests one date to confirm the board's settings. This request ends the periodic dates.
"""

import pytest
from lois_bench import FIRMWARE, Bench

from omnibot_driver.core.lois_ecu import SetPeriod, Stream, encode_command
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


class DeafBench(Bench):
    """A bench that loses one of the lines that set the period of the date.

    ``nth``: number of the lost line, counted from 1; 0: no line is lost.
    """

    def __init__(self, firmware: str, period_ms: int, nth: int = 0) -> None:
        self.lost = encode_command(SetPeriod(Stream.GPS_DATE, period_ms))
        self.nth, self.sent = nth, 0
        super().__init__(firmware, LoisEcuSettings(periods_ms={Stream.GPS_DATE: period_ms}))
        self.run(4.0)

    def settle(self) -> None:
        for channel, data in self.session.take_output(self.now):
            for line in data.splitlines(keepends=True):
                self.sent += line == self.lost
                if line != self.lost or self.sent != self.nth:
                    self.robot.receive(line, self.now, channel)
        self.events += self.session.take_events()


@pytest.mark.slow
@FIRMWARE
def test_a_date_period_survives_the_loss_of_its_last_line(firmware: str) -> None:
    """One of the lines that set the period of the date is lost (each line in turn).

    The board still has the right period, because the driver sets it several times.
    """
    times = DeafBench(firmware, 500).sent
    for nth in range(1, times + 1):
        bench = DeafBench(firmware, 500, nth)
        assert bench.board._timers[Stream.GPS_DATE].period_ms == 500, nth


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("period_ms", [200, 1000, 30000])
def test_a_board_with_any_date_period_confirms_its_settings(firmware: str, period_ms: int) -> None:
    """The driver requests a date, which confirms the settings, but also ends the periodic dates.

    Afterwards, the board again sends dates with the period that the user has set.
    """
    bench = DeafBench(firmware, period_ms)
    assert isinstance(bench.session.board, LoisEcuBoard)
    assert bench.session.board._ecu._upkeep.writer.confirmed
    assert bench.board._timers[Stream.GPS_DATE].period_ms == period_ms
