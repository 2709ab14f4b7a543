# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a calibration's motions: each ends at rest, and an interrupted one gives its reason."""

import os
import signal
import time
from collections.abc import Callable, Mapping
from types import SimpleNamespace

import numpy as np
import pytest
from calibrate_rig import ATTEMPTS, BUSY_S, Rig, parameters_of
from driver_process import PATIENCE_S
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, Float32MultiArray

from omnibot_driver.parameters import Value
from omnibot_driver.simulator.omnibot import SimulatedBoard
from omnibot_driver.tools.calibrate import listener
from omnibot_driver.tools.calibrate import robot as robot_module
from omnibot_driver.tools.calibrate.interruption import Interrupted
from omnibot_driver.tools.calibrate.motion import Bounds, stairs
from omnibot_driver.tools.calibrate.robot import Robot
from omnibot_driver.tools.needs import ToolError

SLOWLY = (0.15, 0.0, 0.0)
BOUNDS = Bounds(speed=0.2, turning=0.5, way=0.8, turn=1.0, seconds=20.0, acceleration=1.0)
AFTER_S = 0.4
LOST_S = listener.LOST_S


def stands(board: SimulatedBoard) -> bool:
    return not board.driven and max(map(abs, board.rim_speeds_mps)) < 0.001


def once(action: Callable[[], object]) -> Callable[[float], None]:
    """Return a callback that calls ``action`` once, ``AFTER_S`` seconds after the motion began."""
    left = [action]

    def show(seconds: float) -> None:
        if seconds > AFTER_S and left:
            left.pop()()

    return show


def repeated(action: Callable[[], object]) -> Callable[[float], None]:
    """Return a callback that calls ``action`` at each call after ``AFTER_S`` seconds of motion."""
    return lambda seconds: action() if seconds > AFTER_S else None


def test_a_motion_is_what_was_asked_for_and_ends_at_rest(robot: Robot, rigged: Rig) -> None:
    """A motion follows its commands and ends at rest.

    The log has the commands and the measurements.
    """
    for _ in range(ATTEMPTS):
        before = rigged.port.board.truth
        log = robot.drive(stairs([(1.0, (0.0, 0.15, 0.3))]), BOUNDS)
        assert rigged.port.wait_for(stands, PATIENCE_S)
        after = rigged.port.board.truth
        # Each command is in effect until the next one.
        told = np.diff(log.commands.stamp_s) @ log.commands.values[:-1, 2]
        assert told > 0.2
        is_right = after.yaw_rad - before.yaw_rad == pytest.approx(told, abs=0.03)
        if is_right:  # on a busy computer, driver or board may get a command late
            break
    assert is_right, (before, after, told)
    assert log.odometry.pose[-1, 2] - log.odometry.pose[0, 2] == pytest.approx(
        after.yaw_rad - before.yaw_rad, abs=0.005
    )
    assert log.commands.values.max() == 0.3
    assert not log.commands.values[-1].any()
    assert len(log.imu.stamp_s) > len(log.odometry.stamp_s)


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("estop", "the e-stop is latched"),
        ("reboot", "the driver reported the state"),
        ("other", "another node commands the robot on cmd_vel"),
        ("wheels", "another node commands the robot on wheel_cmd"),
        ("signal", "interrupted: the robot is stopped"),
    ],
)
def test_what_happens_on_the_way_ends_it_at_rest(
    robot: Robot, rigged: Rig, what: str, sentence: str
) -> None:
    """The e-stop, a reboot, commands of another node or ctrl-C interrupt a motion.

    The robot comes to rest. The error gives the reason.
    """
    node = robot._node
    estop = node.create_publisher(Bool, "estop", 10)
    other = node.create_publisher(Twist, "cmd_vel", 1)
    wheels = node.create_publisher(Float32MultiArray, "wheel_cmd", 1)
    actions = {
        "estop": lambda: estop.publish(Bool(data=True)),
        "reboot": rigged.port.board.reboot,
        "other": lambda: other.publish(Twist()),
        "wheels": lambda: wheels.publish(Float32MultiArray(data=[0.0, 0.0, 0.0])),
        "signal": lambda: os.kill(os.getpid(), signal.SIGINT),
    }
    shown = {each: once(action) for each, action in actions.items()}
    for each in ("other", "wheels"):  # a single message may be lost while the tool is held up
        shown[each] = repeated(actions[each])
    publishers = [(estop, 1), (other, 2), (wheels, 2)]  # the driver; for commands, also the tool
    assert robot._wait(
        lambda: all(each.get_subscription_count() >= count for each, count in publishers),
        PATIENCE_S,
    )
    with pytest.raises(ToolError, match=sentence) as caught:
        robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS, show=shown[what])
    assert rigged.port.wait_for(stands, PATIENCE_S)
    assert not robot.log.commands.values[-1].any()
    assert isinstance(caught.value, Interrupted) is (what == "signal")
    if what == "estop":
        with pytest.raises(ToolError, match=sentence):
            robot.rest(1.0)
        robot.call("estop", False)
    if what == "reboot":
        robot.call("start")


def test_a_computer_too_slow_for_the_imu_still_hears_the_estop(
    robot: Robot, rigged: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """IMU messages arrive faster than the tool reads them.

    The tool still receives the e-stop.
    """
    estop = robot._node.create_publisher(Bool, "estop", 10)
    assert robot._wait(estop.get_subscription_count, PATIENCE_S)
    (imu,) = (each for each in robot._node.subscriptions if each.msg_type is Imu)
    with monkeypatch.context() as slow:
        slow.setattr(imu, "callback", lambda _message: time.sleep(0.02))  # two IMU periods
        robot._hear(0.5)
        estop.publish(Bool(data=True))
        assert robot._wait(lambda: robot._estop, PATIENCE_S)
    robot.call("estop", False)


def test_a_value_of_the_diagnostics_is_found_by_its_name(robot: Robot, rigged: Rig) -> None:
    """``diagnosed`` returns the value with a given name from the driver's diagnostics."""
    assert robot.diagnosed("Port") == rigged.port.path


def test_a_robot_that_goes_too_far_is_stopped(robot: Robot, rigged: Rig) -> None:
    """The tool stops a robot that goes too far by its odometry.

    The tool also refuses to send a command that is above the speed limit.
    """
    near = Bounds(speed=0.2, way=0.05, seconds=20.0, acceleration=1.0)
    with pytest.raises(
        ToolError, match=r"limit of this drive \(it was 0\.\d\d m from its start, 0\.05"
    ):
        robot.drive(stairs([(10.0, SLOWLY)]), near)
    assert rigged.port.wait_for(stands, PATIENCE_S)
    with pytest.raises(ToolError, match="exceeds the limits of this calibration"):
        robot.drive(stairs([(1.0, (0.3, 0.0, 0.0))]), near)
    assert not robot.log.commands.values.any()


def test_a_robot_that_does_not_move_is_told_so(robot: Robot, rigged: Rig) -> None:
    """The tool reports that the robot does not move although it is commanded.

    The test sets ``linear_scale`` to 1 LSB per m/s, so every command is rounded to zero.
    """
    robot.set_parameters({"linear_scale": 1.0})
    with pytest.raises(ToolError, match="does not move when commanded"):
        robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS)
    robot.set_parameters({"linear_scale": 70.0})


def test_an_interruption_leaves_the_motion_monitor_on(robot: Robot, rigged: Rig) -> None:
    """Ctrl-C interrupts a motion for which the tool has switched the driver's motion monitor off.

    The tool switches the monitor on again.
    """
    seen = []

    def interrupt() -> None:
        seen.append(robot.parameters["motion_monitor"])
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(Interrupted):
        robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS, monitored=False, show=once(interrupt))
    assert seen == [False]
    assert parameters_of(rigged.driver)["motion_monitor"] is True
    assert rigged.port.wait_for(stands, PATIENCE_S)


@pytest.mark.parametrize("late", [False, True], ids=["before the request", "before its answer"])
def test_an_interruption_before_a_motion_leaves_the_motion_monitor_on(
    robot: Robot, rigged: Rig, late: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If ctrl-C comes before a motion, the motion monitor is on afterwards.

    No command was sent, so the message does not ask the user to cut the power.
    """
    set_parameters, presses = robot.set_parameters, [signal.SIGINT]

    def interrupted(values: Mapping[str, Value]) -> None:
        if presses and not late:
            os.kill(os.getpid(), presses.pop())
        set_parameters(values)
        if presses:
            os.kill(os.getpid(), presses.pop())
            robot._spin(0.0)

    monkeypatch.setattr(robot, "set_parameters", interrupted)
    with pytest.raises(Interrupted) as ended:
        robot.drive(stairs([(0.5, SLOWLY)]), BOUNDS, monitored=False)
    assert "cut its power" not in str(ended.value)
    assert parameters_of(rigged.driver)["motion_monitor"] is True


@pytest.mark.parametrize("behind_s", [0.7, -0.7])
def test_a_motion_is_not_evaluated_if_the_clocks_differ(
    robot: Robot, rigged: Rig, behind_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motion is not evaluated if the robot's clock differs from this computer's clock."""
    seconds = listener._seconds
    monkeypatch.setattr(listener, "_seconds", lambda message: seconds(message) - behind_s)
    sign = "-" if behind_s < 0 else ""
    with pytest.raises(ToolError, match=rf"arrives {sign}0\.\d\d s after .*chrony"):
        robot.drive(stairs([(0.5, SLOWLY)]), BOUNDS)
    assert rigged.port.wait_for(stands, PATIENCE_S)


def test_parameters_are_restored_after_an_interruption(robot: Robot, rigged: Rig) -> None:
    """After an interruption, the tool can still restore parameters of the driver.

    It can no longer set parameters for a measurement: ``set_parameters`` raises Interrupted.
    """
    robot.set_parameters({"linear_scale": 60.0})
    os.kill(os.getpid(), signal.SIGINT)
    with pytest.raises(Interrupted):
        robot.set_parameters({"linear_scale": 50.0})
    robot.restore_parameters({"linear_scale": 70.0})
    assert parameters_of(rigged.driver)["linear_scale"] == 70.0


def test_a_defect_leaves_the_motion_monitor_on(robot: Robot, rigged: Rig) -> None:
    """A bug in the tool interrupts a motion. The tool still switches the motion monitor on again.

    Otherwise, the driver's monitor would stay off until the driver restarts.
    """

    def fail() -> None:
        raise RuntimeError("a defect")

    with pytest.raises(RuntimeError, match="a defect"):
        robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS, monitored=False, show=once(fail))
    assert parameters_of(rigged.driver)["motion_monitor"] is True
    assert rigged.port.wait_for(stands, PATIENCE_S)


def test_a_program_that_was_suspended_moves_nothing_when_it_wakes_up(
    robot: Robot, rigged: Rig
) -> None:
    """A tool that was suspended during a motion moves nothing when it resumes.

    The driver has stopped the robot meanwhile. The tool sends only zero commands and ends with an
    error.
    """
    clock = SimpleNamespace(monotonic=time.monotonic)

    def suspend() -> None:
        clock.monotonic = lambda: time.monotonic() + BUSY_S

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_module, "time", clock)
        with pytest.raises(ToolError, match=r"this program did not run for \d\.\d s"):
            robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS, show=once(suspend))
    values = robot.log.commands.values
    halted = int(np.flatnonzero(values[:, 0])[-1]) + 1
    assert not values[halted:].any()
    assert rigged.port.wait_for(stands, PATIENCE_S)


def test_a_robot_that_is_not_seen_to_stand_is_to_be_cut_off(
    robot: Robot, rigged: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If a robot does not come to rest after Stop, the error advises the user to cut its power.

    If another error has ended the motion before, the message of that error also has this advice.
    """
    monkeypatch.setattr(robot_module, "STANDING", -1.0)
    monkeypatch.setattr(robot_module, "STANDS_WITHIN_S", 0.5)
    with pytest.raises(
        ToolError,
        match=r"^Stop was sent, but the robot still moves, or no odometry arrives",
    ):
        robot.drive(stairs([(0.5, SLOWLY)]), BOUNDS)
    near = Bounds(speed=0.2, way=0.05, seconds=20.0, acceleration=1.0)
    with pytest.raises(ToolError, match=r"at a limit of this drive .*; and Stop was sent, but"):
        robot.drive(stairs([(10.0, SLOWLY)]), near)


def test_an_odometry_of_nan_moves_no_robot(robot: Robot, rigged: Rig) -> None:
    """The odometry has NaN.

    A NaN position ends the motion, and a NaN twist does not prove a standstill.
    """
    nonsense = Odometry()
    nonsense.pose.pose.position.x = nonsense.twist.twist.linear.x = float("nan")

    def spoil(seconds: float) -> None:
        if seconds > AFTER_S:
            robot._on_odometry(nonsense, {"received_timestamp": 0})

    with pytest.raises(ToolError, match="contains NaN or infinity"):
        robot.drive(stairs([(10.0, SLOWLY)]), BOUNDS, show=spoil)
    assert rigged.port.wait_for(stands, PATIENCE_S)


def test_three_tenths_of_a_second_of_silence_are_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tool reports a topic as silent if it has no data for 0.3 s.

    Only the topics that a motion needs are checked.
    """
    monkeypatch.setattr(listener, "LOST_S", LOST_S)
    heard_s = {listener.IMU: 10.0, listener.ODOMETRY: 9.9}
    assert listener.silent(heard_s, listener.TOPICS, 10.19) == []
    assert listener.silent(heard_s, listener.TOPICS, 10.21) == [listener.ODOMETRY]
    assert listener.silent(heard_s, [listener.IMU], 10.29) == []
    assert listener.silent(heard_s, listener.TOPICS, 10.31) == list(listener.TOPICS)


def test_a_no_moves_and_writes_nothing(rigged: Rig, capsys: pytest.CaptureFixture[str]) -> None:
    """The user answers no, or the input ends. The tool moves nothing and writes nothing."""
    commands = len(rigged.port.board.commands)
    assert rigged.calibrate("scale", answer=lambda _question: "n") == 1
    assert "you said no" in capsys.readouterr().err

    def no_answer(_question: str) -> str:
        raise EOFError

    assert rigged.calibrate("scale", answer=no_answer) == 1
    assert "no answer to" in capsys.readouterr().err
    assert all(one.kind != "velocity" for one in list(rigged.port.board.commands)[commands:])
    assert not rigged.output.exists()


def test_ctrl_c_at_an_open_question_ends_it(
    rigged: Rig, capsys: pytest.CaptureFixture[str]
) -> None:
    """The user presses ctrl-C at a question.

    The tool exits with code 130, and the robot does not move.
    """

    def interrupt(_question: str) -> str:
        os.kill(os.getpid(), signal.SIGINT)
        return "y"

    commands = len(rigged.port.board.commands)
    assert rigged.calibrate("scale", answer=interrupt) == 130
    assert "calibrate: interrupted" in capsys.readouterr().err
    assert all(one.kind != "velocity" for one in list(rigged.port.board.commands)[commands:])


def test_a_driver_that_is_gone_ends_it(robot: Robot, rigged: Rig) -> None:
    """The driver is killed during a motion. Its guard stops the robot.

    The tool reports missing data. This must be the module's last test: the driver is shared.
    """

    def kill() -> None:
        rigged.driver.process.kill()
        patch.setattr(listener, "LOST_S", LOST_S)

    def kill_once_it_moves(seconds: float) -> None:
        if seconds > AFTER_S and max(map(abs, robot._twist)) > 0.05:
            kill_once(seconds)

    kill_once = once(kill)

    with (
        pytest.MonkeyPatch.context() as patch,
        pytest.raises(ToolError, match=r"no messages on .* for 0\.3 s.*cut its power"),
    ):
        robot.drive(stairs([(30.0, SLOWLY)]), BOUNDS, show=kill_once_it_moves)
    assert rigged.port.wait_for(stands, PATIENCE_S)
