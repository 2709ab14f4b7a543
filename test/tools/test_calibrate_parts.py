# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the parts that all calibrations share: bounds, questions, tables and files."""

import io
import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver import boards, calibration
from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.readings import Vector3
from omnibot_driver.tools.calibrate.__main__ import main
from omnibot_driver.tools.calibrate.arguments import SUBCOMMANDS, require_able
from omnibot_driver.tools.calibrate.console import Console, digits
from omnibot_driver.tools.calibrate.files import draw, output_file, picture_file, save
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT, Bounds, Obedience, Topic, stairs
from omnibot_driver.tools.calibrate.result import Finding, Result
from omnibot_driver.tools.needs import ToolError

BOUNDS = Bounds(speed=0.3, turning=0.5, way=1.0, turn=2.0, seconds=10.0)
speeds = st.floats(-0.3, 0.3)
commands = st.tuples(speeds, speeds, speeds)


def watch(topic: Topic, command: Vector3, measured: Vector3) -> None:
    """Check for two simulated seconds whether a robot obeys ``command``.

    ``measured``: the velocity of the robot during this time. It is constant.
    """
    obedience = Obedience(topic, PARAMETERS.by_name)
    for tick in range(200):
        obedience.look(tick / 100, 0.01, command, measured)


def test_a_robot_with_slow_odometry_is_watched_for_longer() -> None:
    """If the odometry is slow, the tool waits 3 s before it reports a robot that does not move."""
    obedience = Obedience("cmd_vel", {"odom_rate": 20.0})
    still, ahead = (0.0, 0.0, 0.0), (0.2, 0.0, 0.0)
    for tick in range(250):
        obedience.look(tick / 100, 0.01, ahead, still)
    with pytest.raises(ToolError, match="check the motors' power, and what the driver logs"):
        obedience.look(3.5, 0.01, ahead, still)


def test_a_front_wheel_may_turn_before_the_robot_moves() -> None:
    """A robot is commanded to turn, but stands for 1.3 s while its front wheel turns sideways.

    The tool accepts this delay without an error, because the front wheel is steered.
    """
    obedience = Obedience("cmd_vel", boards.load("fejemis").PARAMETERS.by_name)
    still, turning = (0.0, 0.0, 0.0), (0.0, 0.0, 0.5)
    for tick in range(350):
        obedience.look(tick / 100, 0.01, turning, still if tick < 130 else turning)


def console(*answers: str, yes: bool = False) -> tuple[Console, io.StringIO]:
    """Return a console that reads these answers, and the buffer to which it writes its texts."""
    shown, left = io.StringIO(), list(answers)
    return Console(yes=yes, read=lambda _question: left.pop(0), file=shown), shown


@given(commands, commands, st.floats(0.002, 0.1))
def test_a_command_changes_no_faster_than_allowed(
    now: tuple[float, float, float], wanted: tuple[float, float, float], seconds: float
) -> None:
    """Commands approach a target as fast as the acceleration limits allow, and reach it.

    The linear velocity is limited as a vector, and the yaw rate separately.
    """
    then = BOUNDS.approach("cmd_vel", now, wanted, seconds)
    assert math.dist(then[:2], now[:2]) <= 0.3 * seconds + 1e-12
    assert abs(then[2] - now[2]) <= 0.8 * seconds + 1e-12
    for _ in range(2000):
        now = BOUNDS.approach("cmd_vel", now, wanted, seconds)
    assert now == wanted


@pytest.mark.parametrize(
    "command", [(0.31, 0.0, 0.0), (0.25, 0.25, 0.0), (0.0, 0.0, -0.6), (math.nan, 0.0, 0.0)]
)
def test_a_command_beyond_the_bounds_is_refused(command: tuple[float, float, float]) -> None:
    """The tool rejects a command that exceeds the limits of the calibration, or contains NaN.

    On ``cmd_vel``, the speed limit applies to the length of the vector (x, y). On ``wheel_cmd``, it
    applies to each wheel rate.
    """
    with pytest.raises(ToolError, match="exceeds the limits of this calibration"):
        BOUNDS.require_allowed("cmd_vel", command)
    wheels = Bounds(speed=5.0, way=1.0, seconds=1.0)
    wheels.require_allowed("wheel_cmd", (5.0, -5.0, 5.0))
    with pytest.raises(ToolError, match="wheel_cmd"):
        wheels.require_allowed("wheel_cmd", (5.1, 0.0, 0.0))


def test_a_robot_out_of_bounds_is_told_by_how_much() -> None:
    """If a robot drives too far, turns too much or takes too long, the error gives the value.

    A pose that is not finite is an error, too.
    """
    BOUNDS.require_within(9.0, Pose(0.6, 0.6, -1.9))
    for seconds, pose, sentence in (
        (1.0, Pose(0.8, 0.8, 0.0), "1.13 m"),
        (1.0, Pose(0.0, 0.0, -2.1), "2.1 rad"),
        (11.0, Pose(), "11 s"),
        (1.0, Pose(math.nan, 0.0, 0.0), "contains NaN or infinity"),
        (1.0, Pose(0.0, 0.0, math.inf), "contains NaN or infinity"),
    ):
        with pytest.raises(ToolError, match=sentence):
            BOUNDS.require_within(seconds, pose)


def test_a_robot_obeys_slowly_and_roughly_but_it_obeys() -> None:
    """The tool raises an error if the robot moves at less than a fifth of the commanded velocity.

    A measured NaN is also an error. Very slow commands are not checked.
    """
    watch("cmd_vel", (0.2, 0.0, 0.4), (0.05, 0.0, 0.1))
    watch("cmd_vel", (0.02, 0.0, 0.0), HALT)
    with pytest.raises(ToolError, match=r"does not move when commanded \(wheel_cmd\)"):
        watch("wheel_cmd", (0.0, 3.0, 0.0), (0.1, 0.1, 0.1))
    for measured in ((0.2, 0.0, 0.0), (math.nan, 0.0, 0.4)):
        with pytest.raises(ToolError, match=r"does not move when commanded \(cmd_vel\)"):
            watch("cmd_vel", (0.2, 0.0, 0.4), measured)


def test_stairs_are_climbed_one_by_one() -> None:
    """``stairs`` returns the commands one after the other. Each lasts for its own duration.

    After the last command, it returns None, which ends the motion.
    """
    law = stairs([(1.0, (1.0, 0.0, 0.0)), (2.0, HALT), (1.0, (0.0, 1.0, 0.0))])
    assert [law(t, Pose()) for t in (0.0, 0.99, 1.0, 2.9, 3.5)] == [
        (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), HALT, HALT, (0.0, 1.0, 0.0),
    ]  # fmt: skip
    assert law(4.0, Pose()) is None


def test_an_empty_log_has_empty_columns() -> None:
    """A log without entries has columns with zero rows, so calculations need no special case."""
    log = Log()
    assert log.imu.rate_radps.shape == log.odometry.pose.shape == (0, 3)
    assert log.wheels.angle_rad.shape == log.wheels.rate_radps.shape == (0, 0)
    assert log.commands.values.shape == (0, 3)


def test_wheels_are_as_many_as_the_robot_has() -> None:
    """``wheels`` separates the angles from the rates of all wheels.

    A wheel row of the log has the time, then all angles, then all rates.
    """
    log = Log(wheel_rows=[(0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 5.0, 6.0, 7.0, 8.0)])
    assert log.wheels.angle_rad.tolist() == [[1.0, 2.0], [5.0, 6.0]]
    assert log.wheels.rate_radps.tolist() == [[3.0, 4.0], [7.0, 8.0]]


def test_a_question_is_repeated_until_the_answer_makes_sense() -> None:
    """The console repeats a question until its answer is valid.

    A decimal comma is accepted, and an empty answer means no.
    """
    asks, shown = console("ten", "nan", "-5", "0,25", "", "yes", "n")
    assert asks.number("How far", "m", 0.0, 1.0) == 0.25
    assert shown.getvalue().count("Please type a number from 0 to 1, in m.") == 3
    assert [asks.asks("Sure?") for _ in range(3)] == [False, True, False]
    sure, shown = console(yes=True)
    sure.confirm("Sure?")
    assert "yes (--yes)" in shown.getvalue()


def test_a_table_in_a_pipe_is_plain_text() -> None:
    """A table in a pipe has no colours. A value has as many digits as its uncertainty allows."""
    asks, shown = console()
    findings = [
        Finding(name="linear_scale", value=80.12345, sigma=0.0234, unit="LSB/(m/s)", before=70.0),
        Finding(name="delta_frame", value="body", before="earth"),
    ]
    asks.table("Found", findings)
    assert digits(findings[0]) == ("80.123", "0.023", "70.000")
    assert digits(findings[1]) == ("body", "", "earth")
    assert "\x1b" not in shown.getvalue()
    assert "80.123" in shown.getvalue()


def result(**parameters: object) -> Result:
    return Result(
        findings=[],
        parameters=parameters,  # type: ignore[arg-type]
        draw=lambda figure: figure.subplots().plot([1, 2]),
    )


def test_what_is_written_is_what_the_driver_loads(tmp_path: Path) -> None:
    """The driver loads the values that a calibration saves. Other entries of the file are kept."""
    path = tmp_path / "robot.yaml"
    path.write_text("name: number 7\ngyro_bias: [0.0, 0.0, 0.1]\nlinear_scale: 71.0\n")
    save(result(linear_scale=80.5, axis_signs=[1, -1, 1]), path, PARAMETERS)
    assert calibration.load(path, PARAMETERS) == {
        "gyro_bias": [0.0, 0.0, 0.1], "linear_scale": 80.5, "axis_signs": [1, -1, 1],
    }  # fmt: skip
    assert yaml.safe_load(path.read_text())["name"] == "number 7"


def test_what_the_driver_would_refuse_is_not_written(tmp_path: Path) -> None:
    """A value out of range is not written, because the driver would refuse to start with it."""
    path = tmp_path / "robot.yaml"
    with pytest.raises(ToolError, match="parameter 'linear_scale' must be"):
        save(result(linear_scale=1e9), path, PARAMETERS)
    assert not path.exists()


def test_folders_are_made_where_there_are_none(tmp_path: Path) -> None:
    """The folders of the calibration file and of the picture are missing.

    The tool accepts both paths, and makes the folders when it saves the files.
    """
    path, picture = tmp_path / "a" / "b" / "robot.yaml", tmp_path / "c" / "d" / "picture.png"
    assert output_file(str(path), "", PARAMETERS) == path
    assert picture_file(str(picture), "imu") == picture
    save(result(linear_scale=80.5), path, PARAMETERS)
    draw(result(linear_scale=80.5), path, picture)
    assert path.exists()
    assert picture.exists()


def test_axis_signs_gyro_bias_and_linear_scale_may_be_written() -> None:
    """A calibration is allowed to write axis_signs, gyro_bias and linear_scale."""
    assert {"axis_signs", "gyro_bias", "linear_scale"} < set(PARAMETERS.calibrated)


def test_files_that_will_not_do_are_told_before_anything_moves(tmp_path: Path) -> None:
    """The tool rejects a file that it cannot use for the calibration or for the picture."""
    ros = tmp_path / "driver.yaml"
    ros.write_text("/**:\n  ros__parameters:\n    port: x\n")
    with pytest.raises(ToolError, match="is a file of ROS parameters"):
        output_file(str(ros), "", PARAMETERS)
    (tmp_path / "bad.yaml").write_text("gyro_bias: 1")
    with pytest.raises(ToolError, match="or name another file with --output"):
        output_file(str(tmp_path / "bad.yaml"), "", PARAMETERS)
    with pytest.raises(ToolError, match="cannot be written"):
        picture_file(str(ros / "picture.png"), "imu")
    with pytest.raises(ToolError, match=r"the name must end in \.png"):
        picture_file(str(tmp_path / "picture.doc"), "imu")
    assert picture_file(str(tmp_path), "imu") == tmp_path / "calibrate_imu.png"
    assert output_file(None, str(tmp_path / "own.yaml"), PARAMETERS) == tmp_path / "own.yaml"


@pytest.mark.parametrize(
    "words", [[], ["nonsense"], ["imu", "--minutes", "0"], ["scale", "--levels", "x"]]
)
def test_wrong_usage_is_exit_code_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The user gives wrong arguments. The tool prints a message on stderr and exits with code 2."""
    assert main(words) == 2
    assert "calibrate" in capsys.readouterr().err


@pytest.mark.parametrize(("what", "thing"), [("imu", "an IMU"), ("step", "a wheel controller")])
def test_what_the_board_cannot_do_is_refused_in_one_sentence(what: str, thing: str) -> None:
    """A calibration needs something that a board lacks. The tool refuses it in one sentence.

    The OmniBot lacks nothing, so the tool refuses none of the calibrations.
    """
    for subcommand in SUBCOMMANDS:
        require_able(subcommand, PARAMETERS.by_name)
    with pytest.raises(
        ToolError, match=f"^calibrate {what} needs {thing}.* the board few does not have$"
    ):
        require_able(what, {"board": "few", "odom_frame": "odom"})


def test_step_is_refused_where_the_control_of_a_wheel_is_not_known() -> None:
    """``calibrate step`` is refused for a MART, which has no commands for single wheels."""
    with pytest.raises(ToolError, match=r"the board mart does not have$"):
        require_able("step", boards.check_all({"board": "mart"}))
