# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver in a shell in which ROS is not set up, or set up wrongly."""

import os
import subprocess
import sys

import pytest

WITHOUT = """
import runpy, sys

sys.modules[{library!r}] = None
runpy.run_module("omnibot_driver.driver", run_name="__main__")
"""


@pytest.mark.parametrize("library", ["rclpy", "nav_msgs", "serial"])
def test_it_says_what_is_missing_and_what_to_do(library: str) -> None:
    """A library is missing. The driver names it in one line and says how to set up ROS."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT.format(library=library)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert library in done.stderr
    assert "source /opt/ros/jazzy/setup.bash" in done.stderr


def started_with(**environment: str) -> subprocess.CompletedProcess[str]:
    """Run a driver that cannot start in this environment. Return the result of its process.

    ``environment``: environment variables that are set in addition to the present ones.
    """
    return subprocess.run(
        [sys.executable, "-m", "omnibot_driver.driver", "--ros-args", "-p", "port:=sim://"],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_it_says_that_a_domain_is_too_large() -> None:
    """ROS_DOMAIN_ID is too large. The driver ends and says so.

    Without the driver's check, Fast DDS would end the driver without a message.
    """
    done = started_with(ROS_DOMAIN_ID="233")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "omnibot_driver cannot start: ROS_DOMAIN_ID is 233; Fast DDS allows at most 232\n"
    )


def test_what_ros_says_about_a_missing_middleware_is_not_lost() -> None:
    """The value of RMW_IMPLEMENTATION is misspelt. ROS ends the driver and prints the reason."""
    done = started_with(RMW_IMPLEMENTATION="rmw_fastdds_cpp")
    assert done.returncode not in (0, None)
    assert "rmw_fastdds_cpp" in done.stderr
