# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate commission`` with a real driver.

A simulated user sees the wheels turn and answers the questions.
"""

import math
from pathlib import Path
from typing import Any, ClassVar

import pytest
from calibrate_rig import parameters_of, rig
from seeing_user import User

from omnibot_driver import calibration
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.tools.calibrate import commission
from omnibot_driver.tools.calibrate.commission_result import Found, result_of
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.needs import ToolError


@pytest.fixture(autouse=True)
def _quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (
        ("JOG_S", 1.0),
        ("HELD_S", 0.5),
        ("TURN_RAD", 1.0),
        ("TURN_BY_HAND_S", 2.0),
        ("SETTLING_S", 0.3),
    ):
        monkeypatch.setattr(commission, name, value)


def told(capsys: pytest.CaptureFixture[str]) -> str:
    """Return the printed output as one line."""
    return " ".join(capsys.readouterr().out.split())


def test_the_whole_walk_finds_what_was_planted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The tool finds that a robot has reversed axes, a turned IMU, and deltas in the body's axes.

    The tool rejects the user's impossible first answer. A driver can load the calibration file.
    """
    with rig(
        tmp_path,
        axis_signs=(1, -1, -1),
        frame="body",
        imu_rpy_rad=(math.pi, 0.0, math.pi / 2),
    ) as robot:
        code = robot.calibrate("commission", answer=User(robot.port, "0++"))
        said = told(capsys)
        assert code == 0, said
        assert parameters_of(robot.driver)["motion_monitor"] is True
        assert "This result cannot be right: wheel A alone was commanded" in said
        assert "+y is reversed" in said
        assert "delta_frame is read at the start" in said
        assert robot.written() == {
            "control_method": "velocity",
            "delta_frame": "body",
            "axis_signs": [1, -1, -1],
            "imu_rpy": [3.1416, 0.0, 1.5708],
        }
        assert set(robot.written()) <= {*PARAMETERS.calibrated, *calibration.RECORDED}
        loaded = calibration.load(robot.output, PARAMETERS)
        assert list(loaded["axis_signs"]) == [1, -1, -1]
        assert loaded["delta_frame"] == "body"
        assert "xacro_args" in said
        assert (tmp_path / "calibrate_commission.png").stat().st_size > 10_000


def test_a_speed_limit_is_not_taken_for_positional_control(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """If ``max_linear_speed`` is too low for the test motions, the tool asks for a higher limit.

    At the limited speed, the tool could mistake the board for one under positional control.
    """
    with rig(tmp_path, {"max_linear_speed": 0.06}) as robot:
        assert robot.calibrate("commission", "--only", "board") == 1
        assert "raise max_linear_speed" in capsys.readouterr().err
        assert not robot.output.exists()


@pytest.mark.parametrize(
    ("planted", "found"),
    [
        ({"frame": "wheel_counts"}, {"delta_frame": "wheel_counts"}),
        ({"control": "position"}, {"control_method": "position"}),
    ],
)
def test_switch_and_deltas_are_told_by_the_data(
    planted: dict[str, Any], found: dict[str, str], tmp_path: Path
) -> None:
    """The tool finds ``control_method`` and ``delta_frame`` from odometry alone."""
    with rig(tmp_path, **planted) as robot:
        assert robot.calibrate("commission", "--only", "board", draws=False) == 0
        assert robot.written().items() >= found.items()


class Deaf:
    """A robot that accepts every command, but sends no measurements."""

    parameters: ClassVar[dict[str, Any]] = {one.name: one.default for one in PARAMETERS.rows}

    def drive(self, *_: object, **__: object) -> Log:
        return Log()


def walk(*answers: str) -> Found:
    """Run the part of ``calibrate commission`` for wheels and axes, with these answers.

    Return what it finds.
    """
    left = list(answers)
    found = Found(before=Deaf.parameters)
    commission.Walk(Deaf(), Console(read=lambda _question: left.pop(0))).wheels(found)
    assert not left
    return found


def test_an_axis_is_reversed_against_what_the_driver_has(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """If one axis is reversed, the tool finds the signs of all axes.

    A note mentions a mirror image of the robot. The answer "r" repeats the motion; an invalid
    answer repeats the question.
    """
    found = walk("r", "what?", "+00", "0+0", "00+", "-+0", "++-", "---")
    assert found.axis_signs == (1, -1, 1)
    assert "Please answer with three signs (each +, - or 0)" in told(capsys)
    assert any("a mirror image of the robot" in note for note in result_of(found).notes)


def test_wheels_that_are_all_reversed_are_mended_by_the_axes() -> None:
    """All wheels are reversed. The tool finds axis signs that correct cmd_vel and odom.

    A note names wheel_cmd and joint_states, which stay reversed.
    """
    found = walk("-00", "0-0", "00-", "+-0", "++-", "+++")
    assert found.axis_signs == (-1, -1, -1)
    assert any("wheel_cmd and joint_states stay" in note for note in result_of(found).notes)


def test_a_single_reversed_wheel_is_nothing_that_a_parameter_mends() -> None:
    """A single wheel is reversed. No parameter can correct this, only a change of the wiring.

    The tool's error therefore names the wheel.
    """
    with pytest.raises(ToolError, match="wheel B turns in the opposite direction to the other two"):
        walk("+00", "0-0", "00+")


def test_repeated_contradictory_answers_refer_to_the_documentation() -> None:
    """The user gives three contradictory answers. The tool ends and refers to the documentation."""
    with pytest.raises(ToolError, match=r"you saw wheel B turn.*docs/commissioning.md"):
        walk("000", "+++", "0-0")


def test_a_board_on_positional_control_leaves_the_axes_out() -> None:
    """The board is under positional control.

    The tool checks the wheels, but it cannot check the axes.
    """
    found = Found(before=Deaf.parameters, control_method="position")
    answers = ["+00", "0+0", "00+"]
    commission.Walk(Deaf(), Console(read=lambda _question: answers.pop(0))).wheels(found)
    assert found.axis_signs is None
    assert result_of(found).parameters == {"control_method": "position"}
