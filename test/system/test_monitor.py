# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the monitor, in a terminal and in a pipe, with a driver on a simulated board."""

import json
import os
import signal
import sys
import termios
from collections.abc import Callable
from contextlib import ExitStack

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from pseudo_terminal import PseudoTerminal

from omnibot_driver.simulator.omnibot import PtyBoard, SimulatedBoard
from omnibot_driver.tools.monitor.__main__ import main
from omnibot_driver.tools.monitor.teleop import ZEROS


@pytest.fixture
def board(shared: tuple[PtyBoard, Driver]) -> PtyBoard:
    return shared[0]


@pytest.fixture
def driver(shared: tuple[PtyBoard, Driver]) -> Driver:
    return shared[1]


@pytest.fixture
def probe(shared_probe: Probe) -> Probe:
    return shared_probe


def newest(board: SimulatedBoard) -> tuple[str, tuple[int, ...]]:
    return (board.commands[-1].kind, board.commands[-1].values) if board.commands else ("", ())


def drives(board: SimulatedBoard) -> bool:
    return newest(board) in (
        ("velocity", (speed, 0, 0)) for speed in (10, 11)
    )  # 0.15 m/s: 10.5 LSB


def stands(board: SimulatedBoard) -> bool:
    return newest(board) == ("wheels", (0, 0, 0))


def steer(terminal: PseudoTerminal, board: PtyBoard, said: list[Twist]) -> None:
    """Press the key w until the robot drives and the test has received a motion command.

    A press may be lost in a stall, or before the subscription is discovered.
    """
    for _ in range(20):
        said.clear()
        terminal.type("w")
        if board.wait_for(lambda b: drives(b) and any(twist.linear.x for twist in said), 1.0):
            return
        wait_for_ticks(board, 60)  # until the monitor has sent its zeros
    raise AssertionError("the robot does not drive")


def wait_for_ticks(board: PtyBoard, ticks: int) -> None:
    """Wait until the board has made ``ticks`` more ticks, which are 10 ms each."""
    until = board.board.tick + ticks
    assert board.wait_for(lambda b: b.tick >= until, PATIENCE_S)


@pytest.fixture
def monitor_of(stack: ExitStack) -> Callable[..., PseudoTerminal]:
    def start(driver: Driver, *options: str) -> PseudoTerminal:
        command = [sys.executable, "-m", "omnibot_driver.tools.monitor", *options]
        terminal = PseudoTerminal([*command, "--namespace", f"/{driver.namespace}"])
        return stack.enter_context(terminal)

    return start


def test_a_snapshot_in_a_pipe_tells_what_is_so(
    probe: Probe, driver: Driver, board: PtyBoard, capsys: pytest.CaptureFixture[str]
) -> None:
    """The robot drives 0.5 m to the left.

    The monitor's JSON has the true pose, the rates and the state.
    """
    odometry = probe.listen(Odometry, "odom")
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.y = 0.4

    def drive() -> bool:
        commands.publish(twist)
        return bool(odometry and odometry[-1].pose.pose.position.y > 0.5)

    probe.wait_for(drive)
    commands.publish(Twist())
    assert board.wait_for(lambda b: abs(b.truth.vy_mps) < 1e-3, PATIENCE_S)
    assert main(["--json", "--namespace", driver.namespace]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    told = json.loads(output.out)
    with board.lock:
        truth = board.board.truth
    assert told["driver"] == f"/{driver.namespace}/omnibot_driver"
    assert (told["state"], told["estop"], told["troubles"]) == ("nominal", False, [])
    assert told["pose"]["y_m"] == pytest.approx(truth.y_m, abs=2e-3)
    assert told["pose"]["x_m"] == pytest.approx(truth.x_m, abs=2e-3)
    rates_hz = told["rates_hz"]
    assert rates_hz["imu/data_raw"] / rates_hz["odom"] == pytest.approx(4.0, rel=0.3)
    assert abs(told["imu"]["linear_acceleration_mps2"][2]) == pytest.approx(9.8, abs=0.5)
    assert told["diagnostics"]["Link"]["values"]["Port"] == board.path


def test_the_space_bar_latches_the_estop_and_two_keys_release_it(
    probe: Probe, driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """The user presses the space bar. The e-stop is latched, and the screen shows it.

    The keys R and y release it.
    """
    terminal = monitor_of(driver)
    terminal.wait_for("nominal")
    terminal.type(" ")
    assert board.wait_for(lambda b: any(c.kind == "estop" for c in b.commands), PATIENCE_S)
    terminal.wait_for("LATCHED")
    terminal.wait_for("R releases it")
    terminal.type("R")
    terminal.wait_for("Release")
    terminal.type("y")
    assert board.wait_for(stands, PATIENCE_S)
    terminal.wait_for("not latched")
    terminal.type("q")
    assert terminal.end() == 0


def test_the_space_bar_works_after_a_byte_that_is_no_key(
    driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """The keyboard sends bytes that are not UTF-8, first alone, then together with the space bar.

    The monitor ignores these bytes, and the space bar latches the e-stop.
    """
    terminal = monitor_of(driver)
    terminal.wait_for("nominal")
    terminal.type("\udce4")
    terminal.type("\udcff \udce4")
    terminal.wait_for("LATCHED")
    terminal.wait_for("R releases it")
    assert board.wait_for(lambda b: any(c.kind == "estop" for c in b.commands), PATIENCE_S)
    terminal.type("R")
    terminal.wait_for("Release")
    terminal.type("y")
    terminal.wait_for("not latched")
    terminal.type("q")
    assert terminal.end() == 0


def test_who_lets_go_of_the_key_stops_the_robot(
    probe: Probe, driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """When the user releases the key, the monitor stops the robot with some zero commands.

    The monitor sends one more zero command when it ends.
    """
    said = probe.listen(Twist, "cmd_vel")
    terminal = monitor_of(driver, "--teleop")
    terminal.wait_for("0.15 m/s")
    steer(terminal, board, said)
    assert board.wait_for(stands, PATIENCE_S)
    wait_for_ticks(board, 60)
    probe.wait_for(lambda: said[-1].linear.x == 0.0)
    before = len(said)
    terminal.type("q")
    assert terminal.end() == 0
    probe.wait_for(lambda: len(said) > before)
    speeds = [twist.linear.x for twist in said]
    moving = speeds.index(0.0)
    assert speeds[:moving] == pytest.approx([0.15] * moving)
    assert speeds[moving:] == [0.0] * (len(speeds) - moving)
    assert len(speeds) - moving <= ZEROS + 1


def test_the_speeds_of_the_keys_are_tenths_of_the_drivers_limit(
    start_driver: Callable[..., Driver],
    probe_of: Callable[[Driver], Probe],
    monitor_of: Callable[..., PseudoTerminal],
) -> None:
    """The speed that the keys command is at first 30 % of the driver's speed limit.

    In this test, the driver has a lower limit than the default.
    """
    driver = start_driver("sim://", max_linear_speed=0.4)
    probe_of(driver).wait_for_state("nominal")
    terminal = monitor_of(driver, "--teleop")
    terminal.wait_for("0.12 m/s")
    terminal.type("q")
    assert terminal.end() == 0


def test_a_monitor_that_is_ended_stops_what_it_steered(
    start_board: Callable[..., PtyBoard],
    start_driver: Callable[..., Driver],
    probe_of: Callable[[Driver], Probe],
    monitor_of: Callable[..., PseudoTerminal],
) -> None:
    """A monitor that gets SIGTERM, or whose window is closed, stops the robot that it steers.

    Here, the monitor sends stamped commands.
    """
    board = start_board()
    driver = start_driver(board.path, enable_stamped_cmd_vel=True, cmd_vel_timeout=10.0)
    probe_of(driver).wait_for_state("nominal")

    def kill(terminal: PseudoTerminal) -> None:
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.end() == 0

    for end in (kill, PseudoTerminal.hang_up):
        terminal = monitor_of(driver, "--teleop")
        terminal.wait_for("0.15 m/s")
        with terminal.holding("w"):
            assert board.wait_for(drives, PATIENCE_S)
            end(terminal)
        assert board.wait_for(stands, 9.0)


def test_keys_pressed_while_it_was_suspended_move_nothing(
    probe: Probe, driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """The monitor is suspended while it steers, so the robot stops. Then the user presses keys.

    When the monitor runs again, it sends no motion commands for these keys.
    """
    said = probe.listen(Twist, "cmd_vel")
    terminal = monitor_of(driver, "--teleop")
    terminal.wait_for("0.15 m/s")
    steer(terminal, board, said)
    terminal.process.send_signal(signal.SIGTSTP)
    os.waitid(os.P_PID, terminal.process.pid, os.WSTOPPED)
    assert board.wait_for(stands, PATIENCE_S)
    wait_for_ticks(board, 60)
    before = len(said)
    terminal.type("w" * 20)
    terminal.process.send_signal(signal.SIGCONT)
    terminal.wait_for("\x1b[?1049h")  # it draws the screen again
    wait_for_ticks(board, 60)
    terminal.type("q")
    assert terminal.end() == 0
    assert not any(twist.linear.x for twist in said[before:])


def test_a_monitor_that_was_stopped_by_force_still_gives_the_terminal_back(
    driver: Driver, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """A monitor that was suspended by SIGSTOP still restores the terminal at its end.

    After the suspension, the monitor draws its screen again.
    """
    terminal = monitor_of(driver)
    terminal.wait_for("nominal")
    line = os.open(f"/proc/{terminal.process.pid}/fd/0", os.O_RDWR | os.O_NOCTTY)
    terminal.process.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, terminal.process.pid, os.WSTOPPED)
    terminal.process.send_signal(signal.SIGCONT)
    terminal.wait_for("\x1b[?1049h")  # it draws the screen again
    terminal.type("q")
    assert terminal.end() == 0
    echoes = termios.tcgetattr(line)[3] & termios.ECHO
    os.close(line)
    assert echoes
