# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the report on a running driver."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from driver_process import Driver
from probe import Probe


def report(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "omnibot_driver.tools.report", "--output", folder, *arguments],
        env={**os.environ, "MPLCONFIGDIR": str(folder.parent), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_running_robot_is_listened_to(
    tmp_path: Path,
    start_driver: Callable[..., Driver],
    probe_of: Callable[[Driver], Probe],
) -> None:
    """``report --live`` finds the driver, and gives the same findings and pictures as for a bag."""
    driver = start_driver("sim://?seed=1")
    probe_of(driver).wait_for_state("nominal")
    done = report(tmp_path / "out", "--live", "2")
    assert done.returncode in (0, 3), done.stderr
    assert "The rate of imu/data_raw is" in done.stdout
    assert "The rate of odom is" in done.stdout
    assert "ominal for" in done.stdout
    assert "Never latched" in done.stdout
    assert (tmp_path / "out/path.png").is_file()


def test_without_a_driver_it_says_so(tmp_path: Path) -> None:
    """Without a driver ``report --live`` prints one sentence and writes no files."""
    done = report(tmp_path / "out", "--live", "1", "--namespace", "absent")
    assert done.returncode == 1
    assert done.stderr.startswith("report: no driver was heard")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_if_ros_does_not_start_it_says_so(tmp_path: Path) -> None:
    """ROS refuses the domain. ``report --live`` prints one sentence instead of a traceback."""
    done = report(tmp_path / "out", "--live", "1", ROS_DOMAIN_ID="robots")
    assert done.returncode == 1
    assert done.stderr.startswith("report: ROS does not start: ")
    assert done.stderr.count("\n") == 1
