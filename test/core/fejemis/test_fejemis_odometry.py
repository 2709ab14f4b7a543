# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry from the poses and wheel speeds of the drive board."""

import contextlib
import math
import random
import statistics
from collections.abc import Callable

import pytest
from fejemis_bench import WHEELS, Bench, nominal
from fejemis_drive import PERIOD_S, TRACK_M, Drive, told

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.messages import BoardPose, WheelSpeeds
from omnibot_driver.core.fejemis.odometry import PoseOdometry
from omnibot_driver.core.geometry.se2 import Pose, log_of, roll
from omnibot_driver.core.odometry.covariance import Covariance, OdometryNoise
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated


def test_displacements_add_up_to_the_pose() -> None:
    """The drive board rounds its poses and speeds.

    The sum of the displacements still equals the robot's pose, within 3 mm.
    """
    drive = Drive()
    drive.run(0.0, 0.0, 0.1)
    for v, w in ((0.3, 0.5), (0.1, -0.7), (0.0, 1.0), (0.5, 0.0)):
        drive.run(v, w, 3.0)
    way = drive.out.way_to(drive.board)
    assert way.way_m < 0.003
    assert abs(way.yaw_rad) < 0.001


def test_the_speed_is_smoother_than_the_digits_of_the_pose() -> None:
    """At a constant speed, the speed in the odometry varies by less than 4 mm/s.

    From poses alone, it would have steps of 0.05 m/s.
    """
    spread = {}
    for with_speeds in (True, False):
        drive = Drive(with_speeds=with_speeds)
        drive.run(0.237, 0.3, 4.0)
        speeds = [r.dx_m / r.duration_s for r in drive.readings[20:] if r.duration_s]
        spread[with_speeds] = statistics.pstdev(speeds)
    assert spread[False] > 0.015
    assert spread[True] < 0.004


def test_the_first_pose_after_a_restart_says_how_long_ago_the_board_restarted() -> None:
    """The board restarts, and its first pose comes 0.3 s later.

    The displacement of this pose says that the restart was 0.3 s ago. The odometry needs this time,
    because the robot may have driven until the restart.
    """
    odometry = PoseOdometry(TRACK_M)
    odometry.pose(BoardPose(50.0, 1.0, 0.0, 0.0, 3))
    odometry.forget()
    displacement = odometry.pose(BoardPose(0.3, 0.0, 0.0, 0.0, 3))
    assert displacement is not None
    assert displacement.restarted
    assert displacement.up_s == 0.3


def test_a_gap_is_settled_by_the_pose_after_it() -> None:
    """A pose corrects the odometry after a gap of 2 s without poses.

    During the gap, the robot drives a curve.
    """
    drive = Drive()
    drive.run(0.0, 0.0, 0.1)
    drive.run(0.3, 0.2, 1.0)
    drive.run(0.4, -0.5, 2.0, heard=False)
    drive.run(0.0, 0.0, 0.1)
    way = drive.out.way_to(drive.board)
    assert way.way_m < 0.003
    assert not any(reading.restarted for reading in drive.readings)


@pytest.mark.parametrize(
    "damage",
    [
        lambda p: BoardPose(p.time_s, p.x_m + 1.0, p.y_m, p.yaw_rad, 3),
        lambda p: BoardPose(p.time_s, p.x_m, -p.y_m, p.yaw_rad, 3),
        lambda p: BoardPose(p.time_s, p.x_m, p.y_m, -p.yaw_rad, 3),
        lambda p: BoardPose(p.time_s, p.x_m, p.y_m + 0.06, p.yaw_rad, 3),
    ],
)
def test_a_false_pose_moves_nothing(damage: Callable[[BoardPose], BoardPose]) -> None:
    """The odometry ignores a false pose: one that does not fit the motion of the wheels.

    With the next correct pose, the odometry continues.
    """
    drive = Drive()
    drive.run(0.0, 0.0, 0.1)
    drive.run(0.3, 0.4, 2.0)
    drive.step(0.3, 0.4, heard=False)
    assert drive.say(damage(told(drive.board, drive.now))) is None
    drive.run(0.3, 0.4, 1.0)
    assert drive.out.way_to(drive.board).way_m < 0.003
    assert drive.odometry.refused == 1


def test_two_different_false_poses_in_a_row_move_nothing() -> None:
    """Two different false poses in a row do not move the odometry.

    The robot could have driven to each pose, but the wheel speeds contradict both motions.
    """
    drive = Drive()
    drive.run(0.0, 0.0, 0.1)
    drive.run(0.3, 0.4, 2.0)
    for off_x_m, off_y_m in ((0.1, 0.0), (0.15, 0.05)):
        drive.step(0.3, 0.4, heard=False)
        p = told(drive.board, drive.now)
        assert (
            drive.say(BoardPose(p.time_s, p.x_m + off_x_m, p.y_m + off_y_m, p.yaw_rad, 3)) is None
        )
    drive.run(0.3, 0.4, 1.0)
    assert drive.out.way_to(drive.board).way_m < 0.003


def test_a_pose_with_coarse_digits_is_no_new_frame() -> None:
    """The odometry follows a pose that the board prints in steps of 0.1 m.

    The steps contradict the wheel speeds, but the board's frame has not moved.
    """
    drive = Drive()
    for _ in range(400):
        drive.step(0.3, 0.0, heard=False)
        drive.odometry.speeds(WheelSpeeds(0.3, 0.3))
        place = drive.board
        drive.say(BoardPose(round(drive.now, 5), round(place.x_m, 1), 0.0, 0.0, 1))
    assert drive.out.x_m == pytest.approx(2.4, abs=0.11)


@pytest.mark.slow
def test_the_covariance_is_consistent_over_fifty_drives() -> None:
    """The normalised squared error (NEES) of the odometry is about 3 on average over fifty drives.

    The random errors of slip and wheels agree with the noise settings.
    """
    noise = OdometryNoise(wheels=WHEELS)
    squares = []
    for seed in range(50):
        chance = random.Random(seed)
        scale = [chance.gauss(1.0, noise.wheel_scale) for _ in range(2)]
        slip = 1.0 - chance.gauss(0.0, noise.wheel_slip)
        drive, odometry = Drive(), Odometry(OdometrySettings(noise=noise))
        truth, taken, last = Pose(), 0, None
        v = w = 0.0
        for step in range(400):
            if step % 100 == 0:
                v, w = chance.uniform(0.1, 0.5), chance.uniform(-0.8, 0.8)
            drive.step(v, w)
            rims = [(v - w * 0.2) * PERIOD_S, (v + w * 0.2) * PERIOD_S]
            true = [
                rim * wheel * slip + chance.gauss(0.0, noise.wheel_drift * math.sqrt(abs(rim)))
                for rim, wheel in zip(rims, scale, strict=True)
            ]
            way = Pose(sum(true) / 2, 0.0, (true[1] - true[0]) / TRACK_M)
            if drive.readings:
                truth = truth.moved(roll(way))
            for reading in drive.readings[taken:]:
                for last in odometry.displace(reading, drive.now):  # noqa: B007
                    pass
            taken = len(drive.readings)
        assert last is not None
        squares.append(normalised(last.pose, truth, last.covariance))
    assert 1.8 < statistics.mean(squares) < 4.5


def normalised(pose: Pose, truth: Pose, c: Covariance) -> float:
    """Return the normalised squared error (NEES) of the pose."""
    e = (
        pose.x_m - truth.x_m,
        pose.y_m - truth.y_m,
        math.remainder(pose.yaw_rad - truth.yaw_rad, math.tau),
    )
    rows = [
        [c.xx, c.xy, c.x_yaw, e[0]],
        [c.xy, c.yy, c.y_yaw, e[1]],
        [c.x_yaw, c.y_yaw, c.yaw_yaw, e[2]],
    ]
    for n in range(3):
        for m in range(n + 1, 3):
            factor = rows[m][n] / rows[n][n]
            rows[m] = [a - factor * b for a, b in zip(rows[m], rows[n], strict=True)]
    solved = [0.0, 0.0, 0.0]
    for n in (2, 1, 0):
        rest = sum(rows[n][m] * solved[m] for m in range(n + 1, 3))
        solved[n] = (rows[n][3] - rest) / rows[n][n]
    return sum(a * b for a, b in zip(e, solved, strict=True))


def figure_eight(bench: Bench, speed: float = 0.8, radius_m: float = 0.8) -> None:
    """Drive a figure eight, 10 m long. If a command is refused, continue with the next one."""
    rate = speed / radius_m
    lap_s = math.tau / rate
    end_s, began = 2 * lap_s, bench.now
    while bench.now - began < end_s:
        turn = rate if bench.now - began < lap_s else -rate
        with contextlib.suppress(CommandRefused):
            bench.drive(speed, turn)
        bench.run(0.1)
    bench.run(1.5)


@pytest.mark.slow
def test_a_figure_eight_with_losses_both_ways_ends_where_it_is() -> None:
    """After a figure eight of 10 m, the odometry is right within 0.1 m and 2°.

    In each direction, 1 character in 1000 is lost.
    """
    chance = random.Random(1)
    bench = nominal(Simulated(seed=1, lose_inbound=1e-3))
    bench.carry = lambda _, data: bytes(byte for byte in data if chance.random() >= 1e-3)
    figure_eight(bench)
    off = bench.odometry[-1].pose.way_to(
        Pose(bench.robot.truth.x_m, bench.robot.truth.y_m, bench.robot.truth.yaw_rad)
    )
    assert off.way_m < 0.1
    assert abs(math.degrees(off.yaw_rad)) < 2.0
    assert bench.robot.standing


@pytest.mark.slow
def test_joint_states_follow_the_wheels() -> None:
    """The wheels in the odometry have rolled as far as those of the simulated robot in a curve."""
    bench = nominal()
    bench.drive_on(0.3, 0.3, 2.0)
    bench.run(1.0)
    left, right = WHEELS.wheel_rates(bench.odometry[-1].rolled.over(1.0))
    radius = bench.robot.settings.wheel_radius_m
    turned = [math.tau * radius * turns for turns in bench.robot.vehicle.turns]
    assert (left, right) == pytest.approx(turned, abs=0.005)


def test_odometry_goes_out_with_every_pose() -> None:
    """The board sends fifty poses a second, and odometry is published with each.

    The twist comes from the wheel speeds.
    """
    bench = nominal()
    bench.drive_on(0.3, 0.2, 2.0)
    bench.events.clear()
    bench.drive_on(0.3, 0.2, 1.0)
    assert len(bench.odometry) == pytest.approx(50, abs=1)
    twists = [e.twist for e in bench.odometry if e.twist]
    assert all(abs(twist.vx_mps - 0.3) < 0.02 for twist in twists)


def test_the_logarithm_leads_to_the_pose() -> None:
    """The logarithm of a pose is a twist. The arc of this twist leads to the pose."""
    way = Pose(0.3, 0.1, 0.7)
    assert roll(log_of(way)).way_to(way).way_m < 1e-12
