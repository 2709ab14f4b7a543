# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry if another program sets the board's pose to zero (``enc0``)."""

import math

import pytest
from fejemis_bench import DRIVE, Bench, nominal
from fejemis_drive import Drive, told

from omnibot_driver.core.fejemis.messages import WheelSpeeds
from omnibot_driver.core.fejemis.sums import with_sum
from omnibot_driver.core.geometry.se2 import Pose


def assert_right(bench: Bench) -> None:
    """Assert that ``odom`` shows the true pose, within 2 cm and 0.02 rad."""
    last, truth = bench.odometry[-1], bench.robot.truth
    off = Pose(truth.x_m, truth.y_m, truth.yaw_rad).way_to(last.pose)
    assert off.way_m < 0.02
    assert abs(math.remainder(off.yaw_rad, math.tau)) < 0.02


def test_a_pose_that_was_set_to_zero_is_a_new_frame() -> None:
    """The odometry does not jump when another program sets the board's pose to zero (``enc0``)."""
    drive = Drive()
    drive.run(0.5, 0.2, 4.0)
    before = drive.out
    drive.board = Pose()
    drive.run(0.0, 0.0, 0.2)
    assert before.way_to(drive.out).way_m < 0.02
    drive.run(0.3, 0.0, 1.0)
    assert before.way_to(drive.out).way_m == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize("seconds", [0.3, 0.8, 1.5, 4.0])
@pytest.mark.parametrize(("v", "w"), [(0.3, 0.2), (0.3, 0.0), (0.0, 0.8)])
def test_a_pose_set_to_zero_during_a_drive_does_not_move_the_odometry(
    seconds: float, v: float, w: float
) -> None:
    """If another program sends ``enc0`` during a drive, ``odom`` does not jump.

    Regression: if the robot was near the old origin, ``odom`` went back to this origin.
    """
    bench = nominal()
    bench.drive_on(v, w, 2.0)
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.drive_on(v, w, seconds)
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.drive_on(v, w, 1.0)
    bench.run(1.5)
    assert_right(bench)


def test_a_pose_set_to_zero_while_the_robot_brakes_hardly_moves_the_odometry() -> None:
    """The board's pose is set to zero while the robot brakes, and the next wheel speeds are lost.

    The odometry is still right within 4 mm, because the poses contain the motion since then.
    """
    drive = Drive()
    drive.run(0.0, 0.0, 0.1)
    drive.run(0.9, 0.0, 1.0)
    before, drive.board = drive.out, Pose()
    for v in (0.8, 0.7, 0.6):
        drive.step(v, 0.0, heard=False)
        drive.say(told(drive.board, drive.now))
    drive.run(0.6, 0.0, 0.1)
    assert drive.out.x_m - before.x_m == pytest.approx(drive.board.x_m, abs=0.004)


@pytest.mark.parametrize("wait_s", [0.01, 0.03, 0.04, 0.05])
@pytest.mark.parametrize("v", [0.5, 0.9])
def test_a_pose_set_to_zero_twice_at_once_does_not_move_the_odometry(
    v: float, wait_s: float
) -> None:
    """If another program sends ``enc0`` twice within three poses of a drive, ``odom`` stays right.

    Regression: the second ``enc0`` seemed to contradict the first, and ``odom`` went back by the
    whole distance driven.
    """
    bench = nominal()
    bench.drive_on(v, 0.0, 0.8)
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.run(wait_s)
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.drive_on(v, 0.0, 0.5)
    bench.run(1.5)
    assert bench.odometry[-1].pose.x_m == pytest.approx(bench.robot.truth.x_m, abs=0.01)


@pytest.mark.parametrize("v", [0.2, 0.35, 0.45])
def test_a_pose_set_to_zero_before_three_poses_in_a_row_loses_no_motion(v: float) -> None:
    """The board's pose is set to zero before each of three poses, 20 ms apart, in a steady drive.

    The odometry contains the whole motion, although these poses show none.
    """
    drive = Drive()
    drive.run(v, 0.0, 1.0)
    before = drive.out
    for _ in range(3):
        drive.step(v, 0.0, heard=False)
        drive.odometry.speeds(WheelSpeeds(v, v))
        drive.board = Pose()
        drive.say(told(drive.board, drive.now))
    drive.run(v, 0.0, 0.4)
    assert drive.out.x_m - before.x_m == pytest.approx(0.46 * v, abs=0.005)


def test_a_pose_set_to_zero_three_times_at_once_does_not_move_the_odometry() -> None:
    """The robot drives a curve, and another program sends ``enc0`` three times within 0.1 s.

    ``enc0`` sets the board's pose to zero. The position in ``odom`` stays right, within 3 cm.
    """
    bench = nominal()
    bench.drive_on(0.9, -1.0, 0.8)
    for _ in range(3):
        bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
        bench.run(0.04)
    bench.drive_on(0.9, -1.0, 0.5)
    bench.run(1.5)
    last, truth = bench.odometry[-1].pose, bench.robot.truth
    assert Pose(truth.x_m, truth.y_m, truth.yaw_rad).way_to(last).way_m < 0.03


@pytest.mark.parametrize("wait_s", [0.0, 0.02, 0.04, 0.06, 0.1])
def test_a_pose_set_to_zero_while_lines_wait_does_not_move_the_odometry(wait_s: float) -> None:
    """The driver reads every 0.15 s, and another program sets the board's pose to zero.

    ``odom`` does not jump. Regression: the driver regarded the last wheel speeds as too old.
    """
    bench = nominal()
    bench.drive_on(0.5, 0.3, 0.6)
    bench.read_s = 0.15
    bench.run(wait_s)
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.run(1.5)
    assert_right(bench)


def test_a_pose_set_to_zero_at_rest_does_not_move_the_odometry() -> None:
    """If another program sends ``enc0`` while the robot stands, ``odom`` stays where it is."""
    bench = nominal()
    bench.drive_on(0.3, 0.2, 1.0)
    bench.run(1.5)
    before = bench.odometry[-1].pose
    bench.robot.receive(with_sum(b"enc0") + b"\n", bench.now, DRIVE)
    bench.run(1.5)
    off = before.way_to(bench.odometry[-1].pose)
    assert off.way_m < 0.005
    assert abs(off.yaw_rad) < 0.005
