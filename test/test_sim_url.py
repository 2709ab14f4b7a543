# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``sim://``: a simulated board in the driver's own process, without ROS."""

import threading

import pytest
import serial
from listener import PATIENCE_S, Listener, link_to, session

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimator import OdometryEstimate
from omnibot_driver.simulator.common.running import UNREAD_LIMIT
from omnibot_driver.simulator.omnibot import SimulatedBoard
from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.urls.protocol_sim import InProcessBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_a_robot_drives_without_a_port_and_without_another_process() -> None:
    """The board boots, is started, obeys a command and is heard of, in real time."""
    listener, ours = Listener(), session()
    link = link_to("sim://", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")

    def drives() -> bool:
        """Commanded again and again: a machine that hangs stops the robot."""
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        return any(
            isinstance(event, OdometryEstimate) and event.twist and event.twist.vx_mps > 0.1
            for event in listener.events
        )

    listener.wait_for(drives)
    link.close("stop")
    assert listener.reports == [None]


def test_a_board_that_ends_with_the_driver_needs_no_guard() -> None:
    """Nobody is warned of a robot that would go on."""
    listener, ours = Listener(), session()
    link = link_to("sim://?running", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.close("stop")
    assert not [event for event in listener.events if isinstance(event, Notice)]


def test_options_come_after_a_question_mark() -> None:
    """They are the simulator's own."""
    listener, ours = Listener(), session()
    link = link_to("sim://?imu_only&seed=1&lose=0.001", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "imu_only")
    link.close("stop")


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("sim://?wheels=4", "there is no option 'wheels=4'"),
        ("sim://?imu", "there is no option 'imu'"),
        ("sim://?lose=2", "'2' is no probability: give a number from 0 to 1"),
        ("sim://?seed=first", "invalid int value: 'first'"),
        ("sim://?imu_only=maybe", "--imu-only: ignored explicit argument 'maybe'"),
        ("sim://imu_only", "'imu_only' must come after a question mark"),
    ],
)
def test_options_that_it_does_not_know_are_refused(url: str, why: str) -> None:
    """By a sentence that names the option, the whole list and an example."""
    with pytest.raises(LinkError) as refusal:
        SerialPort(url, 115200)
    assert why in str(refusal.value)
    assert "simulator --help" in str(refusal.value)


def test_bytes_that_nobody_reads_are_dropped_and_counted() -> None:
    """It keeps what a terminal would, and the oldest of it."""
    board = InProcessBoard("sim://?running")
    sent = b""
    while not board.dropped:
        data = board.board.step()
        sent += data
        board.dropped += len(data) - board._send(data)
    assert board.unread == UNREAD_LIMIT
    assert board.read(UNREAD_LIMIT, 0) == sent[:UNREAD_LIMIT]


def test_a_read_that_waits_can_be_cancelled() -> None:
    """Closing a driver does not wait for the next notice of a paused board, a second away."""
    with serial.serial_for_url("sim://", timeout=PATIENCE_S) as port:
        assert port.read(11) == b"Paused: 0 \n"
        canceller = threading.Timer(2 * TICK_S, port.cancel_read)
        canceller.start()
        assert port.read() == b""
        canceller.join()


def test_a_board_whose_thread_died_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is reported with its cause, and not taken for a lost cable."""

    def explode(_board: SimulatedBoard) -> bytes:
        raise ZeroDivisionError

    monkeypatch.setattr(SimulatedBoard, "step", explode)
    listener = Listener()
    link = link_to("sim://", listener, session())
    link.start()
    listener.wait_for(lambda: listener.failures)
    link.close("stop")
    assert isinstance(listener.failures[0].__cause__, ZeroDivisionError)
