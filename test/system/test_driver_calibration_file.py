# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the driver logs at its start about the calibration file and its entries."""

from collections.abc import Callable
from pathlib import Path

import pytest
from driver_process import Driver

Start = Callable[..., Driver]
WARNED = "calibration_file {} does not exist or is empty, so nothing is loaded from it"


def said_of(path: Path, start_driver: Start) -> str:
    """Start a driver with the calibration file, and return the log line about the file.

    There must be exactly one such line.
    """
    driver = start_driver("/dev/null", calibration_file=path)
    driver.wait_for_line("is not a serial port")
    (line,) = [line for line in driver.lines if "calibration_file" in line]
    return line


@pytest.mark.parametrize("is_there", [False, True])
def test_a_file_that_gives_nothing_is_told_and_the_driver_starts(
    start_driver: Start, tmp_path: Path, is_there: bool
) -> None:
    """The driver starts although the calibration file is missing or empty.

    It logs a warning about the file, because the user may have mistyped the path.
    """
    path = tmp_path / "robt.yaml"
    if is_there:
        path.write_text("# nothing yet\n")
    line = said_of(path, start_driver)
    assert "WARN" in line
    assert WARNED.format(path) in line
    assert "calibrate to create the file" in line


def test_what_a_file_gives_is_named_once(start_driver: Start, tmp_path: Path) -> None:
    """One log line names the parameters that the driver takes from the calibration file.

    The tools also write notes about the calibration into this file. The log line omits them.
    """
    path = tmp_path / "robot.yaml"
    path.write_text("axis_signs: [1, -1, -1]\nimu_rpy: [0, 0, 0]\nstep: {}\nlinear_scale: 80\n")
    line = said_of(path, start_driver)
    assert "INFO" in line
    assert line.endswith(f"calibration_file {path} sets axis_signs, linear_scale\n")


def test_names_that_are_not_read_are_told_with_the_nearest(
    start_driver: Start, tmp_path: Path
) -> None:
    """One warning lists all names in the calibration file that the driver does not read.

    For a mistyped name, the warning also gives the nearest known name.
    """
    path = tmp_path / "robot.yaml"
    path.write_text("axis_sings: [1, -1, -1]\nmax_linear_speed: 0.2\n7: 1\n")
    line = said_of(path, start_driver)
    assert "WARN" in line
    assert (
        f"{path} contains names that the driver ignores: axis_sings (the nearest known"
        " name: axis_signs)" in line
    )
    assert ", max_linear_speed (" in line
    assert ", 7 (" in line


def test_a_home_that_nobody_has_ends_the_start(start_driver: Start) -> None:
    """The file's path is in the home directory of an unknown user.

    The driver asks for the full path and exits with code 2.
    """
    driver = start_driver("/dev/null", calibration_file="~nosuchuser/c.yaml")
    driver.wait_for_line("the calibration_file ~nosuchuser/c.yaml cannot be found: .*full path")
    assert driver.end() == 2
    assert "Traceback" not in driver.output
