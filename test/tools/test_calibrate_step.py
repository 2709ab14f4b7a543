# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate step`` with a real driver.

The tool finds the constants of a motor, and prints, plots and saves them.
"""

from pathlib import Path
from types import SimpleNamespace

import pytest
from calibrate_rig import ATTEMPTS, rig, row

from omnibot_driver import calibration
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.simulator.omnibot.motors import MotorConstants
from omnibot_driver.tools.calibrate import step
from omnibot_driver.tools.calibrate.arguments import command_line
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.needs import ToolError

USUAL = MotorConstants()
UNSTEADY = "responds differently from step to step"
SLUGGISH = MotorConstants(pwm_per_count=35.0, time_constant_ticks=10.0, delay_ticks=1)


def test_a_planted_motor_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """``calibrate step`` finds the constants of the motor of wheel B within 5 %."""
    monkeypatch.setattr(step, "RUN_UP_S", 1.0)
    with rig(tmp_path, motors=(USUAL, SLUGGISH, USUAL)) as robot:
        for _ in range(ATTEMPTS):
            code = robot.calibrate("step", "--wheels", "B", "--hold", "0.7", "--steps", "4")
            table, errors = capsys.readouterr()
            if UNSTEADY not in table:
                break
    assert code == 0, table + errors
    for name, planted, tolerance in (
        ("B: gain", 1.0, 0.05),
        ("B: PWM per count", 35.0, 1.75),
        ("B: motor time constant", 0.1, 0.005),
        ("B: overshoot", 0.25, 0.08),  # calculated for this loop, with the delay below
    ):
        found, sigma = row(table, name)
        assert found == pytest.approx(planted, abs=tolerance), f"{name} in:\n{table}"
        assert 0 < sigma < tolerance
    delay_s, sigma = row(table, "B: motor delay")
    assert 0.0 < delay_s < 0.035  # planted: 0.01 s; a command may be a tick late on a busy host
    assert 0 < sigma < 0.004
    assert "wheels off the ground" in robot.questions[0]
    assert "The driver cannot set the gains" in table
    assert set(robot.written()) <= set(calibration.RECORDED)
    written = robot.written()["step"]
    found, _ = written["wheels"]["B"]["motor in the manual's control loop"]["PWM per count"]
    assert found == pytest.approx(35.0, abs=1.75)
    assert written["better_gains"][1] <= found + 0.01  # both are rounded values
    assert (tmp_path / "calibrate_step.png").stat().st_size > 20_000


def still(answer: str, *words: str) -> None:
    """Run ``calibrate step`` on a robot that cannot move.

    The user gives ``answer`` to all questions.
    """
    parameters = {parameter.name: parameter.default for parameter in PARAMETERS.rows}
    robot = SimpleNamespace(parameters=parameters)
    arguments = command_line().parse_args(["step", *words])
    step.run(robot, Console(read=lambda _question: answer), arguments)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--wheels", "D"], "one or more of the letters ABC"),
        (["--speeds", "12", "4"], "the slower one first"),
        (["--speeds", "4", "40"], "max_wheel_speed of 17"),
        (["--speeds", "4", "4.1"], "commands of 8 and 8 units"),
        (["--hold", "0.1"], "at least 0.5 s"),
    ],
)
def test_what_cannot_be_done_is_said_before_anything_moves(
    words: list[str], complaint: str
) -> None:
    """The user gives an invalid option. The tool refuses it with a reason before any motion."""
    with pytest.raises(ToolError, match=complaint):
        still("y", *words)


def test_a_no_moves_nothing() -> None:
    """The user answers no. ``calibrate step`` ends with an error before any motion."""
    with pytest.raises(ToolError, match="you said no"):
        still("n")
