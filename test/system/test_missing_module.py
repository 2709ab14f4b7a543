# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver in a shell in which ROS is not set up."""

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
