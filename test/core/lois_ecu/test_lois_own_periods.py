# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A user sets nothing: the driver overwrites no setting of the board, and the robot drives.

The board then sends its reports every 400 ms, as after a boot.
"""

import math

import pytest
from lois_bench import FIRMWARE, Bench
from lois_drives import motion, off_m, wrong

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import SetPeriod, Stream, encode_command
from omnibot_driver.core.lois_ecu.messages import PERIOD_OFF
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.lois_ecu import Firmware

STOP, STOP_RPM, LOW_PASS, ONE_DATE = ":0100000000", ":0200000000", ":233f800000", ":0f0000fffe"
"""Beginnings of lines. ``STOP``: Stop as duty 0/0. ``STOP_RPM``: Stop as RPM 0/0. ``LOW_PASS``: the
low-pass gain 1.0. ``ONE_DATE``: a request for one GPS date.
"""
OWN_MS = 400


def lines(bench: Bench) -> set[str]:
    """Return the beginnings of all lines that the driver has written: command byte and payload."""
    text = b"".join(data for _, data in bench.written).decode()
    return {line[:11] for line in text.splitlines()}


def periods_ms(bench: Bench) -> dict[int, int]:
    """Return the board's periods of the ticks and of the odometry."""
    return {code: bench.board._timers[code].period_ms for code in (Stream.TICKS, Stream.ODOMETRY)}


def error(bench: Bench) -> tuple[float, float]:
    """Return the error of the odometry's position, and its standard deviation, in m."""
    truth, last = bench.board.truth, bench.odometry[-1]
    true = Pose(truth.x_m, truth.y_m, truth.yaw_rad)
    return true.way_to(last.pose).way_m, math.sqrt(last.covariance.xx + last.covariance.yy)


@FIRMWARE
def test_nothing_is_written_except_stop_the_low_pass_and_requests_for_a_date(firmware: str) -> None:
    """By default, the driver writes only stops, the low-pass coefficient and GPS date requests.

    The board keeps its own periods. After a restart of the board, the driver writes the low-pass
    coefficient again.
    """
    bench = Bench(firmware, own_periods=True)
    bench.run(8.0)
    assert lines(bench) == {STOP, STOP_RPM, LOW_PASS, ONE_DATE}
    assert periods_ms(bench) == {Stream.TICKS: OWN_MS, Stream.ODOMETRY: OWN_MS}
    bench.drive_on(0.3, 2.5)
    bench.run(3.0)
    bench.written.clear()
    bench.board.reboot()
    bench.run(8.0)
    assert {LOW_PASS} <= lines(bench) <= {STOP, STOP_RPM, LOW_PASS, ONE_DATE}
    assert periods_ms(bench) == {Stream.TICKS: OWN_MS, Stream.ODOMETRY: OWN_MS}


@FIRMWARE
def test_a_drive_adds_only_set_points(firmware: str) -> None:
    """The robot drives forward, backward and in place. The driver writes only set-points."""
    bench = Bench(firmware, own_periods=True)
    bench.run(4.0)
    bench.written.clear()
    for vx, rate in ((0.3, 0.0), (-0.2, 0.1), (0.0, 0.5)):
        for _ in range(20):
            bench.session.command_twist(BodyTwist(vx, 0.0, rate), bench.now)
            bench.settle()
            bench.run(0.1)
    bench.run(4.0)
    assert {line[:3] for line in lines(bench) - {LOW_PASS, ONE_DATE}} == {":01", ":02"}
    assert not [text for text in bench.notices if "motion monitor" in text]


@FIRMWARE
def test_the_rate_of_the_odometry_is_that_of_the_board(firmware: str) -> None:
    """The diagnostics show the measured rate, because no period is set. It is about 2.5 Hz."""
    bench = Bench(firmware, own_periods=True)
    bench.run(2.0)
    assert bench.session.board.figures.rates_hz == {"Odometry": pytest.approx(2.45, abs=0.1)}


@FIRMWARE
def test_a_board_without_ticks_gives_advice(firmware: str) -> None:
    """If the board sends no ticks, the driver advises once to set ``ticks_period``."""
    bench = Bench(firmware, own_periods=True)
    bench.run(8.0)
    assert not any("`ticks_period`" in notice for notice in bench.notices)
    off = SetPeriod(Stream.TICKS, PERIOD_OFF)
    for _ in range(5):
        bench.board.receive(encode_command(off, with_sum=True))
        bench.run(0.1)
    bench.run(8.0)
    assert sum("set `ticks_period`" in notice for notice in bench.notices) == 1


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("name", ["curve left", "place left"])
def test_a_curve_and_a_turn_are_within_3_sigma(firmware: Firmware, name: str) -> None:
    """The robot drives a curve, or turns in place. Its wheels have the wrong size.

    The error of the pose is within 3 sigma.
    """
    one = motion(wrong(firmware, 1000), name, own_periods=True)
    assert one.sigmas < 3.0
    assert off_m(one) < 0.1 * max(one.way_m, 2.0)


@FIRMWARE
def test_a_stop_is_proved_by_the_ticks_and_then_the_line_is_quiet(firmware: str) -> None:
    """After the last command, ticks prove the standstill within 2.5 s; later, the line is quiet.

    Without this proof, the driver would repeat Stop for 5 s.
    """
    bench = Bench(firmware, own_periods=True)
    bench.run(4.0)
    bench.drive_on(0.3, 2.5)
    bench.session.command_twist(BodyTwist(0.0, 0.0, 0.0), bench.now)
    bench.run_until(lambda: bench.session._safety._policy.proof.proved, 2.5)
    assert bench.robot.stands
    bench.run(2.5)  # RPM 0/0 follows 2 s after a Stop
    bench.written.clear()
    bench.run(2.0)
    assert not bench.written


@pytest.mark.slow
@FIRMWARE
def test_a_restart_in_a_forward_drive_stops_the_robot_and_odom(firmware: str) -> None:
    """After a restart in a forward drive, the driver stops the robot until a new command arrives.

    The position is right within 0.2 m.
    """
    bench = Bench(firmware, own_periods=True)
    bench.run(4.0)
    bench.drive_on(0.3, 4.0)
    bench.board.reboot()
    bench.run(5.0)
    assert bench.robot.stands
    assert bench.session.board._ecu.translation.counts.restarts == 1  # type: ignore[attr-defined]
    assert error(bench)[0] < 0.2
    bench.drive_on(0.3, 2.5)
    assert not bench.robot.stands


@pytest.mark.slow
@FIRMWARE
def test_a_reset_is_confirmed_although_the_first_one_is_lost(firmware: str) -> None:
    """The user resets the board after a drive, and the first reset is lost.

    The driver repeats the reset until the ticks restart from zero.
    """
    bench = Bench(firmware, own_periods=True)
    bench.drive_on(0.3, 2.5)
    bench.run(2.0)
    assert bench.board.wheels[0].ticks > 2
    bench.hears = False
    bench.session.request(Request.RESET, "token", bench.now)
    bench.settle()
    bench.hears = True
    bench.run_until(lambda: bool(bench.answers))
    assert bench.answers[-1].message == "the board was reset"
    assert [wheel.ticks for wheel in bench.board.wheels] == [0, 0]


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("stall_s", [0.9, 2.5])
def test_a_stall_of_the_driver_is_within_3_sigma(firmware: str, stall_s: float) -> None:
    """The driver stalls while the robot drives, and then reads all reports at once.

    The robot stops, and the error of the position is below 3 sigma or 6 cm, whichever is larger.
    """
    bench = Bench(firmware, own_periods=True)
    bench.run(4.0)
    bench.drive_on(0.3, 2.5)
    bench.stall(stall_s)
    bench.run(3.0)
    error_m, sigma_m = error(bench)
    assert bench.robot.stands
    assert error_m < max(0.06, 3.0 * sigma_m)
