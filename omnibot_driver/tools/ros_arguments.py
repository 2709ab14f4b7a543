# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A command line that is partly ROS's. Needs no ROS."""

from collections.abc import Sequence


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Ours, and what stands between ``--ros-args`` and ``--`` (or the end), with that marker."""
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
