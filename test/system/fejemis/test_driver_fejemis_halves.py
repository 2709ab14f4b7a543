# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver with a Fejemis whose halves are lost, swapped, broken or of another kind.

A *half* is one of the two Teensys (drive or front).
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from fejemis_driver import driven, moves_again, robot_of, started
from probe import Probe
from std_srvs.srv import SetBool, Trigger
from two_ports import DRIVE, FRONT, TwoPorts

from omnibot_driver.simulator.fejemis import Firmware

Start = Callable[..., Any]
STOP = "rc 2 0 0"


@pytest.mark.parametrize(("channel", "name"), [(DRIVE, "drive"), (FRONT, "front")])
def test_a_half_that_is_unplugged_while_driving_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, channel: int, name: str
) -> None:
    """If a Teensy is unplugged during a drive, the driver stops the motors of the other Teensy.

    When the unplugged Teensy is back, the driver stops the motors of this Teensy, too.
    """
    said = len(driver.lines)
    assert probe.call(SetBool, "brush", data=True).success
    with driven(probe, robot):
        robot.unplug(channel)
        probe.wait_for_state("connecting")
        driver.wait_for_line(rf"lost.*{name}|{name}.*(lost|missing|no data)", said)
        if channel == FRONT:
            robot.stands_for_good()
        else:
            robot.wait_until(lambda board: not board.vehicle.brush)
    robot.plug(channel)
    robot.stands_for_good()
    probe.wait_for_state("nominal")
    assert not robot.do(lambda board: board.vehicle.brush)
    subscriptions = robot.do(lambda board: board.half(name).subscriptions)
    assert len(subscriptions) > 1
    moves_again(probe, robot)


def test_a_brush_that_cannot_be_switched_off_now_is_no_success(
    robot: TwoPorts, driver: Driver, probe: Probe
) -> None:
    """While the front board is unplugged, switching the brush off fails; the answer names the port.

    The driver switches the brush off when the front board is plugged in again.
    """
    assert probe.call(SetBool, "brush", data=True).success
    robot.wait_until(lambda board: board.vehicle.brush)
    robot.unplug(FRONT)
    probe.wait_for_state("connecting")
    end, reason = time.monotonic() + PATIENCE_S, ""
    while "the port 'front' is missing" not in reason:  # the other port may be attached anew first
        assert time.monotonic() < end, reason
        answer = probe.call(SetBool, "brush", data=False)
        assert not answer.success
        reason = answer.message
    assert robot.do(lambda board: board.vehicle.brush)
    robot.plug(FRONT)
    robot.wait_until(lambda board: not board.vehicle.brush)
    probe.wait_for_state("nominal")


def test_nothing_is_promised_while_both_ports_are_missing(
    robot: TwoPorts, driver: Driver, probe: Probe
) -> None:
    """Both boards are unplugged. ``~/brush`` (off) and ``~/save_configuration`` fail."""
    robot.unplug(DRIVE)
    probe.wait_for_state("connecting")
    robot.unplug(FRONT)
    probe.wait_for_state("disconnected")
    answers = [
        probe.call(SetBool, "brush", data=False),
        probe.call(Trigger, "save_configuration"),
    ]
    assert [answer.success for answer in answers] == [False, False]
    for answer in answers:
        assert "the boards are not connected" in answer.message
    robot.plug(DRIVE)
    robot.plug(FRONT)
    probe.wait_for_state("nominal")
    moves_again(probe, robot)


@pytest.mark.parametrize("name", ["drive", "front"])
@pytest.mark.parametrize("what", ["restart", "silent"])
def test_a_half_that_restarts_or_falls_silent_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, name: str, what: str
) -> None:
    """If a Teensy restarts or falls silent during a drive, the driver stops the robot.

    When both Teensys work again, the robot obeys new commands.
    """
    said = len(driver.lines)
    with driven(probe, robot):
        befell_s = robot.do(lambda board: (board.now_s, board.befall(name, what))[0])
        if what == "restart":
            robot.wait_until(
                lambda board: any(
                    obeyed.text == STOP and obeyed.at_s > befell_s
                    for obeyed in board.drive.commands
                )
            )
        else:
            probe.wait_for_state("connecting")
            driver.wait_for_line(name, said)
            robot.stands_for_good()
    robot.do(lambda board: board.befall(name, "well"))
    robot.stands_for_good()
    probe.wait_for_state("nominal")
    moves_again(probe, robot)


@pytest.mark.parametrize("what", ["sensor-error", "hall-broken"])
def test_a_broken_angle_sensor_stops_the_robot(
    robot: TwoPorts, driver: Driver, probe: Probe, what: str
) -> None:
    """The angle sensor of the front wheel breaks during a drive. The driver stops the robot.

    The log says that the angle sensor is faulty.
    """
    said = len(driver.lines)
    with driven(probe, robot):
        robot.do(lambda board: board.befall("front", what))
        robot.stands_for_good()
    driver.wait_for_line("angle sensor", said)
    robot.do(lambda board: board.befall("front", "sensor-well"))
    moves_again(probe, robot)


def test_swapped_ports_are_found_out(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """The two ports are swapped. The driver notices this by the ids in the heartbeats.

    The robot drives as usual.
    """
    robot = robot_of(stack, tmp_path, swapped=True)
    driver = started(robot, start_driver)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    driver.wait_for_line("swapped")
    moves_again(probe, robot)


def test_it_drives_without_sums(
    stack: ExitStack, tmp_path: Path, start_driver: Start, probe_of: Start
) -> None:
    """The firmware uses no checksums.

    The driver learns this from the heartbeats and sends lines without checksums. The firmware
    accepts every line.
    """
    robot = robot_of(stack, tmp_path, firmware=Firmware(sums=False))
    probe: Probe = probe_of(started(robot, start_driver))
    probe.wait_for_state("nominal")
    before = robot.do(lambda board: board.drive.unhandled + board.front.unhandled)
    moves_again(probe, robot)
    assert robot.do(lambda board: board.drive.unhandled + board.front.unhandled) == before


def test_the_same_port_twice_ends_the_start(robot: TwoPorts, start_driver: Start) -> None:
    """The user gives one port for both boards. The driver rejects this and exits with code 2."""
    driver: Driver = start_driver(robot.ports[0], board="fejemis", front_port=robot.ports[0])
    driver.wait_for_line("'front_port' must differ from 'port', .* their own port")
    assert driver.end() == 2


@pytest.mark.parametrize(
    ("ids", "wrong"),
    [((42, 91), "id 42"), ((90, 7), "id 7"), ((90, 90), "both ports lead to a drive board")],
)
def test_a_teensy_of_another_kind_is_named_and_nothing_moves(
    stack: ExitStack,
    tmp_path: Path,
    start_driver: Start,
    probe_of: Start,
    ids: tuple[int, int],
    wrong: str,
) -> None:
    """A port leads to a board with a wrong id.

    The driver logs what is wrong, and the robot rests.
    """
    robot = robot_of(stack, tmp_path, ids=ids)
    driver = started(robot, start_driver)
    probe: Probe = probe_of(driver)
    driver.wait_for_line(wrong)
    probe.wait_for_state("connecting")
    with probe.commanding(0.3):
        robot.stands_for_good()
    assert robot.do(lambda board: board.truth.x_m) == 0.0
