# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``calibrate step`` for a LOIS ECU as a whole: its result, and how it ends early."""

from pathlib import Path

import pytest
from lois_robot import SimulatedRobot, random_motors

from omnibot_driver.boards.lois_ecu import PARAMETERS
from omnibot_driver.tools.calibrate import pi_step, step
from omnibot_driver.tools.calibrate.arguments import command_line, require_able
from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.interruption import Interrupted
from omnibot_driver.tools.needs import ToolError


def test_whoever_has_gains_as_parameters_can_do_it() -> None:
    """``calibrate step`` accepts every driver that has parameters for gains, with any board."""
    values = PARAMETERS.check_all({})
    require_able("step", values)
    with pytest.raises(ToolError, match="the OmniBot's wheels"):
        require_able("commission", values)


def test_a_robot_is_calibrated_from_its_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``calibrate step`` finds the constants of both wheels, and sets corrections and gains.

    The robot has encoder marks that are 10 % off, unequal wheels, dead time and backlash.
    Afterwards, the tick period is as before.
    """
    monkeypatch.setattr(pi_step, "ROUNDS", 1)
    motors = random_motors(5)
    robot = SimulatedRobot(tmp_path, motors)
    words = ["step", "--yes", "--records", "5", "--responses", "1", "--samples", "100"]
    result = step.run(robot, Console(yes=True), command_line().parse_args(words))
    found = {finding.name: finding for finding in result.findings}
    for side, motor in zip(("left", "right"), motors, strict=True):
        for one, planted_s in (
            ("slow", motor.time_constant_s),
            ("fast", motor.second_time_constant_s),
        ):
            value = float(found[f"{side}: {one} time constant"].value)
            assert value == pytest.approx(planted_s, rel=0.1)
        assert found[f"{side}: overshoot, measured"].before is not None
        assert f"The {side} wheel, with the new gains: a step to" in " ".join(result.notes)
    assert "not kept" not in " ".join(result.notes)
    names = {f"{side}_{gain}" for side in ("left", "right") for gain in ("kp", "tn", "td")}
    levels_of = {f"{side}_{n}_correction" for side in ("left", "right") for n in ("short", "long")}
    assert set(result.parameters) == names | levels_of
    assert {name: robot.parameters[name] for name in result.parameters} == result.parameters
    assert robot.parameters["drive_mode"] == "rpm"
    robot.rest(3.0)
    assert robot.board._timers[0x12].period_ms == 400
    gains = robot.board.wheels[1].controller.gains
    assert gains.kp == pytest.approx(result.parameters["right_kp"])
    assert gains.td == pytest.approx(result.parameters["right_td"])
    assert all(name in PARAMETERS.calibrated for name in result.parameters)


@pytest.mark.parametrize(("limit", "value"), [("max_duty", 99), ("max_wheel_speed", 5.9)])
def test_a_limit_that_reduces_the_full_duty_is_named(
    tmp_path: Path, limit: str, value: float
) -> None:
    """If a parameter of the driver reduces the full duty, the tool's error names the parameter.

    Otherwise, the measured gain and dead zone would be wrong.
    """
    robot = SimulatedRobot(tmp_path, random_motors(5))
    robot.set_parameters({limit: value})
    with pytest.raises(ToolError, match=f"but {limit} .* reduces it"):
        step.run(robot, Console(yes=True), command_line().parse_args(["step", "--yes"]))


def test_values_that_an_ended_measurement_leaves_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tool ends early. It cannot restore the parameters that had no value before.

    Its error names these parameters.
    """

    def fail(*_arguments: object) -> None:
        raise ToolError("the robot does not move")

    monkeypatch.setattr(pi_step, "fit", fail)
    robot = SimulatedRobot(tmp_path, random_motors(5))
    words = ["step", "--yes", "--records", "1", "--responses", "1", "--samples", "100"]
    with pytest.raises(ToolError, match=r"not move; .* left_short_correction, .*; restart both"):
        step.run(robot, Console(yes=True), command_line().parse_args(words))
    assert robot.parameters["left_short_correction"] is not None


@pytest.mark.parametrize(("set_s", "own_ms"), [(None, 200), (None, 400), (0.1, 400)])
def test_the_gains_are_tuned_for_the_period_with_which_the_board_sends_its_ticks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, set_s: float | None, own_ms: int
) -> None:
    """The board measures the wheels late while it sends ticks. The tool needs the sending period.

    If the user has not set ``ticks_period``, the tool uses the period that the driver has measured.
    """
    periods_s: list[float] = []

    def ends(*_arguments: object, sends_each_s: float) -> None:
        periods_s.append(sends_each_s)
        raise ToolError("seen")

    monkeypatch.setattr(pi_step, "Loop", ends)
    robot = SimulatedRobot(tmp_path, random_motors(5))
    robot.board._timers[0x12].period_ms = own_ms
    robot.set_parameters({"ticks_period": set_s})
    robot.rest(4.0)
    with pytest.raises(ToolError, match="seen"):
        step.run(robot, Console(yes=True), command_line().parse_args(["step", "--yes"]))
    assert periods_s == [pytest.approx(set_s or own_ms / 1000, rel=0.12)]


def test_an_interrupted_measurement_restores_the_parameters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C interrupts the tool during a record.

    The tool then sets the driver's parameters to the values that they had before the measurement.
    """
    robot = SimulatedRobot(tmp_path, random_motors(5))
    robot.set_parameters({"ticks_period": 0.2})
    before = dict(robot.parameters)
    during: list[dict[str, object]] = []

    def interrupt(*_arguments: object) -> None:
        during.append(dict(robot.parameters))
        monkeypatch.setattr(robot, "set_parameters", interrupt)  # refused after an interruption
        raise Interrupted("interrupted")

    monkeypatch.setattr(robot, "restore_parameters", robot.set_parameters)
    monkeypatch.setattr(robot, "record", interrupt)
    words = ["step", "--yes", "--records", "1", "--responses", "1", "--samples", "100"]
    with pytest.raises(Interrupted):
        step.run(robot, Console(yes=True), command_line().parse_args(words))
    assert during[0]["ticks_period"] == pi_step.QUIET_S
    assert robot.parameters == before
