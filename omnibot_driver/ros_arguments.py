# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Separates the arguments for ROS from those for the program. This module does not need ROS."""

from collections.abc import Sequence


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the arguments for the program, and those for ROS.

    ROS gets everything from ``--ros-args`` to ``--``, including both markers.
    """
    own: list[str] = []
    ros: list[str] = []
    into = own
    for word in arguments:
        if word == "--ros-args":
            into = ros
        into.append(word)
        if word == "--" and into is ros:
            into = own
    return own, ros
