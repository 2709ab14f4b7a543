# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that a command line is split into ROS arguments and the tool's own arguments."""

from omnibot_driver.ros_arguments import split_ros_arguments


def test_ros_arguments_are_told_from_ours() -> None:
    """ROS arguments lie between ``--ros-args`` and ``--``, as in rclpy."""
    words = ["imu", "--yes", "--ros-args", "-r", "cmd_vel:=other", "--", "--minutes", "2"]
    own, ros = split_ros_arguments(words)
    assert own == ["imu", "--yes", "--minutes", "2"]
    assert ros == ["--ros-args", "-r", "cmd_vel:=other", "--"]
