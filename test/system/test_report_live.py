# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the report on a running driver."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from driver_process import Driver
from probe import Probe

QUICKLY = """
import sys
from omnibot_driver.tools.report import page
from omnibot_driver.tools.report.__main__ import main
page.PICTURES = [picture for picture in page.PICTURES if picture[0] == "path"]
sys.exit(main(sys.argv[1:]))
"""
"""Python program that runs the report with only one of its pictures, to save time."""
IN_VAIN = """
import os, sys
from omnibot_driver.tools.report import live
from omnibot_driver.tools.report.__main__ import main
live.DISCOVERY_S = live.LOOK_ROUND_S
usual = os.environ["ROS_DOMAIN_ID"]
os.environ["ROS_DOMAIN_ID"] = "robots"
refused = main(sys.argv[1:])
os.environ["ROS_DOMAIN_ID"] = usual
sys.exit(10 * refused + main([*sys.argv[1:], "--namespace", "absent"]))
"""
"""Code that runs the report twice: in a domain that ROS refuses, and where no driver can be found.
"""


def report(code: str, folder: Path, seconds: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, "--output", folder, "--live", str(seconds)],
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_running_robot_is_listened_to(
    tmp_path: Path,
    start_driver: Callable[..., Driver],
    probe_of: Callable[[Driver], Probe],
) -> None:
    """``report --live`` finds a driver, and reports on its messages as on those of a bag."""
    driver = start_driver("sim://?seed=1")
    probe_of(driver).wait_for_state("nominal")
    done = report(QUICKLY, tmp_path / "out", 2)
    assert done.returncode in (0, 3), done.stderr
    assert "The rate of imu/data_raw is" in done.stdout
    assert "The rate of odom is" in done.stdout
    assert "ominal for" in done.stdout
    assert "Never latched" in done.stdout
    assert (tmp_path / "out/path.png").is_file()


def test_without_ros_or_a_driver_it_says_so(tmp_path: Path) -> None:
    """ROS refuses the domain, or there is no driver. ``report --live`` prints one sentence.

    It prints no traceback and writes no files.
    """
    done = report(IN_VAIN, tmp_path / "out", 1)
    assert done.returncode == 11
    assert "Traceback" not in done.stderr
    refused, absent = (line for line in done.stderr.splitlines() if "atplotlib" not in line)
    assert refused.startswith("report: ROS does not start: ")
    assert absent.startswith("report: no driver was found")
    assert not (tmp_path / "out").exists()
