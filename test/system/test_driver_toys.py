# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of two toy boards with the complete driver, on real terminals and sockets.

The toys are registered profiles, like any board.
"""

import os
import signal
import tty
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from driver_process import Driver
from nav_msgs.msg import Odometry
from probe import Probe
from std_msgs.msg import Float32MultiArray, UInt8MultiArray
from std_srvs.srv import SetBool
from toys import line_robot, request_robot

from omnibot_driver.simulator.common.serving import ServedBoard

PATIENCE_S: Final = 60.0
TOYS: Final = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from omnibot_driver import boards
boards.PROFILES |= {{name: f"toys.{{name}}" for name in ("line_board", "request_board")}}
"""
Start = Callable[..., Any]
ROBOTS: Final = {"line_board": line_robot.LineRobot, "request_board": request_robot.RequestRobot}


class Toy:
    """A simulated toy board that runs in real time.

    ``ports``: the parameters that connect the driver to the board.
    """

    def __init__(self, name: str, served: "ServedBoard[Any]") -> None:
        self.name, self.served = name, served
        parameters = (channel.parameter for channel in served.board.channels)
        self.ports = {
            parameter: address
            for parameter, address in zip(parameters, served.addresses, strict=True)
            if parameter
        }

    def wait_for(self, predicate: Callable[[Any], bool]) -> None:
        assert self.served.wait_for(predicate, PATIENCE_S), self.served.board.heard[-20:]

    def comes_to_a_stand(self) -> None:
        """Wait until the robot has been at rest for 0.8 s.

        During a drive, the robot also rests between two moves, but for a shorter time.
        """
        ways: deque[float] = deque(maxlen=80)

        def stood(robot: Any) -> bool:
            ways.append(robot.way_m)
            return len(ways) == ways.maxlen and len(set(ways)) == 1

        self.wait_for(stood)


@pytest.fixture(params=ROBOTS)
def toy(request: pytest.FixtureRequest, stack: ExitStack) -> Toy:
    return Toy(request.param, stack.enter_context(ServedBoard(ROBOTS[request.param]())))


def start_toy(start_driver: Start, toy: Toy, **parameters: object) -> Driver:
    ports = dict(toy.ports)
    driver: Driver = start_driver(
        ports.pop("port"), before=TOYS, board=toy.name, **ports, **parameters
    )
    return driver


@contextmanager
def driven(probe: Probe, toy: Toy) -> Iterator[None]:
    """Command the robot at 10 Hz until the context ends.

    The context begins when the robot moves.
    """
    with probe.commanding(0.2):
        toy.wait_for(lambda robot: not robot.stands)
        yield


def test_a_toy_drives_and_is_heard_and_obeys_the_estop(
    start_driver: Start, probe_of: Start, toy: Toy
) -> None:
    """A toy robot obeys cmd_vel and the e-stop, and odom shows the motion.

    The robot stops when the commands end, and moves again after the release of the e-stop.
    """
    probe: Probe = probe_of(start_toy(start_driver, toy))
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for_state("nominal")
    with driven(probe, toy):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.1)
    toy.comes_to_a_stand()
    with toy.served.lock:
        way_m = toy.served.board.way_m
    probe.wait_for(lambda: abs(odometry[-1].pose.pose.position.x - way_m) < 0.01)
    with driven(probe, toy):
        assert probe.call(SetBool, "estop", data=True).success
        toy.comes_to_a_stand()
        assert probe.call(SetBool, "estop", data=False).success
        toy.wait_for(lambda robot: not robot.stands)


@pytest.mark.parametrize(
    ("toy", "number"),
    [
        ("line_board", signal.SIGINT),
        ("line_board", signal.SIGKILL),
        ("request_board", signal.SIGKILL),
        ("request_board", signal.SIGSTOP),
    ],
    indirect=["toy"],
)
def test_whatever_ends_the_driver_stops_a_toy(
    start_driver: Start, probe_of: Start, toy: Toy, number: signal.Signals
) -> None:
    """A signal ends or suspends the driver while the robot drives.

    The driver or its guard process stops the robot.
    """
    driver = start_toy(start_driver, toy)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    with driven(probe, toy):
        driver.process.send_signal(number)
        toy.comes_to_a_stand()
    if number is signal.SIGSTOP:
        driver.process.send_signal(signal.SIGCONT)
        toy.comes_to_a_stand()


def test_each_toy_runs_inside_the_driver_too(start_driver: Start, probe_of: Start) -> None:
    """With the port ``sim://`` the driver runs the simulator of each toy board."""
    for name in ROBOTS:
        driver = start_driver("sim://", before=TOYS, board=name)
        probe: Probe = probe_of(driver)
        probe.wait_for_state("nominal")
        assert driver.end(signal.SIGINT) == 0


def test_wheels_have_the_boards_number_and_names(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """The toy board has two wheels. A command with two values turns them.

    A command with three values is rejected.
    """
    toy = Toy("line_board", stack.enter_context(ServedBoard(line_robot.LineRobot())))
    driver = start_toy(start_driver, toy)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    publisher = probe.publisher(Float32MultiArray, "wheel_cmd")
    publisher.publish(Float32MultiArray(data=[1.0, 1.0, 1.0]))
    driver.wait_for_line("it has 3 values; send exactly 2, the rates of wheels left, right")
    publisher.publish(Float32MultiArray(data=[1.0, -1.0]))
    toy.wait_for(lambda robot: b"v 100 -100" in robot.heard)


def test_the_raw_bytes_of_each_line_have_a_topic(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """A board has two lines, and ``publish_raw`` is true.

    Each line has raw topics with its name.
    """
    toy = Toy("line_board", stack.enter_context(ServedBoard(line_robot.LineRobot())))
    probe: Probe = probe_of(start_toy(start_driver, toy, publish_raw=True))
    told = probe.listen(UInt8MultiArray, "omnibot_driver/raw_rx/sense")
    probe.wait_for_state("nominal")
    probe.wait_for(lambda: any(bytes(message.data).startswith(b"d ") for message in told))
    topics = {name for name, _ in probe.node.get_topic_names_and_types()}
    assert {
        f"/{probe.node.get_namespace().strip('/')}/omnibot_driver/raw_{way}/{line}"
        for way in ("rx", "tx")
        for line in ("drive", "sense")
    } <= topics


def test_one_of_two_lines_that_is_missing_is_named_and_the_other_one_guarded(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """One of two lines is missing, and the driver reports which one.

    When the driver is killed, its guard process stops the robot on the line that is not missing.
    """
    toy = Toy("line_board", stack.enter_context(ServedBoard(line_robot.LineRobot())))
    toy.ports["sense_port"] = "/dev/no-such-port"
    driver = start_toy(start_driver, toy)
    driver.wait_for_line("the port 'sense' is missing: /dev/no-such-port does not exist")
    probe_of(driver).wait_for_state("connecting")
    toy.wait_for(lambda robot: robot.heard[-2:] == 2 * [b"v 0 0"])
    with toy.served.lock:
        driver.process.kill()
        driver.process.wait()
        toy.served.board.left = toy.served.board.right = 100
        mark = len(toy.served.board.heard)
    toy.wait_for(lambda robot: robot.heard[mark:].count(b"v 0 0") >= 10)
    toy.comes_to_a_stand()


def test_a_host_that_does_not_answer_is_told(start_driver: Start) -> None:
    """The board's UDP address does not answer. The driver reports that no data arrives."""
    driver = start_driver("udp://127.0.0.1:9", before=TOYS, board="request_board")
    driver.wait_for_line("no data from the board for 1.5 s")


def test_a_line_that_is_lost_leaves_the_robot_standing(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """One of two lines is lost during a drive. The driver repeats the stop on the other line."""
    toy = Toy("line_board", stack.enter_context(ServedBoard(line_robot.LineRobot())))
    far, near = os.openpty()
    stack.callback(os.close, near)
    tty.setraw(near)
    toy.ports["sense_port"] = os.ttyname(near)
    driver = start_toy(start_driver, toy)
    probe: Probe = probe_of(driver)
    talker = probe.node.create_timer(0.1, lambda: os.write(far, b"d 0 0\n"))
    probe.wait_for_state("nominal")
    with driven(probe, toy):
        with toy.served.lock:
            mark = len(toy.served.board.heard)
        probe.remove(talker)
        os.close(far)
        driver.wait_for_line("lost .* while")
        toy.wait_for(lambda robot: robot.heard[mark:].count(b"v 0 0") >= 20)
        toy.comes_to_a_stand()
