# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a report's findings on a robot with a planted fault in its motion or its IMU."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from drives import DELAY_S, Drive, Topic
from verdicts import said, troubles

from omnibot_driver.boards.fejemis import PARAMETERS
from omnibot_driver.tools.report import commanded, plots
from omnibot_driver.tools.report.findings import Level
from omnibot_driver.tools.report.judge import judge
from omnibot_driver.tools.report.log import Log
from omnibot_driver.tools.report.recorder import Recorder

JOINTS = ("left_wheel_joint", "right_wheel_joint", "front_steering_joint")


@pytest.mark.parametrize(
    ("factor", "advice"), [(0.5, "2 times"), (0.25, "4 times"), (0.8, "Check")]
)
def test_a_wrong_gravity_is_told_with_the_range_that_explains_it(
    drive: Drive, factor: float, advice: str
) -> None:
    """The measured gravity is too small. The report calls this BAD.

    If it is a half or a quarter of true gravity, the advice gives a factor for ``accel_range``.
    """
    drive.imu.values[:, 3:] *= factor
    gravity = said(drive, "IMU", "Gravity")
    assert gravity.level is Level.BAD
    assert advice in gravity.advice


def test_a_tilt_at_rest_is_told(drive: Drive) -> None:
    """At rest, the sensor is tilted by 10° about y. The report gives this tilt."""
    tilt = np.radians(10.0)
    force = drive.imu.values[:, 3:].copy()
    drive.imu.values[:, 3] = force[:, 0] * np.cos(tilt) + force[:, 2] * np.sin(tilt)
    drive.imu.values[:, 5] = force[:, 2] * np.cos(tilt) - force[:, 0] * np.sin(tilt)
    assert "10.0°" in troubles(drive)[0].text


def test_a_biased_gyro_is_told_with_the_service_that_mends_it(drive: Drive) -> None:
    """The gyro has a bias of 0.05 rad/s. The report recommends the service ``~/calibrate_gyro``."""
    drive.imu.values[:, 1] += 0.05
    (bias,) = troubles(drive)
    assert "+0.05" in bias.text
    assert "about y" in bias.text
    assert "~/calibrate_gyro" in bias.advice


def test_a_stuck_gyro_is_wrong(drive: Drive) -> None:
    """200 successive gyro readings are identical, but those of the accelerometer vary.

    The report calls the gyro stuck, with the level BAD, and does not mention the accelerometer.
    """
    drive.imu.values[500:700, :3] = drive.imu.values[500, :3]
    stuck = said(drive, "IMU", "identical readings")
    assert stuck.level is Level.BAD
    assert "gyro" in stuck.text
    assert "accelerometer" not in stuck.text


def test_a_gyro_that_contradicts_the_wheels_is_told(drive: Drive) -> None:
    """Gyro and wheels differ by 20 %. The advice names ``base_radius``."""
    drive.imu.values[:, 2] *= 1.2
    assert "base_radius" in said(drive, "IMU", "by the gyro are 1.2").advice


@pytest.mark.parametrize("lost", [("imu",), ("odom",), ("imu", "odom")], ids="+".join)
def test_turns_that_were_not_heard_do_not_contradict_the_wheels(
    drive: Drive, lost: tuple[str, ...]
) -> None:
    """The report does not compare gyro and wheels in a gap of IMU or odometry messages."""
    for name in lost:
        getattr(drive, name).drop(8.0, 10.0)
    assert said(drive, "IMU", "by the gyro are 1.000 times").level is Level.GOOD


def test_a_gap_in_the_odometry_is_not_rest(drive: Drive) -> None:
    """The odometry has a gap, and the robot may turn during the gap.

    So the report does not regard the gap as a standstill.
    """
    drive.odom.drop(8.0, 10.0)
    assert said(drive, "IMU", "At rest the gyro").level is Level.GOOD


def test_without_odometry_an_even_turn_is_not_taken_for_rest(drive: Drive) -> None:
    """The odometry is missing, and the robot turns steadily.

    The report does not mistake this for the bias of a gyro at rest.
    """
    drive.odom.drop(0.0, 99.0)
    assert said(drive, "IMU", "At rest the gyro").level is Level.GOOD


def test_a_sensor_that_stands_upright_is_noted(drive: Drive) -> None:
    """The description has the sensor upside down, but the sign of the gyro's rate shows it upright.

    The advice names ``imu_rpy``.
    """
    drive.imu.values[:, 2] *= -1.0
    assert "imu_rpy" in said(drive, "IMU", "upright").advice


def of_a_fejemis(drive: Drive) -> Log:
    """Return the log of ``drive``, changed to the two wheels and the upright IMU of a Fejemis."""
    log = drive.log()
    imu = replace(log.imu, values=log.imu.values * [1, 1, -1, 1, 1, -1])
    joints = replace(log.joint_states, values=log.joint_states.values[:, :2])
    return replace(log, imu=imu, joint_states=joints, wheels=JOINTS[:2])


def test_the_upright_sensor_of_a_fejemis_is_good(drive: Drive) -> None:
    """The IMU of a Fejemis stands upright, as the description of the robot says.

    The report calls this good.
    """
    found = judge(of_a_fejemis(drive))
    assert all(finding.level <= Level.NOTE for finding in found)
    (turns,) = [finding for finding in found if "by the gyro" in finding.text]
    assert turns.level is Level.GOOD
    assert "upright, as in the robot's description" in turns.text


def test_a_sensor_of_a_fejemis_that_hangs_upside_down_is_noted(drive: Drive) -> None:
    """The description of a Fejemis has the sensor upright, but the sign of the gyro contradicts it.

    The advice names ``imu_rpy``.
    """
    drive.imu.values[:, [2, 5]] *= -1.0
    (turns,) = [one for one in judge(of_a_fejemis(drive)) if "by the gyro" in one.text]
    assert turns.level is Level.NOTE
    assert "hangs upside down" in turns.text
    assert "description has the sensor upright: set imu_rpy" in turns.advice


def test_the_advice_for_a_fejemis_names_only_its_parameters(drive: Drive) -> None:
    """The report finds faults in the turns, the gravity and the directions of a Fejemis.

    Its advice names only parameters of this board, and ``imu_rpy``, an argument of the robot's
    description.
    """
    drive.imu.values[:, 2] *= 1.2
    drive.imu.values[:, 3:] /= 9.80665
    drive.odom.values[:, [0, 3]] *= -1.0
    advice = " ".join(finding.advice for finding in judge(of_a_fejemis(drive)))
    assert {"wheel_radii", "track", "acceleration_unit"} <= {*re.findall(r"\w+", advice)}
    of_robot = {row.name for row in PARAMETERS.rows} | {"imu_rpy"}
    assert {*re.findall(r"(?<!/)\b[a-z]+_[a-z_]+\b", advice)} <= of_robot


def test_vibration_is_told_with_its_frequency(drive: Drive) -> None:
    """The robot vibrates at 20 Hz while it drives. The report gives this frequency."""
    times_s = drive.imu.stamp_s
    on = (times_s > 5.0) & (times_s < 15.0)
    drive.imu.values[:, 3] += 6.0 * np.sin(2 * np.pi * 20.0 * times_s) * on
    (shakes,) = troubles(drive)
    frequency_hz = float(shakes.text.split("most at ")[1].split(" Hz")[0])
    assert frequency_hz == pytest.approx(20.0, abs=0.4)


def test_the_lag_of_the_robot_is_found(drive: Drive) -> None:
    """The robot follows its commands with a lag. The report finds the lag.

    The tolerance is one step of the search plus half a period of the odometry.
    """
    text = said(drive, "Commands", "follows").text
    lag_s = float(text.split("lag of ")[1].split(" ms")[0]) / 1e3
    assert lag_s == pytest.approx(DELAY_S, abs=0.041)


def test_a_robot_that_is_too_slow_is_told_with_the_scale_to_set(drive: Drive) -> None:
    """The robot reaches only 70 % of its commanded speed. The advice names ``linear_scale``."""
    drive.odom.values[:, :2] *= 0.7
    drive.odom.values[:, 3:5] *= 0.7
    (slow,) = troubles(drive)
    assert "vx 0.70" in slow.text
    assert "divide linear_scale by" in slow.advice


def test_a_robot_that_goes_the_wrong_way_is_told_with_the_signs(drive: Drive) -> None:
    """The robot turns in the wrong direction. The advice names ``axis_signs``."""
    drive.odom.values[:, 2] *= -1.0
    drive.odom.values[:, 5] *= -1.0
    assert "axis_signs" in said(drive, "Commands", "follows").advice


def test_a_robot_that_stands_when_told_to_move_is_wrong(drive: Drive) -> None:
    """The robot stands still during four seconds of commands. The level of this finding is BAD."""
    rows = drive.odom.stamp_s > 12.0
    drive.odom.values[rows, :3] = drive.odom.values[rows][0, :3]
    drive.odom.values[rows, 3:] = 0.0
    stands = said(drive, "Commands", "stood still although", "1 time")
    assert stands.level is Level.BAD
    assert "first at 12.0 s" in stands.text


def test_a_front_wheel_may_turn_before_the_robot_moves(drive: Drive) -> None:
    """A Fejemis stands for 2 s, because its front wheel first turns from one side to the other.

    The report does not say that the robot stood still although it was commanded to move.
    """
    rows = (drive.odom.stamp_s > 12.0) & (drive.odom.stamp_s < 14.0)
    drive.odom.values[rows, 3:] = 0.0
    assert not any("stood still" in finding.text for finding in judge(of_a_fejemis(drive)))


def test_a_robot_with_two_wheels_that_never_moves_in_short_drives_is_wrong(drive: Drive) -> None:
    """A Fejemis is commanded for 2 s at a time, and never moves. The report's finding is BAD.

    Regression: each drive was shorter than a slow start, so the report did not mention the
    standstill.
    """
    drive.cmd_vel.values[drive.cmd_vel.stamp_s % 4.0 < 2.0] = 0.0
    drive.odom.values[:] = 0.0
    found = [each for each in judge(of_a_fejemis(drive)) if "stood still although" in each.text]
    assert [each.level for each in found] == [Level.BAD]


def test_commands_that_ceased_are_noted(drive: Drive) -> None:
    """Commands are missing for a while. The report notes this, since it explains a standstill."""
    drive.cmd_vel.drop(10.0, 10.8)
    assert "1 time, first at 9.9 s" in said(drive, "Commands", "paused").text


def test_a_robot_that_moves_by_itself_is_told(drive: Drive) -> None:
    """The robot moves for four seconds without commands. The report mentions this motion."""
    drive.cmd_vel.drop(10.0, 14.0)
    assert said(drive, "Commands", "without a command").level is Level.WARN


def test_an_estop_is_noted_and_what_it_stops_is_not_trouble(drive: Drive) -> None:
    """The e-stop keeps the robot at rest while commands arrive.

    The report does not call this a fault.
    """
    drive.estops += [(10.0, True), (19.0, False)]
    rows = drive.odom.stamp_s > 10.1
    drive.odom.values[rows, :3] = drive.odom.values[rows][0, :3]
    drive.odom.values[rows, 3:] = 0.0
    drive.imu.values[drive.imu.stamp_s > 10.1, 2] = 0.001
    assert "1 time, 9 s in all, first at 10.0 s" in said(drive, "E-stop", "The e-stop was").text
    assert not troubles(drive)


def test_motion_under_a_latched_estop_is_wrong(drive: Drive) -> None:
    """Motion while the e-stop is latched is BAD, the worst level."""
    drive.estops += [(10.0, True)]
    moved = said(drive, "E-stop", "moved while")
    assert moved.level is Level.BAD
    assert "still latched at the end" in said(drive, "E-stop", "The e-stop was").text


def test_motion_under_a_latched_estop_is_found_without_any_command(drive: Drive) -> None:
    """Motion while the e-stop is latched is BAD, even if the log has no velocity commands."""
    drive.estops += [(10.0, True)]
    drive.cmd_vel.drop(-np.inf, np.inf)
    assert said(drive, "E-stop", "moved while").level is Level.BAD


def test_a_leap_of_the_odometry_is_wrong(drive: Drive) -> None:
    """The pose jumps by 0.5 m, but the twist shows no such motion. The report calls it BAD."""
    drive.odom.values[300:, 0] += 0.5
    (leap,) = troubles(drive)
    assert leap.level is Level.BAD
    assert "1 time" in leap.text
    assert "by 0.50 m" in leap.text


def test_a_reset_of_the_odometry_is_noted_and_is_not_a_way(drive: Drive) -> None:
    """The odometry is reset: its pose begins again at zero.

    The report notes the reset, and does not add the jump to the driven distance.
    """
    way = said(drive, "Odometry", "drove").text.split(" in all")[0]
    drive.odom.values[450:, :3] = 0.0
    assert not troubles(drive)
    assert "1 time" in said(drive, "Odometry", "set back to zero").text
    assert said(drive, "Odometry", "drove").text.startswith(way)


def test_wheel_commands_are_compared_with_the_wheels(drive: Drive) -> None:
    """Wheel B turns at half of its commanded rate. The report finds this."""
    drive.odom.values[:, :] = 0.0
    drive.imu.values[:, 2] = 0.001
    told = 5.0 * drive.told(drive.joints.stamp_s)[:, [2, 2, 2]]
    drive.joints.values[:] = told * [1.0, 0.5, 1.0]
    commands = Topic(drive.joints.stamp_s, told, drive.joints.late_s).series()
    drive.cmd_vel.drop(0.0, 99.0)
    findings = judge(replace(drive.log(), wheel_cmd=commands))
    (followed,) = [finding for finding in findings if "follows wheel_cmd" in finding.text]
    assert followed.level is Level.WARN
    assert "wheel A 1.00" in followed.text
    assert "wheel B 0.50" in followed.text


def two_wheels() -> Recorder:
    """Return a recorder that has received the commands and the rates of two wheels.

    The left wheel turns at half of its commanded rate.
    """
    recorder = Recorder("/")
    for number in range(200):
        rate, stamp = float(number % 50 > 10), SimpleNamespace(sec=number, nanosec=1)
        header = SimpleNamespace(stamp=stamp)
        joints = SimpleNamespace(name=JOINTS, velocity=(0.5 * rate, rate, 9.0), header=header)
        told = SimpleNamespace(data=(rate, rate) if number else (1.0,))
        at_ns = number * 10**9
        recorder.hear("wheel_cmd", "std_msgs/msg/Float32MultiArray", at_ns, told)
        recorder.hear("joint_states", "sensor_msgs/msg/JointState", at_ns, joints)
    return recorder


def test_wheels_have_the_names_and_the_number_of_their_joints() -> None:
    """The report takes only driven joints for wheels: it leaves a steering joint out.

    It reads a wheel command with a wrong number of values as NaN.
    """
    log = two_wheels().log()
    assert log.wheels == JOINTS[:2]
    assert log.joint_states.values[20].tolist() == [0.5, 1.0]
    assert log.wheel_cmd.values[20].tolist() == [1.0, 1.0]
    assert np.isnan(log.wheel_cmd.values[0]).tolist() == [True, True]
    (pair,) = commanded.pairs(log)
    assert pair.axes == ("left wheel", "right wheel")
    plots.velocities(log)


def test_an_imu_that_the_board_has_not_is_not_missed(drive: Drive) -> None:
    """The diagnostics show that the board has no IMU. The report does not call the IMU missing."""
    drive.imu.drop(0.0, 99.0)
    said_of_it = [finding.text for finding in judge(drive.log())]
    assert "No message of imu/data_raw: the IMU cannot be judged." in said_of_it
    counts = {"Odometry frames lost": "0"}
    drive.statuses[:] = [(1.0, "omnibot_driver: Stream", 0, "complete", counts)]
    assert not [one for one in judge(drive.log()) if "imu/data_raw" in one.text]
