# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The rate ``odom_rate_hz`` at which the driver of a LOIS ECU publishes odometry."""

import pytest
from any_board import TICK_S, LoisRobot
from lois_bench import FIRMWARE, Bench

from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.readings import OdometryReading

PERIOD_S = 0.05


def published(board: LoisEcuBoard, now: float) -> bool:
    """Advance the board's time to ``now``. Return whether this has published odometry."""
    return any(isinstance(reading, OdometryReading) for reading in board.elapse(now))


@FIRMWARE
@pytest.mark.parametrize("delay_s", [0.052, 0.1201, 10.0])
def test_odometry_that_is_late_is_not_published_twice_at_once(
    firmware: str, delay_s: float
) -> None:
    """Odometry is published late. The next odometry is published one period later, not at once."""
    bench = Bench(firmware)
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    now = bench.now
    while not published(board, now):
        now += 1e-3
    now += delay_s
    assert published(board, now)
    assert not published(board, now + 1e-5)


@FIRMWARE
def test_the_first_odometry_is_published_once(firmware: str) -> None:
    """The driver publishes the first odometry only once, and the next one a period later."""
    lois = LoisRobot(firmware)
    board, now, times = LoisEcuBoard(LoisEcuSettings()), 1000.0, []
    board.connect()
    while len(times) < 2:
        now += TICK_S
        for _, data in lois.advance():
            board.receive(data, now)
        for late_s in (0.0, 1e-5):
            if published(board, now + late_s):
                times.append(now + late_s)
    assert times[1] - times[0] > PERIOD_S - TICK_S
