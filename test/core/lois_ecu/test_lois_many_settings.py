# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Many settings are written to a board that is asked for slow tick reports."""

from dataclasses import replace

import pytest
from lois_bench import FIRMWARE, Bench, configure
from lois_drives import HOST_GAINS

from omnibot_driver.core.events import StateChanged
from omnibot_driver.core.lois_ecu import Setting, Stream
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.opening import LONGEST_SILENCE_S

OTHERS = (Stream.HEADING, Stream.GPS_POSITION, Stream.GPS_TIME, Stream.GPS_DATE)
SLOW = dict.fromkeys((Stream.ODOMETRY, *OTHERS), 1000)
CORRECTIONS = {setting: 1.0 for setting in Setting if setting.name.endswith("CORRECTION")}


@FIRMWARE
@pytest.mark.parametrize("ticks_ms", [300, 400, 500])
def test_ticks_keep_coming_while_many_settings_are_written(firmware: str, ticks_ms: int) -> None:
    """A setting changes while the robot drives. The driver writes all settings in several rounds.

    Each round contains the period of the ticks, which then begins anew on the board. The ticks keep
    coming between the rounds. Otherwise the driver would refuse motion, or regard the board as lost
    and begin the rounds again, without end.
    """
    ours = replace(
        HOST_GAINS,
        written=HOST_GAINS.written | CORRECTIONS,
        periods_ms={Stream.TICKS: ticks_ms, **SLOW},
    )
    bench = Bench(firmware, ours)
    bench.run(10.0)
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    bench.drive_on(0.3, 2.0)
    bench.events.clear()
    configure(bench, replace(ours, low_pass=0.2))
    longest_s = 0.0
    for _ in range(50):
        bench.drive_on(0.3, 0.1)
        longest_s = max(longest_s, bench.now - board._ecu.translation.counts.came_at_s)
    assert longest_s < LONGEST_SILENCE_S
    assert not [event for event in bench.events if isinstance(event, StateChanged)]
