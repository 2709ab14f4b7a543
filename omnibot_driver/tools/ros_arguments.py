# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Separate ROS's arguments from the program's own on a command line. Needs no ROS."""

from collections.abc import Sequence


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the program's own arguments, and those of ROS.

    ROS's arguments stand between ``--ros-args`` and ``--`` (or the end), and include both markers.
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
