# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that docs/tools/report.md lists the subjects and the limits of the report."""

import ast
import re
from pathlib import Path

import pytest

from omnibot_driver.core.imu.scale import ACCEL_TOLERANCE
from omnibot_driver.tools.report import clocks, events, following, log, rhythm, sensing, travel

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs/tools/report.md").read_text()
ROWS = dict(re.findall(r"^\| (\S+) \| [^|]+ \| ([^|]+) \|$", DOCUMENT, re.MULTILINE))


def test_every_subject_has_a_row() -> None:
    """The table in docs/tools/report.md lists exactly the subjects of the findings in the code."""
    subjects = {
        node.args[1].value
        for file in (ROOT / "omnibot_driver/tools/report").glob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) == "Finding"
        and isinstance(node.args[1], ast.Constant)
    }
    assert subjects == set(ROWS) - {"Subject"}


@pytest.mark.parametrize(
    ("subject", "limit"),
    [
        ("Recording", f"{clocks.LEAST_STEP_S:g} s"),
        ("State", f"{100 * events.LONG_OUT_OF_REACH:g} %"),
        ("E-stop", f"{following.AFTER_STOP_S:g} s"),
        ("Timing", f"{100 * rhythm.RATE_TOLERANCE:g} %"),
        ("Timing", f"{100 * rhythm.UNEVEN:g} % of a period"),
        ("Timing", f"{1e3 * rhythm.LATE_S:g} ms"),
        ("Gaps", f"{rhythm.LONG_GAP_S:g} s or {100 * rhythm.MANY_LOST:g} %"),
        ("Commands", f"{log.COMMAND_TIMEOUT_S:g} s in motion"),
        ("Commands", f"{100 * following.TOLERANCE:g} %"),
        ("Commands", f"constant for {following.STEADY_S:g} s"),
        ("Commands", f"for {following.SUSTAINED_S:g} s"),
        ("Commands", f"wheels: {following.SLOW_START_S:g} s"),
        ("Odometry", f"{travel.LEAP_M:g} m or {travel.LEAP_RAD:g} rad"),
        ("IMU", f"{100 * sensing.SLIGHT_ERROR:g} %"),
        ("IMU", f"{100 * ACCEL_TOLERANCE:g} %"),
        ("IMU", f"{sensing.LARGEST_BIAS_RADPS:g} rad/s"),
        ("IMU", f"{sensing.LARGEST_TILT_DEG:g}°"),
        ("IMU", f"{100 * sensing.TURN_TOLERANCE:g} %"),
        ("IMU", f"{sensing.STRONG_VIBRATION_MPS2:g} m/s²"),
    ],
)
def test_the_limits_are_those_of_the_code(subject: str, limit: str) -> None:
    """Each limit in the code is in the row of its subject in docs/tools/report.md."""
    assert limit in ROWS[subject]
