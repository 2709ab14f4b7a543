# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of IMU biases, gyro calibration and IMU figures with a session and a simulated board."""

import math

import pytest
from session_bench import Bench

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuCorrection, ImuEstimate
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.simulator.omnibot import BoardSettings

PLANTED_DPS = (1.5, -2.0, 3.0)
PLANTED = tuple(map(math.radians, PLANTED_DPS))


def running(**settings: object) -> Bench:
    bench = Bench(BoardSettings(**settings))  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("imu_only" if settings.get("imu_only") else "nominal")
    bench.run(1.5)
    return bench


def calibrated(bench: Bench, seconds: float = 4.6) -> RequestDone:
    bench.session.calibrate_gyro("token", bench.now)
    before = len(bench.events)
    bench.run(seconds)
    (done,) = (event for event in bench.events[before:] if isinstance(event, RequestDone))
    assert done.token == "token"
    return done


def last(bench: Bench) -> ImuEstimate:
    return [event for event in bench.events if isinstance(event, ImuEstimate)][-1]


@pytest.mark.parametrize("imu_only", [False, True])
def test_a_calibration_finds_what_was_planted_and_takes_it_off(imu_only: bool) -> None:
    """The gyro has a bias, and the user calibrates it in nominal or IMU-only mode.

    The published rates are then about zero.
    """
    bench = running(gyro_bias_dps=PLANTED_DPS, imu_only=imu_only)
    assert last(bench).angular_velocity == pytest.approx(PLANTED, abs=0.006)
    assert calibrated(bench).success
    assert bench.session.gyro_bias == pytest.approx(PLANTED, abs=5e-4)
    assert last(bench).angular_velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.006)


def test_a_calibration_during_a_reset_is_refused_with_that_reason() -> None:
    """The user calibrates the gyro during a reset, when the board sends nothing.

    The driver refuses. It gives the reset as the reason, not a silent board.
    """
    bench = running()
    bench.session.request(Request.RESET, "reset", bench.now)
    bench.settle()
    with pytest.raises(RequestRefused, match="the board is being reset; call again when it runs"):
        bench.session.calibrate_gyro("token", bench.now)


def test_nobody_calibrates_a_robot_that_is_commanded_to_move() -> None:
    """The driver refuses to calibrate while motion is commanded.

    A motion command that arrives during a calibration ends it.
    """
    bench = running()
    bench.session.command_twist(BodyTwist(0.3, 0.0, 0.0), bench.now)
    with pytest.raises(RequestRefused, match="commanded by cmd_vel; end these commands"):
        bench.session.calibrate_gyro("token", bench.now)
    bench.run(2.0)
    bench.session.calibrate_gyro("token", bench.now)
    bench.session.command_twist(BodyTwist(0.0, 0.0, 0.0), bench.now)
    bench.run(0.5)
    bench.session.command_twist(BodyTwist(0.3, 0.0, 0.0), bench.now)
    bench.settle()
    done = bench.events[-1]
    assert isinstance(done, RequestDone)
    assert not done.success
    assert "a motion command arrived" in done.message


def test_a_robot_that_rolls_by_itself_is_not_calibrated() -> None:
    """The robot rolls out during a calibration, so its wheels turn. The calibration fails."""
    bench = running()
    bench.session.command_twist(BodyTwist(0.0, 0.0, 0.5), bench.now)
    bench.run(0.4)
    bench.session.estop(True, bench.now)
    done = calibrated(bench)
    assert not done.success
    assert "its wheels turn" in done.message
    assert bench.session.gyro_bias == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("state", ["disconnected", "paused"])
def test_without_measurements_a_calibration_is_refused_at_once(state: str) -> None:
    """The port is closed or the board is paused. The driver refuses to calibrate."""
    bench = running()
    if state == "paused":
        bench.ask(Request.PAUSE, 5.0)
    else:
        bench.close()
    with pytest.raises(RequestRefused, match="call again"):
        bench.session.calibrate_gyro("token", bench.now)


def test_one_calibration_at_a_time() -> None:
    """A second calibration is requested during the first one.

    It is refused, and the first continues.
    """
    bench = running()
    bench.session.calibrate_gyro("first", bench.now)
    with pytest.raises(RequestRefused, match="under way"):
        bench.session.calibrate_gyro("second", bench.now)
    bench.run(2.2)
    assert [event.token for event in bench.events if isinstance(event, RequestDone)] == ["first"]


@pytest.mark.parametrize("how", ["silence", "loss"])
def test_a_calibration_is_answered_in_time_whatever_happens(how: str) -> None:
    """The board becomes silent during a calibration, or the port is lost.

    The user gets an answer.
    """
    bench = running()
    bench.session.calibrate_gyro("token", bench.now)
    bench.run(1.0)
    if how == "silence":
        bench.speaks = False
        bench.run(3.6)
    else:
        bench.close()
    (done,) = (event for event in bench.events if isinstance(event, RequestDone))
    assert not done.success
    assert "again" in done.message


def test_a_silent_board_that_nobody_is_to_start_is_woken_up_for_the_answer() -> None:
    """The board becomes silent during a calibration, and the driver has nothing to send.

    The driver still wakes up in time to answer the calibration.
    """
    bench = Bench(BoardSettings(running=True), run=False)
    bench.open()
    bench.run(1.0)
    bench.session.calibrate_gyro("token", bench.now)
    began, bench.speaks = bench.now, False
    bench.run(3.6)
    assert bench.now < bench.session.wake_at <= began + 4.5
    bench.run(1.0)
    assert any(isinstance(event, RequestDone) for event in bench.events)


def test_a_change_of_settings_does_not_replace_the_bias() -> None:
    """The user calibrates the gyro and then changes settings. The calibrated gyro bias stays.

    A new accelerometer bias is applied.
    """
    bench = running(gyro_bias_dps=PLANTED_DPS)
    calibrated(bench)
    found = bench.session.gyro_bias
    bench.configure(imu=ImuCorrection())
    assert bench.session.gyro_bias == found
    bench.configure(imu=ImuCorrection(gyro_bias=(0.1, 0.2, 0.3), accel_bias=(1.0, 2.0, 3.0)))
    assert bench.session.gyro_bias == found
    before = last(bench)
    bench.run(0.1)
    change = [a - b for a, b in zip(last(bench).specific_force, before.specific_force, strict=True)]
    assert change == pytest.approx((-1.0, -2.0, -3.0), abs=0.3)


@pytest.mark.slow
def test_the_bias_is_refined_at_standstill_only_where_it_is_wanted() -> None:
    """The driver estimates the gyro bias only at rest, and only while ``auto_gyro_bias`` is on.

    After 15 s at rest, the estimate is half of the true bias.
    """
    bench = running(gyro_bias_dps=PLANTED_DPS)
    bench.run(15.0)
    assert bench.session.gyro_bias == (0.0, 0.0, 0.0)
    bench.configure(imu=ImuCorrection(auto_gyro_bias=True))
    bench.run(15.0)
    halfway = bench.session.gyro_bias
    assert halfway == pytest.approx([0.5 * value for value in PLANTED], rel=0.2)
    for _ in range(20):
        bench.session.command_twist(BodyTwist(0.0, 0.0, 0.4), bench.now)
        bench.run(0.25)
    assert bench.session.gyro_bias == pytest.approx(halfway, abs=0.004)


def test_a_wrong_range_is_told_once_with_the_right_one() -> None:
    """At rest the accelerometer shows half of gravity, as if its range were wrong by a factor of 2.

    One notice advises to set ``accel_range`` to 4.
    """
    bench = running()
    gravity = bench.session.figures(bench.now).imu.gravity_mps2
    assert gravity == pytest.approx(9.80665, rel=0.01)
    bench.configure(imu=ImuCorrection(accel_bias=(0.0, 0.0, -4.9)))
    bench.run(4.0)
    told = [event.text for event in bench.events if isinstance(event, Notice)]
    assert [text for text in told if "accel_range" in text] == [
        text for text in told if text.endswith("set `accel_range` to 4")
    ]
    assert sum("accel_range" in text for text in told) == 1
    assert "accel_range" in bench.session.figures(bench.now).imu.advice


def test_the_figures_count_what_happened() -> None:
    """``Session.figures`` counts readings, gaps, losses, restarts and limited commands.

    It also counts equal readings in a row, which show that a sensor is stuck.
    """
    bench = running(gyro_stuck=(5, 5, 5))
    figures = bench.session.figures(bench.now)
    assert figures.state == "nominal"
    assert figures.tally.same_rate > 100
    assert figures.tally.same_force < 5
    assert figures.tally.imu == pytest.approx(4 * figures.tally.displacements, abs=6)
    assert figures.tally.gaps == figures.board.faults == figures.tally.restarts == 0
    bench.speaks = False
    bench.run(0.2)
    bench.speaks = True
    bench.session.command_twist(BodyTwist(5.0, 0.0, 0.0), bench.now)
    bench.run(0.2)
    figures = bench.session.figures(bench.now)
    assert (figures.tally.gaps, figures.tally.last_gap) == (1, 5)
    assert figures.tally.lost_displacements == 5
    assert (figures.commands.source, figures.commands.limited) == ("cmd_vel", 1)
    assert figures.commands.age_s == pytest.approx(0.2)
    bench.board.reboot()
    bench.run(5.0)
    figures = bench.session.figures(bench.now)
    assert figures.tally.restarts == 1
    assert figures.commands.source is None


def test_a_calibration_ends_when_the_estop_is_latched() -> None:
    """If the e-stop is latched during a calibration, the calibration fails.

    A calibration that begins later, under the latched e-stop, succeeds.
    """
    bench = running()
    bench.session.calibrate_gyro("token", bench.now)
    bench.run(0.5)
    bench.session.estop(True, bench.now)
    bench.run(0.1)
    (done,) = [event for event in bench.events if isinstance(event, RequestDone)]
    assert not done.success
    assert "e-stop was latched" in done.message
    bench.session.calibrate_gyro("again", bench.now)
    bench.run(3.0)
    assert [e.success for e in bench.events if isinstance(e, RequestDone)] == [False, True]
