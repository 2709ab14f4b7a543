# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Publishers of a real node, and the stamps of what is published by its clock."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from sensor_msgs.msg import Imu, JointState

from omnibot_driver import parameters
from omnibot_driver.core.inertial import ImuEstimate
from omnibot_driver.core.odometry import OdometryEstimate
from omnibot_driver.core.omnibot import OmniBot
from omnibot_driver.core.se2 import Pose
from omnibot_driver.core.session import Session
from omnibot_driver.core.uncertainty import Covariance
from omnibot_driver.messages import MessageSettings
from omnibot_driver.publishing import Publishing

VALUES = {**parameters.check_all({}), "publish_tf": False}


@pytest.fixture
def node() -> Iterator[Node]:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("stamped", context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def publishing_of(node: Node) -> Publishing:
    """With a session that hears nothing but what a test has it hear."""
    session = Session(
        OmniBot(parameters.board_settings(VALUES)), parameters.session_settings(VALUES), run=True
    )
    return Publishing(node, session, VALUES, MessageSettings.from_parameters(VALUES))


def test_a_command_waits_for_no_events_of_publishers() -> None:
    """The executor looks at each thing that it waits for, rclpy's own publisher's included."""
    script = (
        "import rclpy\n"
        "from omnibot_driver.node import OmniBotDriver\n"
        "rclpy.init(args=['--ros-args', '-p', 'port:=sim://'])\n"
        "driver = OmniBotDriver()\n"
        "print([len(publisher.event_handlers) for publisher in driver.publishers])\n"
        "driver.close()\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    handlers = json.loads(told.stdout)
    assert len(handlers) >= 6
    assert not any(handlers)


def test_stamps_follow_simulated_time_while_there_is_any(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether it begins before the driver or later, and after it ends they are the system's."""
    published: list[bytes] = []

    def published_at_s() -> float:
        publishing.deliver([ImuEstimate(time.monotonic(), (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))])
        stamp = deserialize_message(published[-1], Imu).header.stamp
        return float(stamp.sec + 1e-9 * stamp.nanosec)

    def simulate(active: bool) -> None:
        node.set_parameters([rclpy.Parameter("use_sim_time", value=active)])

    for begins_before in (True, False):
        simulate(begins_before)
        publishing = publishing_of(node)
        monkeypatch.setattr(publishing._imu, "publish", published.append)
        simulate(True)
        node.get_clock().set_ros_time_override(Time(seconds=5.0))  # type: ignore[attr-defined]
        assert published_at_s() == pytest.approx(5.0, abs=1.0)
        simulate(False)
        assert published_at_s() == pytest.approx(time.time(), abs=1.0)
        publishing._time_watch.unregister()  # rcl would go on calling one that is no more


def test_joints_do_not_jump_when_the_wheels_are_said_to_be_of_another_size(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot that has come far and stands does not turn them."""
    publishing = publishing_of(node)
    published: list[bytes] = []
    monkeypatch.setattr(publishing._joints, "publish", published.append)
    far = OdometryEstimate(1.0, Pose(), None, Covariance(), rolled=Pose(100.0, 20.0, 3.0))
    publishing.publish([far], 0)
    other = {**VALUES, "wheel_radius": 0.0295, "base_radius": 0.15}
    publishing.settings = MessageSettings.from_parameters(other)
    publishing.publish([far], 0)
    before, after = (deserialize_message(data, JointState).position for data in published)
    assert before == after
