# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the robot stops if the driver is killed, crashes or hangs while the robot moves.

The driver's guard, a separate process, stops the robot in these cases.
"""

import math
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist, TwistStamped
from probe import Probe
from std_srvs.srv import SetBool

from omnibot_driver import guard
from omnibot_driver.simulator.omnibot import PtyBoard, SimulatedBoard

Start = Callable[..., Any]
ZEROS = bytes(8)
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
EMERGENCY_STOP = bytes.fromhex("FF FE 10 00 00 00 00 00 00")
LATCHED_WORDS = ZEROS + EMERGENCY_STOP + ZEROS + STOP
LAST_WORDS = 3 * (ZEROS + STOP)


def twist(vx_mps: float) -> Twist:
    message = Twist()
    message.linear.x = vx_mps
    return message


def driving(probe: Probe, board: PtyBoard) -> Any:
    """Publish commands until the robot moves, and return the publisher."""
    commands = probe.publisher(Twist, "cmd_vel")
    for _ in range(20):  # a stall of the computer stops the robot
        commands.publish(twist(0.3))
        if board.wait_for(lambda b: b.truth.vx_mps > 0.1, 1.0):
            return commands
    raise AssertionError("it does not drive")


def still(board: SimulatedBoard) -> bool:
    truth = board.truth
    return max(abs(truth.vx_mps), abs(truth.vy_mps), abs(truth.yaw_rate)) < 0.01


def hang(driver: Driver, board: PtyBoard) -> int:
    """Suspend the driver. Return how many bytes the board has received from it until then."""
    driver.process.send_signal(signal.SIGSTOP)
    stat = Path(f"/proc/{driver.process.pid}/stat")
    wait_until(lambda: stat.read_text().rpartition(")")[2].split()[0] == "T")
    now = board.board.tick
    assert board.wait_for(lambda b: b.tick > now + 1, PATIENCE_S)
    return len(board.board.received)


def wait_until(predicate: Callable[[], object]) -> None:
    """Poll the predicate until it holds."""
    end = time.monotonic() + PATIENCE_S
    while not predicate():
        assert time.monotonic() < end, "the condition did not become true in time"
        time.sleep(0.02)  # processes and log lines give no event to wait for


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGABRT])
def test_a_driver_that_dies_while_driving_leaves_a_robot_that_stands_still(
    board: PtyBoard, driver: Driver, probe: Probe, number: signal.Signals
) -> None:
    """The driver dies while the robot drives.

    The guard process sends the stop bytes, but no emergency stop. test/faults/test_endings.py tests
    a death by a segmentation fault.
    """
    driving(probe, board)
    assert driver.end(number) == -number
    assert board.wait_for(still, PATIENCE_S)
    with board.lock:
        assert not board.board.estopped, "an emergency stop that was not asked for"
    assert board.wait_for(lambda b: bytes(b.received).endswith(LAST_WORDS), PATIENCE_S)


def test_a_driver_that_dies_under_the_estop_leaves_it_to_the_guard(
    board: PtyBoard, driver: Driver, probe: Probe
) -> None:
    """The driver dies while the e-stop is latched.

    The guard process repeats the emergency stop, each time followed by Stop.
    """
    driving(probe, board)
    assert probe.call(SetBool, "estop", data=True).success
    mark = len(board.board.received)
    assert board.wait_for(lambda b: len(b.received) > mark + 20 * len(LATCHED_WORDS), PATIENCE_S)
    mark = len(board.board.received)
    assert driver.end(signal.SIGKILL) == -signal.SIGKILL
    assert board.wait_for(
        lambda b: bytes(b.received[mark:]).count(LATCHED_WORDS) >= guard.TIMES, PATIENCE_S
    )
    assert board.wait_for(still, PATIENCE_S)


def test_the_next_driver_has_the_port_as_soon_as_the_guard_is_done(
    board: PtyBoard, driver: Driver, probe: Probe, start_driver: Start, probe_of: Start
) -> None:
    """A new driver opens the port when the guard process of a killed driver has released it."""
    driving(probe, board)
    driver.end(signal.SIGKILL)
    successor: Driver = start_driver(board.path)
    again: Probe = probe_of(successor)
    again.wait_for_state("nominal")
    driving(again, board)


def test_a_driver_that_hangs_is_stopped_for_and_stays_so_until_a_fresh_command(
    board: PtyBoard, driver: Driver, probe: Probe
) -> None:
    """The driver hangs while the robot drives, and the guard process stops the robot.

    Commands that were sent during the hang are refused. A later command is obeyed.
    """
    commands = driving(probe, board)
    mark = hang(driver, board)
    assert board.wait_for(lambda b: LAST_WORDS in bytes(b.received[mark:]), PATIENCE_S)
    assert board.wait_for(still, PATIENCE_S)
    deaf = board.board.tick + 200  # longer than a board may be silent
    assert board.wait_for(lambda b: b.tick > deaf, PATIENCE_S)
    with board.lock:
        mark, said = len(board.board.commands), len(driver.lines)
    for _ in range(20):
        commands.publish(twist(0.2))
    driver.answers.clear()  # the probe does not publish it again
    driver.process.send_signal(signal.SIGCONT)
    stood = driver.wait_for_line("driver stalled for .* s", said)
    until_then = driver.lines[said : driver.lines.index(stood, said)]
    assert "no data from the board" not in "".join(until_then)
    driver.wait_for_line("motion command refused: it waited", said)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    with board.lock:
        kinds = {command.kind for command in list(board.board.commands)[mark:]}
    assert kinds <= {"wheels", "estop"}
    wait_until(lambda: commands.publish(twist(0.3)) or not still(board.board))
    driver.end(signal.SIGKILL)
    assert board.wait_for(still, PATIENCE_S)


SUSPENDED = """
import os, time
real = time.clock_gettime_ns
time.clock_gettime_ns = lambda clock: real(clock) + (
    60_000_000_000 if clock == time.CLOCK_BOOTTIME and os.path.exists({path!r}) else 0
)
"""
"""Code for the driver's process. When the file ``path`` exists, CLOCK_BOOTTIME is 60 s ahead.

CLOCK_BOOTTIME also counts the time for which a host is suspended.
"""


def test_a_robot_is_stopped_when_its_host_was_suspended(
    board: PtyBoard, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The computer is suspended while the robot drives. Afterwards, the driver stops the robot.

    The driver detects the suspension as a stall. The command timeout cannot detect it, because its
    clock does not run during the suspension.
    """
    resumed = tmp_path / "resumed"
    driver: Driver = start_driver(
        board.path, cmd_vel_timeout=10.0, before=SUSPENDED.format(path=str(resumed))
    )
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    commands = driving(probe, board)
    resumed.touch()
    driver.wait_for_line(r"driver stalled for 6\d\.\d s")  # a busy machine adds to the 60 s
    assert board.wait_for(still, PATIENCE_S)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
    wait_until(lambda: commands.publish(twist(0.3)) or not still(board.board))


def test_a_stamped_command_that_waited_while_the_driver_hung_is_none_either(
    board: PtyBoard, start_driver: Start, probe_of: Start
) -> None:
    """A command with a stamp is sent while the driver hangs. The stamp is recent.

    Nevertheless, the driver refuses the command after the hang.
    """
    driver: Driver = start_driver(board.path, enable_stamped_cmd_vel=True, cmd_vel_timeout=10.0)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    commands = probe.publisher(TwistStamped, "cmd_vel")
    nothing = TwistStamped(twist=twist(math.nan))
    wait_until(
        lambda: commands.publish(nothing) or "NaN or infinity" in driver.output
    )  # the driver receives it
    probe.forget_message()
    driver.answers.clear()  # the probe does not publish it again
    mark = hang(driver, board)
    stamped = TwistStamped(twist=twist(0.2))
    stamped.header.stamp = probe.node.get_clock().now().to_msg()
    commands.publish(stamped)
    assert board.wait_for(lambda b: LAST_WORDS in bytes(b.received[mark:]), PATIENCE_S)
    driver.process.send_signal(signal.SIGCONT)
    driver.wait_for_line("motion command refused: it waited")
    with board.lock:
        assert "velocity" not in [command.kind for command in board.board.commands]


def test_a_command_that_waited_while_the_driver_hung_is_obeyed_when_it_is_sent_again(
    board: PtyBoard, driver: Driver, probe: Probe
) -> None:
    """A command that came during a hang is refused. The driver obeys it when it is sent again."""
    commands = probe.publisher(Twist, "cmd_vel")
    mark = hang(driver, board)
    commands.publish(twist(0.2))
    assert board.wait_for(lambda b: LAST_WORDS in bytes(b.received[mark:]), PATIENCE_S)
    driver.process.send_signal(signal.SIGCONT)
    driver.wait_for_line("motion command refused: it waited.*send it again")
    assert board.wait_for(lambda b: any(c.kind == "velocity" for c in b.commands), PATIENCE_S)


def test_a_guard_that_is_killed_is_replaced_and_the_new_one_guards(
    board: PtyBoard, driver: Driver, probe: Probe
) -> None:
    """A guard process is killed.

    The driver logs this and starts a new guard process. When the driver is then killed, the new
    guard process stops the robot.
    """
    with probe.commanding(0.3):
        (first,) = driver.guards()
        os.kill(first, signal.SIGKILL)
        driver.wait_for_line("the guard process died.*starting another guard process")
        wait_until(lambda: driver.guards() not in ([], [first]))
        assert board.wait_for(lambda b: not still(b), PATIENCE_S)
        driver.end(signal.SIGKILL)
    assert board.wait_for(still, PATIENCE_S)


def test_every_connection_has_one_guard_and_no_process_stays_behind(
    start_board: Start, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The board is plugged in five times. Each connection has a guard process of its own.

    After the driver's end, none of these processes is left.
    """
    link = tmp_path / "omnibot"
    driver: Driver = start_driver(str(link), reconnect_interval=0.05)
    probe: Probe = probe_of(driver)
    seen = set()
    for _ in range(5):
        with PtyBoard(SimulatedBoard(), str(link)):
            probe.wait_for_state("nominal")
            (its,) = driver.guards()
            seen.add(its)
        probe.wait_for_state("disconnected")
        wait_until(lambda: not driver.guards())
    assert len(seen) == 5
    start_board(link=str(link))
    probe.wait_for_state("nominal")
    (last,) = driver.guards()
    assert driver.end(signal.SIGINT) == 0
    wait_until(lambda: not Path(f"/proc/{last}").exists())


def test_an_orderly_end_needs_no_guard(board: PtyBoard, driver: Driver, probe: Probe) -> None:
    """The user presses ctrl-C while the robot drives. The driver itself stops the robot.

    So the guard process has nothing to do, and no emergency stop is sent.
    """
    driving(probe, board)
    assert driver.end(signal.SIGINT) == 0
    with board.lock:
        assert not board.board.estopped
        assert EMERGENCY_STOP not in bytes(board.board.received)


def test_the_guard_can_be_done_without(board: PtyBoard, start_driver: Start) -> None:
    """The parameter ``guard`` is false, for use with a debugger. The driver has no guard.

    After the driver is killed, the board receives nothing.
    """
    driver: Driver = start_driver(board.path, guard=False)
    driver.wait_for_line("state: nominal")
    assert driver.guards() == []
    driver.end(signal.SIGKILL)
    killed = board.board.tick
    assert board.wait_for(lambda b: b.tick > killed + 1, PATIENCE_S)  # what was sent has arrived
    mark = len(board.board.received)
    assert board.wait_for(lambda b: b.tick > killed + 50, PATIENCE_S)
    assert not board.board.received[mark:]
