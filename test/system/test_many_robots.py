# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of several robots in one ROS domain. Each has its own commands and frames."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import pytest
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool
from std_srvs.srv import SetBool


@dataclass
class Robot:
    """A driver on its own simulated board, and the messages that it has published.

    ``probe``: the node that has received these messages.
    """

    name: str
    probe: Probe
    imu: list[Any]
    odom: list[Any]
    estop_active: list[Any]

    def heard(self) -> bool:
        """Return whether the probe has received a message on each topic."""
        return bool(self.imu and self.odom and self.estop_active)

    @property
    def x_m(self) -> float:
        return float(self.odom[-1].pose.pose.position.x)


@pytest.fixture(scope="module")
def fleet() -> Iterator[list[Robot]]:
    names = ("odom_frame", "base_frame", "imu_frame")
    with ExitStack() as stack:
        robots = []
        for seed in range(3):
            driver = stack.enter_context(
                Driver(
                    port=f"sim://?seed={seed}",
                    **{name: f"r{seed}/{name}" for name in names},
                )
            )
            probe = stack.enter_context(Probe.of(driver))
            robots.append(
                Robot(
                    driver.namespace,
                    probe,
                    probe.listen(Imu, "imu/data_raw"),
                    probe.listen(Odometry, "odom"),
                    probe.listen(Bool, "omnibot_driver/estop_active", latched=True),
                )
            )
        for robot in robots:
            robot.probe.wait_for_state("nominal")
            robot.probe.wait_for(robot.heard)
        yield robots


def test_each_speaks_of_its_own_frames(fleet: list[Robot]) -> None:
    """Each robot has frames of its own, so one transform tree can hold all robots."""
    for seed, robot in enumerate(fleet):
        assert robot.imu[-1].header.frame_id == f"r{seed}/imu_frame"
        assert robot.odom[-1].header.frame_id == f"r{seed}/odom_frame"
        assert robot.odom[-1].child_frame_id == f"r{seed}/base_frame"


def test_each_hears_only_its_own_commands(fleet: list[Robot]) -> None:
    """Two of three robots get commands.

    One drives forward, one backward, and the third one rests.
    """
    forward, still, backward = fleet
    speeds = {forward.name: 0.3, backward.name: -0.3}
    publishers = {
        robot.name: robot.probe.publisher(Twist, "cmd_vel") for robot in (forward, backward)
    }
    for _ in range(100):
        if forward.x_m > 0.1 and backward.x_m < -0.1:
            break
        for name, publisher in publishers.items():
            twist = Twist()
            twist.linear.x = speeds[name]
            publisher.publish(twist)
        count = len(still.odom)
        still.probe.wait_for(lambda count=count: len(still.odom) > count + 2)
    assert forward.x_m > 0.1
    assert backward.x_m < -0.1
    assert still.x_m == 0.0


def test_each_has_an_emergency_stop_of_its_own(fleet: list[Robot]) -> None:
    """The e-stops of two robots are latched, and one of these is released.

    No robot is affected by the e-stop of another one.
    """
    first, second, third = fleet
    for robot in (first, second):
        assert robot.probe.call(SetBool, "estop", data=True).success
        robot.probe.wait_for(lambda robot=robot: robot.estop_active[-1].data)
    assert first.probe.call(SetBool, "estop", data=False).success
    first.probe.wait_for(lambda: not first.estop_active[-1].data)
    assert second.estop_active[-1].data
    assert [message.data for message in third.estop_active] == [False]


def test_two_drivers_of_one_name_report_each_other() -> None:
    """Two drivers have the same name. Each reports the other, whichever started first."""
    with Driver(port="sim://") as first, Driver(port="sim://", namespace=first.namespace) as second:
        for driver in (first, second):
            driver.wait_for_line(f"another node has the name /{first.namespace}/omnibot_driver,")
