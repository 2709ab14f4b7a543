# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ports that are missing, busy or wrong, that appear late, or that deliver garbage."""

import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from probe import Probe
from sensor_msgs.msg import Imu
from std_srvs.srv import SetBool

from omnibot_driver.simulator.omnibot import PtyBoard, SimulatedBoard

Start = Callable[..., Any]


def descriptors(driver: Driver) -> int:
    """Return how many file descriptors the driver has open.

    The number includes descriptors that the driver will soon close.
    """
    return len(os.listdir(f"/proc/{driver.process.pid}/fd"))


def test_a_missing_port_is_named_once_and_the_driver_waits_for_it(
    start_board: Start, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The port is missing.

    The driver reports this once, and starts a board that is plugged in later.
    """
    link = tmp_path / "omnibot"
    driver: Driver = start_driver(str(link), reconnect_interval=0.05)
    driver.wait_for_line("does not exist.*by-id")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("disconnected")
    start_board(link=str(link))
    probe.wait_for_state("nominal")
    assert driver.output.count("does not exist") == 1


def test_an_unplugged_board_is_found_again(
    start_board: Start, start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """Twice, a board is unplugged and plugged in again. The driver opens its port each time.

    No file descriptors are left open.
    """
    link = tmp_path / "omnibot"
    with PtyBoard(SimulatedBoard(), str(link)):
        driver: Driver = start_driver(str(link), reconnect_interval=0.05)
        probe: Probe = probe_of(driver)
        probe.wait_for_state("nominal")
        before = descriptors(driver)
    probe.wait_for_state("disconnected")
    with PtyBoard(SimulatedBoard(), str(link)):
        probe.wait_for_state("nominal")
    probe.wait_for_state("disconnected")
    board = start_board(link=str(link))
    probe.wait_for_state("nominal")
    assert board.wait_for(lambda _: descriptors(driver) <= before, PATIENCE_S)
    assert driver.end(signal.SIGINT) == 0
    assert driver.output.count("lost") == 2


def test_a_stop_that_cannot_be_sent_is_said_at_the_end(
    start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The board is unplugged during a drive, and the driver ends.

    Its log says that no stop was sent.
    """
    link = tmp_path / "omnibot"
    with PtyBoard(SimulatedBoard(), str(link)) as board:
        driver: Driver = start_driver(str(link), cmd_vel_timeout=10.0)
        probe: Probe = probe_of(driver)
        probe.wait_for_state("nominal")
        twist = Twist()
        twist.linear.x = 0.3
        probe.publisher(Twist, "cmd_vel").publish(twist)
        assert board.wait_for(lambda b: b.driven, PATIENCE_S)
    probe.wait_for_state("disconnected")
    assert driver.end(signal.SIGINT) == 0
    assert "the stop could not be sent" in driver.lines[-1]


def test_an_estop_while_the_board_is_unplugged_says_when_it_is_sent(
    start_driver: Start, probe_of: Start, tmp_path: Path
) -> None:
    """The board is unplugged, and a user calls ``~/estop``.

    The answer says that the stop will be sent when the port opens.
    """
    link = tmp_path / "omnibot"
    with PtyBoard(SimulatedBoard(), str(link)):
        driver: Driver = start_driver(str(link), reconnect_interval=0.05)
        probe: Probe = probe_of(driver)
        probe.wait_for_state("nominal")
    probe.wait_for_state("disconnected")
    answer = probe.call(SetBool, "estop", data=True)
    assert answer.message.endswith("the port is not open; the stop will be sent when it opens")
    driver.wait_for_line("e-stop latched by the service ~/estop")


def test_a_second_driver_on_the_same_port_is_refused_and_told_why(
    start_board: Start, start_driver: Start
) -> None:
    """A second driver starts on the same port. It says that the port is in use.

    Two drivers would send contradictory commands.
    """
    board = start_board()
    first: Driver = start_driver(board.path)
    first.wait_for_line("is open")
    second: Driver = start_driver(board.path)
    second.wait_for_line("in use by another program.*fuser")


@pytest.mark.parametrize(
    ("port", "reason"),
    [
        ("/dev/null", "is not a serial port.*by-id"),
        (
            "socket://localhost:1",
            "cannot open socket://localhost:1: Connection refused: check that the server",
        ),
    ],
)
def test_a_port_that_cannot_be_opened_is_explained_and_the_node_lives(
    start_driver: Start, port: str, reason: str
) -> None:
    """The port cannot be opened now, but perhaps later. The driver logs the reason.

    It keeps trying until SIGINT ends it.
    """
    driver: Driver = start_driver(port)
    driver.wait_for_line(reason)
    assert driver.process.poll() is None
    assert driver.end(signal.SIGINT) == 0
    assert "robot stopped" not in driver.output


@pytest.mark.parametrize(
    ("board", "port", "reason"),
    [
        ("omnibot", "nonsense://board", "port 'nonsense://board' is not valid.*socket://"),
        ("omnibot", "/", "/ is not a serial port.*by-id"),
        ("omnibot", "sim://?nonsense=1", "there is no option 'nonsense=1'"),
        ("lois_ecu", "udp:/host", "port 'udp:/host' is not valid.*whole path"),
        ("mart", "/dev/ttyUSB0", "port '/dev/ttyUSB0' is not valid.*udp://HOST:PORT"),
        ("fejemis", "loop://", "does not work for a board with several ports"),
    ],
)
def test_a_port_that_can_never_be_opened_is_refused_at_the_start(
    start_driver: Start, board: str, port: str, reason: str
) -> None:
    """The given port can never be opened. The driver logs the reason and exits with code 2.

    systemd does not restart a program that exits with this code.
    """
    driver: Driver = start_driver(port, board=board)
    driver.wait_for_line(f"omnibot_driver cannot start: .*{reason}")
    assert driver.process.wait(60.0) == 2


def test_garbage_on_the_line_is_not_published_and_does_not_end_the_driver(
    start_driver: Start, probe_of: Start, silent_port: str, write_to_silent_port: Start
) -> None:
    """The line delivers garbage, as with a wrong baud rate. The driver does not publish it.

    Valid frames after the garbage are published.
    """
    driver: Driver = start_driver(silent_port)
    probe: Probe = probe_of(driver)
    imu = probe.listen(Imu, "imu/data_raw")
    probe.wait_for_state("connecting")
    driver.wait_for_line("no data from the board.*power")
    write_to_silent_port(bytes(range(256)) * 40)
    write_to_silent_port(bytes.fromhex("FF FA 00 00 00 00 40 00 00 01 00 02 00 03") * 3)
    probe.wait_for(lambda: len(imu) >= 2)
    heard = [message.linear_acceleration.z for message in list(imu)]
    assert heard == pytest.approx([9.80665] * len(heard))


def test_a_port_that_flaps_is_told_once(start_driver: Start) -> None:
    """The driver's port is a TCP server that closes each connection at once.

    The driver connects again and again, but logs only one message that the port is open.
    """
    server = socket.create_server(("127.0.0.1", 0))
    port = f"socket://127.0.0.1:{server.getsockname()[1]}"
    driver: Driver = start_driver(port, reconnect_interval=0.05)
    for _ in range(8):
        peer, _ = server.accept()
        peer.close()
    server.close()
    driver.wait_for_line("cannot open.*refused")
    assert driver.output.count("is open") == 1
    assert driver.output.count("lost") <= 2
