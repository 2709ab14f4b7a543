# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry scales, which correct a board with wrong wheel and base sizes."""

import math

import pytest
from session_bench import Bench

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.session import SessionSettings
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

WHEELS, BASE = 1.04, 0.97
TRUE = OdometrySettings(linear_scale=WHEELS, angular_scale=WHEELS / BASE)


def bench(odometry: OdometrySettings, **settings: object) -> Bench:
    board = BoardSettings(
        running=True, wheel_radius_scale=(WHEELS,) * 3, base_radius_scale=BASE, **settings
    )  # type: ignore[arg-type]
    made = Bench(board)
    made.session.configure(
        SessionSettings(limits=SpeedLimits(), commands=CommandSettings(), odometry=odometry),
        made.now,
    )
    made.open()
    made.run_until_state("nominal")
    made.run(1.0)
    return made


def drive(on: Bench) -> None:
    for tick in range(200):
        t = tick / 20
        on.drive(0.3 * math.cos(t), 0.25 * math.sin(1.4 * t), 0.5 * math.cos(0.4 * t))
        on.run(0.05)
    on.drive()
    on.run(1.5)


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["earth", "body"])
def test_the_odometry_is_the_truth_of_a_robot_with_other_wheels(frame: str) -> None:
    """With the right odometry scales, odom ends within 5 mm and 3 mrad of the true pose.

    The board assumes wrong sizes of its wheels and base.
    """
    on = bench(TRUE, frame=frame, initial_pose=BoardPose(4000.0, -1000.0, 2000.0))
    drive(on)
    truth, pose = on.board.truth, on.odometry[-1].pose
    assert math.dist((pose.x_m, pose.y_m), (truth.x_m, truth.y_m)) < 0.005
    assert pose.yaw_rad == pytest.approx(truth.yaw_rad, abs=0.003)
    as_told = bench(OdometrySettings(), frame=frame)
    drive(as_told)
    pose = as_told.odometry[-1].pose
    assert math.dist((pose.x_m, pose.y_m), (truth.x_m, truth.y_m)) > 0.02
    assert pose.yaw_rad != pytest.approx(truth.yaw_rad, abs=0.05)


def test_the_twist_is_the_true_one() -> None:
    """The board assumes wrong sizes of its wheels and its base.

    With the right odometry scales, the twist is the robot's true twist, within 2 %.
    """
    on = bench(TRUE)
    on.drive(0.2, 0.1, 0.4)
    on.run(3.0)
    truth = on.board.truth
    twists = [one.twist for one in on.odometry[-25:] if one.twist]
    for name, value in (
        ("vx_mps", truth.vx_mps),
        ("vy_mps", truth.vy_mps),
        ("yaw_rate_radps", truth.yaw_rate),
    ):
        assert sum(getattr(one, name) for one in twists) / 25 == pytest.approx(value, rel=0.02)


def test_what_has_rolled_is_the_true_way() -> None:
    """With the right odometry scales, the distance that the robot has rolled is right within 2 mm.

    The board assumes wrong sizes of its wheels and base.
    """
    on = bench(TRUE)
    on.drive(0.2, 0.0, 0.0)
    on.run(3.0)
    on.drive()
    on.run(1.0)
    truth, rolled = on.board.truth, on.odometry[-1].rolled
    assert rolled.x_m == pytest.approx(truth.x_m, abs=0.002)


def test_a_goal_in_odom_is_reached_in_truth() -> None:
    """With the right odometry scales, the robot's true pose reaches a goal in odom, within 5 mm.

    The board assumes wrong sizes of its wheels and base.
    """
    on = bench(TRUE, control="position")
    on.go_to(0.6, -0.4, 0.0)
    on.run(8.0)
    truth = on.board.truth
    assert (truth.x_m, truth.y_m) == pytest.approx((0.6, -0.4), abs=0.005)
