# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ways in which the driver can end.

The driver sends Stop last, and its exit code gives the reason.
"""

import contextlib
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from probe import Probe
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from terminal import fill

from omnibot_driver.simulator.omnibot import BoardMode, PtyBoard

Start = Callable[..., Any]
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
LAST_WORDS = 10 * (bytes(8) + STOP)


def driving(probe: Probe, board: PtyBoard) -> None:
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    for _ in range(20):  # a stall of the computer stops the robot
        commands.publish(twist)
        if board.wait_for(lambda b: b.commands[-1].kind == "velocity", 1.0):
            return
    raise AssertionError("it does not drive")


PATIENT = """
import omnibot_driver.driver as driver, omnibot_driver.link as link
link.STANDS_WITHIN_S = link.SILENCE_S = link.BOTH_PROOFS_S = link.JOIN_TIMEOUT_S = 10.0
driver.LONGEST_END_S = 50.0
"""
"""Code that makes the driver wait longer at its end for the board's report of a standstill.

On a busy computer, the report comes late.
"""


@pytest.mark.parametrize(
    "signals",
    [
        [signal.SIGINT],
        [signal.SIGTERM],
        [signal.SIGINT, signal.SIGINT],
        [signal.SIGTERM, signal.SIGINT, signal.SIGINT],
        [signal.SIGHUP],
    ],
    ids=lambda signals: "+".join(number.name for number in signals),
)
def test_a_signal_while_driving_ends_with_the_stop_frame_and_exit_code_zero(
    start_board: Start, start_driver: Start, probe_of: Start, signals: list[signal.Signals]
) -> None:
    """One, two or three signals arrive while the robot drives.

    The driver sends Stop and exits with code 0. Ctrl-C on ``ros2 launch`` sends two signals.
    """
    board = start_board()
    driver: Driver = start_driver(board.path, before=PATIENT)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driving(probe, board)
    assert driver.end(*signals) == 0
    assert "Traceback" not in driver.output
    assert driver.lines[-1].endswith("robot stopped and port closed\n")
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)


REPORTS_EXECUTORS = """
import atexit, threading
from rclpy.executors import Executor
executors, begin = [], Executor.__init__
def keep(self, *args, **kwargs):
    begin(self, *args, **kwargs)
    executors.append(self)
Executor.__init__ = keep
join = threading.Thread.join
threading.Thread.join = lambda thread, timeout=None: join(thread, timeout and 100 * timeout)
atexit.register(lambda: print("left running:", sum(bool(e._sigint_gc) for e in executors)))
"""
"""Code that makes the driver print, at its exit, how many executors still run.

The code also gives the driver's threads more time to end.
"""


def test_the_executor_is_shut_down_before_python_ends(start_driver: Start) -> None:
    """The driver shuts its executor down itself at its end.

    If this were left to the exit of Python, rclpy might print an error.
    """
    before = PATIENT + REPORTS_EXECUTORS
    driver: Driver = start_driver("sim://", before=before, interpreter=True)
    driver.wait_for_line("state: nominal")
    assert driver.end(signal.SIGTERM) == 0
    assert "left running: 0\n" in driver.output


HOLDS_THE_EXECUTOR = """
import threading, omnibot_driver.driver as driver, omnibot_driver.node as node
from rclpy.executors import Executor
driver.LONGEST_END_S = 50.0
closed, go_on, close, create_task = threading.Event(), threading.Event(), *(
    node.OmniBotDriver.close, Executor.create_task
)
def close_and_say_so(self):
    close(self)
    closed.set()
def create(self, *args):
    task = create_task(self, *args)
    if closed.is_set():
        go_on.set()
    return task
def hold(self, message):
    print("held")
    go_on.wait()
node.OmniBotDriver.close, Executor.create_task = close_and_say_so, create
node.OmniBotDriver._on_estop_topic = hold
join = threading.Thread.join
threading.Thread.join = lambda thread, timeout=None: join(thread, timeout and 20 * timeout)
"""
"""Code for the driver's process: a callback blocks the executor until the driver asks it to end.

The code also makes the driver wait 20 times longer than usual for its threads to end.
"""


def test_a_pending_service_answers_although_the_executor_learns_of_its_result_late(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """If the driver ends during ``~/reset``, the user gets an answer, even if a callback blocks."""
    board = start_board(boot_time_s=1000.0, running=True)
    driver: Driver = start_driver(board.path, before=HOLDS_THE_EXECUTOR)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    estop = probe.publisher(Bool, "estop")
    reset = probe.call_async(Trigger, "reset")
    assert board.wait_for(lambda b: b.mode is BoardMode.BOOTING, PATIENCE_S)
    estop.publish(Bool(data=True))
    driver.wait_for_line("held")
    assert driver.end(signal.SIGTERM) == 0
    assert reset.wait().message == "the driver is shutting down; start it again"


EXPLODES = """
import omnibot_driver.node as node
def explode(self, message):
    raise ZeroDivisionError("a defect in a callback")
node.OmniBotDriver._on_estop_topic = explode
"""


SHUTS_DOWN = """
import rclpy, omnibot_driver.node as node
node.OmniBotDriver._on_estop_topic = lambda self, message: rclpy.shutdown()
"""


@pytest.mark.parametrize(("before", "exit_code"), [(EXPLODES, 1), (SHUTS_DOWN, 0)])
def test_a_defect_or_a_shutdown_of_ros_while_driving_ends_with_the_stop_frame(
    start_board: Start, start_driver: Start, probe_of: Start, before: str, exit_code: int
) -> None:
    """A callback has a defect, or ROS is shut down, while the robot drives.

    The driver sends Stop last. Exit code: 1 (defect), 0 (shutdown).
    """
    board = start_board()
    driver: Driver = start_driver(board.path, before=before, cmd_vel_timeout=10.0)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driving(probe, board)
    probe.publisher(Bool, "estop").publish(Bool(data=True))
    assert driver.end() == exit_code, driver.output
    assert ("a defect in a callback" in driver.output) == bool(exit_code)
    assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)


def test_a_board_that_takes_nothing_any_more_does_not_hold_up_the_end(
    start_driver: Start, probe_of: Start, silent_terminal: tuple[int, str]
) -> None:
    """The kernel's buffer for data to the board is full. The driver still ends.

    Afterwards, its guard process tries to send Stop until the buffer has space.
    """
    far, path = silent_terminal
    driver: Driver = start_driver(path, auto_start=False)
    probe_of(driver).wait_for_state("connecting")
    assert os.read(far, 100).endswith(STOP)
    fill_terminal(path)
    assert driver.end(signal.SIGINT) == 0
    assert "port closed" not in driver.output
    heard = b""
    while LAST_WORDS not in heard:
        assert select.select([far], [], [], PATIENCE_S)[0], heard
        heard += os.read(far, 4096)


def fill_terminal(path: str) -> None:
    """Open the terminal, fill its buffer towards the board, and close it again."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    fill(descriptor)
    os.close(descriptor)


@pytest.mark.parametrize(
    ("on_exit", "mode"), [("pause", BoardMode.PAUSED), ("reset", BoardMode.PAUSED)]
)
def test_the_board_can_be_left_paused_or_reset(
    start_board: Start, start_driver: Start, probe_of: Start, on_exit: str, mode: BoardMode
) -> None:
    """With ``on_exit`` set to pause or reset, the driver sends P or R after the Stop frame."""
    board = start_board()
    driver: Driver = start_driver(board.path, on_exit=on_exit)
    probe_of(driver).wait_for_state("nominal")
    assert driver.end(signal.SIGINT) == 0
    assert board.wait_for(lambda b: b.commands[-1].kind == on_exit, PATIENCE_S)
    assert board.wait_for(lambda b: b.mode is mode, PATIENCE_S)


def test_a_log_that_nobody_reads_does_not_keep_the_robot_moving(start_board: Start) -> None:
    """The driver's output is not read, e.g. after ctrl-S or because a pipe's reader hangs.

    Command timeout, e-stop and SIGTERM still work.
    """
    board = start_board(running=True)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, b"x" * 4096)
    os.set_blocking(writing, True)
    namespace = "unread"
    command = [sys.executable, "-m", "omnibot_driver.driver", "--ros-args"]
    command += ["-p", f"port:={board.path}", "-r", f"__ns:=/{namespace}"]
    process = subprocess.Popen(command, stdout=writing, stderr=writing)
    try:
        with Probe(namespace) as probe:
            probe.wait_for_state("nominal")
            driving(probe, board)
            bad = Twist()
            bad.linear.x = float("nan")
            probe.publisher(Twist, "cmd_vel").publish(bad)
            assert board.wait_for(lambda b: bytes(b.received).endswith(STOP), PATIENCE_S)
            probe.call_async(SetBool, "estop", data=True)
            assert board.wait_for(lambda b: any(c.kind == "estop" for c in b.commands), PATIENCE_S)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
    finally:
        process.kill()
        process.wait()
        os.close(reading)
        os.close(writing)
