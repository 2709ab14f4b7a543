"""What a report says of drives in which a trouble was planted, and of one without."""

import numpy as np
import pytest
from drives import DELAY_S, Drive

from omnibot_driver.tools.report.findings import Finding, Level, headline
from omnibot_driver.tools.report.judge import judge


def said(drive: Drive, subject: str, *words: str) -> Finding:
    """The one finding of this subject that has these words."""
    (found,) = [
        finding
        for finding in judge(drive.log())
        if finding.subject == subject and all(word in finding.text for word in words)
    ]
    return found


def troubles(drive: Drive) -> list[Finding]:
    return [finding for finding in judge(drive.log()) if finding.level > Level.NOTE]


@pytest.fixture
def drive() -> Drive:
    return Drive()


def test_a_healthy_drive_is_called_healthy(drive: Drive) -> None:
    """With figures, and nothing to do."""
    findings = judge(drive.log())
    assert not troubles(drive)
    assert headline(findings) == "Healthy."
    assert not any(finding.advice for finding in findings)
    assert "100.00 Hz" in said(drive, "Timing", "imu/data_raw comes").text
    assert "9.80" in said(drive, "IMU", "Gravity").text
    assert "vx 1.0" in said(drive, "Commands", "followed").text


def test_a_gap_is_told_with_its_place_and_what_is_missing(drive: Drive) -> None:
    """15 readings from 6 s on."""
    drive.imu.drop(6.0, 6.15)
    (gap,) = troubles(drive)
    assert gap.level is Level.WARN
    assert "1 gap, 15 messages" in gap.text
    assert "at 6.0 s" in gap.text
    assert "driver counts no loss" in gap.advice


def test_a_loss_that_the_driver_counts_is_laid_to_the_line(drive: Drive) -> None:
    """The counts in /diagnostics grow."""
    drive.imu.drop(6.0, 6.1)
    for at_s, *_, values in drive.statuses:
        values["IMU frames lost"] = "7" if at_s < 7.0 else "17"
    assert "counts 10 lost on the line" in said(drive, "Gaps", "imu/data_raw").advice


def test_a_long_gap_is_worse(drive: Drive) -> None:
    """More than half a second without odometry."""
    drive.odom.drop(8.0, 9.0)
    assert said(drive, "Gaps", "odom", "1 gap").level is Level.BAD


def test_a_pause_is_no_gap(drive: Drive) -> None:
    """The state accounts for it."""
    drive.states += [(16.9, "paused"), (18.0, "nominal")]
    drive.imu.drop(17.0, 18.0)
    drive.odom.drop(17.0, 18.0)
    assert not troubles(drive)
    assert "paused for 1.1 s" in said(drive, "State", "ominal").text


def test_a_lost_board_is_told_and_is_no_gap_besides(drive: Drive) -> None:
    """State and stream are two words for the same."""
    drive.states += [(17.0, "connecting"), (18.0, "nominal")]
    drive.imu.drop(16.9, 18.0)
    drive.odom.drop(16.9, 18.0)
    assert [finding.subject for finding in troubles(drive)] == ["State"]


def test_the_end_of_the_driver_is_no_lost_board(drive: Drive) -> None:
    """It says disconnected last, and then nothing any more."""
    drive.states.append((19.5, "disconnected"))
    assert not troubles(drive)
    assert "ended at 19.5 s" in said(drive, "State", "driver").text


def test_stamps_that_leap_and_come_back_are_no_gap(drive: Drive) -> None:
    """20 ms ahead, and slowly back, as of a driver that was kept from reading."""
    drive.imu.stamp_s[800:850] += np.linspace(0.020, 0.0, 50)
    drive.imu.late_s = drive.imu.late_s + 0.05
    (leap,) = troubles(drive)
    assert "leapt 1 time, by up to 20 ms, first at 8.0 s" in leap.text
    assert "no gap" in said(drive, "Gaps", "imu/data_raw").text


def test_uneven_stamps_are_noticed(drive: Drive) -> None:
    """Stamps that are arrival times, say."""
    drive.imu.stamp_s = drive.imu.stamp_s + np.random.default_rng(2).uniform(0, 4e-3, 2000)
    (jitter,) = troubles(drive)
    assert jitter.subject == "Timing"
    assert "steps between stamps of imu/data_raw vary" in jitter.text


def test_a_wrong_rate_is_no_gap_but_a_wrong_rate(drive: Drive) -> None:
    """Every other reading."""
    for name in ("stamp_s", "values", "late_s"):
        setattr(drive.imu, name, getattr(drive.imu, name)[::2])
    found = [finding.text for finding in troubles(drive) if finding.subject in ("Timing", "Gaps")]
    assert found == ["imu/data_raw comes at 50.00 Hz; it should be 100."]


def test_stamps_that_go_back_are_wrong(drive: Drive) -> None:
    """Time does not."""
    drive.odom.stamp_s[100:] -= 0.2
    drive.odom.late_s[100:] += 0.2
    assert said(drive, "Timing", "1 stamp of odom").level is Level.BAD


def test_messages_that_wait_are_told_with_the_cure(drive: Drive) -> None:
    """A timer of 16 ms in the adapter."""
    drive.imu.late_s = drive.imu.late_s + np.remainder(-drive.imu.stamp_s, 0.016)
    late = said(drive, "Timing", "imu/data_raw arrives")
    assert late.level is Level.WARN
    assert "latency_timer" in late.advice


def test_a_recorder_with_another_clock_is_told_once(drive: Drive) -> None:
    """Half a minute, for every topic."""
    drive.imu.late_s = drive.imu.late_s + 30.0
    (clock,) = troubles(drive)
    assert "30 s after its stamp" in clock.text


@pytest.mark.parametrize(
    ("factor", "advice"), [(0.5, "2 times"), (0.25, "4 times"), (0.8, "Check")]
)
def test_a_wrong_gravity_is_told_with_the_range_that_explains_it(
    drive: Drive, factor: float, advice: str
) -> None:
    """An accelerometer set to another range reads a half or a quarter."""
    drive.imu.values[:, 3:] *= factor
    gravity = said(drive, "IMU", "Gravity")
    assert gravity.level is Level.BAD
    assert advice in gravity.advice


def test_a_tilt_at_rest_is_told(drive: Drive) -> None:
    """Ten degrees."""
    tilt = np.radians(10.0)
    force = drive.imu.values[:, 3:].copy()
    drive.imu.values[:, 3] = force[:, 0] * np.cos(tilt) + force[:, 2] * np.sin(tilt)
    drive.imu.values[:, 5] = force[:, 2] * np.cos(tilt) - force[:, 0] * np.sin(tilt)
    assert "10.0°" in troubles(drive)[0].text


def test_a_biased_gyro_is_told_with_the_service_that_mends_it(drive: Drive) -> None:
    """0.05 rad/s about y."""
    drive.imu.values[:, 1] += 0.05
    (bias,) = troubles(drive)
    assert "+0.05" in bias.text
    assert "about y" in bias.text
    assert "~/calibrate_gyro" in bias.advice


def test_a_stuck_gyro_is_wrong(drive: Drive) -> None:
    """While the accelerometer is alive."""
    drive.imu.values[500:700, :3] = drive.imu.values[500, :3]
    stuck = said(drive, "IMU", "exactly the same")
    assert stuck.level is Level.BAD
    assert "gyro" in stuck.text
    assert "accelerometer" not in stuck.text


def test_a_gyro_that_contradicts_the_wheels_is_told(drive: Drive) -> None:
    """A wrong radius, or slip."""
    drive.imu.values[:, 2] *= 1.2
    assert "base_radius" in said(drive, "IMU", "gyro turned 1.2").advice


def test_a_sensor_that_stands_upright_is_noted(drive: Drive) -> None:
    """It turns as the wheels do."""
    drive.imu.values[:, 2] *= -1.0
    assert "imu_rpy" in said(drive, "IMU", "upright").advice


def test_vibration_is_told_with_its_frequency(drive: Drive) -> None:
    """20 Hz while driving."""
    times_s = drive.imu.stamp_s
    on = (times_s > 5.0) & (times_s < 15.0)
    drive.imu.values[:, 3] += 6.0 * np.sin(2 * np.pi * 20.0 * times_s) * on
    (shakes,) = troubles(drive)
    frequency_hz = float(shakes.text.split("most at ")[1].split(" Hz")[0])
    assert frequency_hz == pytest.approx(20.0, abs=0.4)


def test_numbers_that_are_none_are_counted_and_do_no_harm(drive: Drive) -> None:
    """What is left is judged as ever."""
    drive.imu.values[100:103, 4] = np.nan
    drive.odom.values[50, 0] = np.inf
    found = troubles(drive)
    assert [finding.level for finding in found] == [Level.BAD, Level.BAD]
    assert any("3 messages of imu/data_raw with NaN" in finding.text for finding in found)
    assert any("1 message of odom with NaN" in finding.text for finding in found)


def test_nothing_but_nan_is_told(drive: Drive) -> None:
    """Of every topic."""
    for topic in (drive.imu, drive.odom, drive.cmd_vel, drive.joints):
        topic.values[:] = np.nan
    assert {finding.subject for finding in troubles(drive)} == {"IMU", "Odometry", "Commands"}


def test_the_lag_of_the_robot_is_found(drive: Drive) -> None:
    """Within a step of the search, and half a step of the odometry."""
    text = said(drive, "Commands", "followed").text
    lag_s = float(text.split("followed ")[1].split(" ms")[0]) / 1e3
    assert lag_s == pytest.approx(DELAY_S, abs=0.041)


def test_a_robot_that_is_too_slow_is_told_with_the_scale_to_set(drive: Drive) -> None:
    """70 % in x and y, all of the yaw rate."""
    drive.odom.values[:, :2] *= 0.7
    drive.odom.values[:, 3:5] *= 0.7
    (slow,) = troubles(drive)
    assert "vx 0.70" in slow.text
    assert "divide linear_scale by" in slow.advice


def test_a_robot_that_goes_the_wrong_way_is_told_with_the_signs(drive: Drive) -> None:
    """Yaw alone."""
    drive.odom.values[:, 2] *= -1.0
    drive.odom.values[:, 5] *= -1.0
    assert "axis_signs" in said(drive, "Commands", "followed").advice


def test_a_robot_that_stands_when_told_to_move_is_wrong(drive: Drive) -> None:
    """For the last four seconds of the drive."""
    rows = drive.odom.stamp_s > 12.0
    drive.odom.values[rows, :3] = drive.odom.values[rows][0, :3]
    drive.odom.values[rows, 3:] = 0.0
    stands = said(drive, "Commands", "stood 1 time")
    assert stands.level is Level.BAD
    assert "first at 12.0 s" in stands.text


def test_commands_that_ceased_are_noted(drive: Drive) -> None:
    """The driver stops the robot, so this says why it stood."""
    drive.cmd_vel.drop(10.0, 10.8)
    assert "1 time in motion" in said(drive, "Commands", "ceased").text


def test_a_robot_that_moves_by_itself_is_told(drive: Drive) -> None:
    """No command for two seconds, and no rest."""
    drive.cmd_vel.drop(10.0, 14.0)
    assert said(drive, "Commands", "without a command").level is Level.WARN


def test_an_estop_is_noted_and_what_it_stops_is_no_trouble(drive: Drive) -> None:
    """Commands go on; the robot stands."""
    drive.estops += [(10.0, True), (19.0, False)]
    rows = drive.odom.stamp_s > 10.1
    drive.odom.values[rows, :3] = drive.odom.values[rows][0, :3]
    drive.odom.values[rows, 3:] = 0.0
    drive.imu.values[drive.imu.stamp_s > 10.1, 2] = 0.001
    assert "1 time, 9 s in all, first at 10.0 s" in said(drive, "E-stop", "Latched").text
    assert not troubles(drive)


def test_motion_under_a_latched_estop_is_wrong(drive: Drive) -> None:
    """Nothing is worse."""
    drive.estops += [(10.0, True)]
    moved = said(drive, "E-stop", "moved while")
    assert moved.level is Level.BAD
    assert "still latched at the end" in said(drive, "E-stop", "Latched").text


def test_a_leap_of_the_odometry_is_wrong(drive: Drive) -> None:
    """Half a metre that no twist tells of."""
    drive.odom.values[300:, 0] += 0.5
    (leap,) = troubles(drive)
    assert leap.level is Level.BAD
    assert "1 time" in leap.text
    assert "by 0.50 m" in leap.text


def test_a_reset_of_the_odometry_is_noted_and_is_no_way(drive: Drive) -> None:
    """It begins anew at zero."""
    way = said(drive, "Odometry", "Driven").text.split(",")[0]
    drive.odom.values[450:, :3] = 0.0
    assert not troubles(drive)
    assert "1 time" in said(drive, "Odometry", "anew").text
    assert said(drive, "Odometry", "Driven").text.startswith(way)


def test_what_diagnostics_said_is_repeated(drive: Drive) -> None:
    """The worst word of each status."""
    drive.statuses.append((9.5, "omnibot_driver: Time", 1, "measurements wait", {}))
    drive.statuses.append((10.5, "omnibot_driver: Time", 1, "measurements wait", {}))
    drive.statuses.append((10.6, "omnibot_driver: IMU", 2, "the gyro is stuck", {}))
    first, second = troubles(drive)
    assert first.level is Level.BAD
    assert "the gyro is stuck" in first.text
    assert (
        "Time (/dev/ttyUSB0) said WARN 2 times, from 10 s on: “measurements wait” (2×)"
        in second.text
    )


def test_topics_that_are_missing_are_named(drive: Drive) -> None:
    """With what cannot be said for want of them."""
    drive.odom.drop(0.0, 99.0)
    drive.cmd_vel.drop(0.0, 99.0)
    assert said(drive, "Recording", "No message of odom").level is Level.BAD
    assert said(drive, "Commands", "No cmd_vel").level is Level.NOTE


def test_stamps_of_zero_are_told(drive: Drive) -> None:
    """Somebody else publishes."""
    log = drive.log()
    log.imu.stamp_s[:3] = np.nan
    assert any("3 messages of imu/data_raw without a stamp" in item.text for item in judge(log))
