# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The connection is lost while a LOIS robot drives.

The board has no watchdog, so the wheels keep turning.
"""

import math

import pytest
from lois_bench import FIRMWARE, Bench


def lost_line(firmware: str, vx: float, seconds: float, *, reopened: bool) -> Bench:
    """Return a bench after a drive with a lost connection, a second drive, and a stop.

    * ``vx``: speed of both drives, in m/s.
    * ``seconds``: how long the connection is lost, in s.
    * ``reopened``: whether the port is closed and opened again.
    """
    bench = Bench(firmware)
    bench.drive_on(vx, 4.0)
    bench.speaks = bench.hears = False
    if reopened:
        bench.close()
    bench.run(seconds)
    bench.speaks = bench.hears = True
    if reopened:
        bench.open()
    bench.run(3.0)
    bench.drive_on(vx, 2.0)
    bench.run(1.5)
    return bench


def off_by(bench: Bench) -> tuple[float, float]:
    """Return the error of the estimated position and its standard deviation, both in m."""
    estimate, truth = bench.odometry[-1], bench.board.truth
    error_m = math.hypot(estimate.pose.x_m - truth.x_m, estimate.pose.y_m - truth.y_m)
    return error_m, math.sqrt(estimate.covariance.xx + estimate.covariance.yy)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "vx", "seconds", "reopened"),
    [
        ("firmware", 0.3, 4.0, True),
        ("firmware", -0.3, 6.0, False),
        ("documented", 0.3, 6.0, False),
        ("documented", -0.3, 4.0, True),
    ],
)
def test_what_the_wheels_did_in_a_silence_is_known_or_in_the_covariance(
    firmware: str, vx: float, seconds: float, reopened: bool
) -> None:
    """After a lost connection in a drive, the error of the position is within 3 sigma.

    No Stop arrives during the loss, so the robot drives on for metres.
    """
    error_m, sigma_m = off_by(lost_line(firmware, vx, seconds, reopened=reopened))
    assert error_m <= 3.0 * sigma_m


@pytest.mark.slow
@pytest.mark.parametrize(("firmware", "seconds"), [("firmware", 3.0), ("documented", 1.0)])
def test_ticks_that_went_on_counting_tell_the_way_of_a_silence(
    firmware: str, seconds: float
) -> None:
    """Ticks that the board counts while the connection is lost show the driven distance.

    The position is right within a tenth of this distance.
    """
    bench = lost_line(firmware, 0.3, seconds, reopened=False)
    error_m, _ = off_by(bench)
    assert error_m <= 0.1 * bench.robot.way_m


@pytest.mark.slow
@FIRMWARE
def test_the_covariance_grows_while_the_board_is_silent(firmware: str) -> None:
    """The board is silent, and the robot drives on. The covariance grows meanwhile.

    So the error of the position stays within 3 sigma.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 4.0)
    bench.speaks = bench.hears = False
    before = bench.robot.way_m
    bench.run(1.4)
    error_m, sigma_m = off_by(bench)
    assert bench.robot.way_m - before > 0.3
    assert error_m <= 3.0 * sigma_m
