# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver with a simulated LOIS ECU on a pseudo-terminal: driving and stopping."""

import math
import signal
from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from driver_process import Driver
from lois_ecu_rig import Ecu, driven, ecu_of, set_parameter
from nav_msgs.msg import Odometry
from probe import Probe
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.files import CHECK_FOLDER
from omnibot_driver.simulator.lois_ecu import QUIRKS

Start = Callable[..., Any]
PATIENCE_S: Final = 30.0
NODE: Final = "omnibot_driver"
GAINS: Final = {
    "low_pass": 0.1,
    "left_feed_forward": 2.0,
    "left_kp": 0.629402,
    "left_tn": 0.301907,
    "left_td": 0.611789,
    "right_feed_forward": 2.0,
    "right_kp": 0.470583,
    "right_tn": 0.232542,
    "right_td": 0.60868,
}
"""Controller gains from docs/boards/lois_ecu.md.

With these gains, the wheel speeds do not oscillate.
"""


New = tuple[Ecu, Driver, Probe]


@pytest.mark.parametrize("firmware", QUIRKS)
def test_it_drives_and_odometry_tells_how_far_even_across_a_restart_of_the_board(
    firmware: str, stack: ExitStack, start_driver: Start, probe_of: Start
) -> None:
    """The robot drives, the board restarts, and the robot drives again.

    The odometry is right within 3 cm before the restart, and within 8 cm (or 3 sigma, if more)
    after the restart. The driver writes gains and periods again.
    """
    ecu = ecu_of(firmware, stack)
    probe: Probe = probe_of(start_driver(ecu.path, board="lois_ecu", ticks_period=0.2, **GAINS))
    probe.wait_for_state("nominal")
    ecu.wait_for(lambda board: board.wheels[1].controller.gains.kp == pytest.approx(0.470583))
    odometry = probe.listen(Odometry, "odom")
    joints = probe.listen(JointState, "joint_states")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.6)
    ecu.stands_for_good()
    truth = ecu.do(lambda board: board.truth)
    probe.wait_for_later_stamp(odometry)
    place = odometry[-1].pose.pose.position
    assert math.hypot(place.x - truth.x_m, place.y - truth.y_m) < 0.03
    assert joints[-1].name == ["left_wheel_joint", "right_wheel_joint"]
    ticks = ecu.do(lambda board: [wheel.ticks for wheel in board.wheels])
    rolled_m = [ticks_of_wheel * math.tau * 0.13 / 60 for ticks_of_wheel in ticks]
    assert [angle * 0.13 for angle in joints[-1].position] == pytest.approx(rolled_m, abs=0.06)
    assert 0.0 < odometry[-1].pose.covariance[0] < 0.05
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in odometry]
    assert all(after > before for before, after in pairwise(stamps))
    ecu.do(lambda board: board.reboot())
    ecu.wait_for(lambda board: board.wheels[1].controller.gains.kp == pytest.approx(0.470583))
    ecu.wait_for(lambda board: board._timers[0x12].period_ms == 200)
    probe.wait_for_state("nominal")
    with driven(probe, ecu):
        probe.wait_for(lambda: odometry[-1].pose.pose.position.x > place.x + 0.3)
    ecu.stands_for_good()
    truth = ecu.do(lambda board: board.truth)
    probe.wait_for_later_stamp(odometry)
    place, covariance = odometry[-1].pose.pose.position, odometry[-1].pose.covariance
    error_m = math.hypot(place.x - truth.x_m, place.y - truth.y_m)
    assert error_m < max(0.08, 3 * math.sqrt(covariance[0] + covariance[7]))


def test_the_estop_stops_it_until_it_is_released(ecu: Ecu, probe: Probe) -> None:
    """The e-stop is latched while commands continue to arrive. The robot stays at rest.

    After the release, the commands move the robot again.
    """
    with driven(probe, ecu):
        assert probe.call(SetBool, "estop", data=True).success
        ecu.stands_for_good()
        assert probe.call(SetBool, "estop", data=False).success
        ecu.wait_for(lambda board: not board.standing)


@pytest.mark.parametrize(
    ("firmware", "number"),
    [
        ("documented", signal.SIGINT),
        ("documented", signal.SIGSTOP),
        ("firmware", signal.SIGINT),
        ("firmware", signal.SIGKILL),
    ],
)
def test_whatever_ends_the_driver_stops_it(new: New, number: signal.Signals) -> None:
    """A signal ends or suspends the driver during a drive.

    The driver or its guard process stops the robot.
    """
    ecu, driver, probe = new
    with driven(probe, ecu):
        driver.process.send_signal(number)
        ecu.stands_for_good()
    if number is signal.SIGSTOP:
        driver.process.send_signal(signal.SIGCONT)
        ecu.stands_for_good()


def test_the_button_latches_the_drivers_estop_and_its_release_moves_nothing(
    ecu: Ecu, probe: Probe
) -> None:
    """The board's button stops the robot and latches the e-stop.

    Only the service ``~/estop`` releases the e-stop.
    """
    button = probe.listen(Bool, "estop_button", latched=True)
    latched = probe.listen(Bool, f"{NODE}/estop_active", latched=True)
    with driven(probe, ecu):
        assert not button
        ecu.do(lambda board: board.press(True))
        probe.wait_for(lambda: latched and latched[-1].data)
        probe.wait_for(lambda: button and button[-1].data)
        ecu.stands_for_good()
        ecu.do(lambda board: board.press(False))
        probe.wait_for(lambda: not button[-1].data)
        ecu.stands_for_good()
        assert probe.call(SetBool, "estop", data=False).success
        ecu.wait_for(lambda board: not board.standing)


def test_reset_is_confirmed_by_the_ticks(ecu: Ecu, probe: Probe) -> None:
    """``~/reset`` sets the board's tick counts to 0, but the pose in odom does not jump.

    Consecutive poses differ by less than 0.25 m. Up to 0.15 m is normal with one report in 400 ms.
    """
    odometry = probe.listen(Odometry, "odom")
    probe.wait_for(lambda: odometry)

    def way_m() -> float:
        first, last = (message.pose.pose.position for message in (odometry[0], odometry[-1]))
        return math.hypot(last.x - first.x, last.y - first.y)

    with driven(probe, ecu):
        probe.wait_for(lambda: way_m() > 0.3)
    ecu.stands_for_good()
    before_m = way_m()
    answer = probe.call(Trigger, "reset")
    assert answer.success, answer.message
    assert ecu.do(lambda board: [wheel.ticks for wheel in board.wheels]) == [0, 0]
    with driven(probe, ecu):
        probe.wait_for(lambda: way_m() > before_m + 0.1)
    assert all(
        math.hypot(b.x - a.x, b.y - a.y) < 0.25
        for a, b in pairwise(message.pose.pose.position for message in odometry)
    )


def test_a_gain_is_written_when_it_is_set_and_again_after_a_restart(ecu: Ecu, probe: Probe) -> None:
    """A user sets a gain. The driver writes it to the board, and again after a restart.

    Unset gains and periods are not written.
    """
    ecu.do(lambda board: board.commands.clear())
    set_parameter(probe, "left_kp", 0.5)
    ecu.wait_for(lambda board: board.wheels[0].controller.gains.kp == pytest.approx(0.5))
    ecu.do(lambda board: board.reboot())
    ecu.wait_for(lambda board: board.wheels[0].controller.gains.kp == pytest.approx(0.5))
    written = {obeyed.command for obeyed in ecu.do(lambda board: list(board.commands))}
    assert written <= {0x01, 0x02, 0x06, 0x0F, 0x11, 0x13, 0x23}


@pytest.mark.parametrize("firmware", QUIRKS)
def test_it_runs_inside_the_driver_too(firmware: str, start_driver: Start, probe_of: Start) -> None:
    """With the port ``sim://`` the driver runs the simulated LOIS ECU in its own process."""
    driver = start_driver(f"sim://?firmware={firmware}", board="lois_ecu")
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    home = f"/{driver.namespace}"
    probe.wait_for_node(NODE, home)

    def topics() -> set[str]:
        found = probe.node.get_publisher_names_and_types_by_node(NODE, home)
        return {name.removeprefix(f"{home}/") for name, _ in found}

    probe.wait_for_graph(lambda: topics() >= {"odom", "joint_states", "fix", "time_reference"})
    probe.wait_for_graph(lambda: topics() >= {"imu/heading", "estop_button"})
    assert "imu/data_raw" not in topics()
    assert driver.end(signal.SIGINT) == 0


def test_a_record_is_a_file_and_an_estop_ends_one(
    start_driver: Start, probe_of: Start, stack: ExitStack, tmp_path: Path
) -> None:
    """A user calls a record service. The answer is the path of the record's file.

    If the folder cannot be written, the answer says what to check. If the e-stop interrupts a
    record, no file is written.
    """
    ecu = ecu_of("firmware", stack, running=True)
    folder = tmp_path / "records"
    driver = start_driver(
        ecu.path, board="lois_ecu", record_samples=30, record_directory=str(folder)
    )
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    answer = probe.call(Trigger, "record_heading")
    assert answer.success, answer.message
    assert Path(answer.message).parent == folder
    assert len(Path(answer.message).read_text().splitlines()) == 31
    set_parameter(probe, "record_directory", "~nobody_of_this_name/records")
    answer = probe.call(Trigger, "record_heading")
    assert not answer.success
    assert "could not be saved" in answer.message
    assert CHECK_FOLDER in answer.message, answer.message
    status = probe.listen(DiagnosticArray, "/diagnostics")
    for _ in range(20):
        status.clear()
        waiting = probe.call_async(Trigger, "record_rpm")  # waits for ticks, which do not come
        probe.wait_for(lambda: waiting.arrived or "record of RPM: " in str(status))  # noqa: B023
        second = probe.call_async(Trigger, "record_torque")
        probe.wait_for(lambda: waiting.arrived or second.arrived)  # noqa: B023
        assert probe.call(SetBool, "estop", data=True).success
        ended = waiting.wait()
        assert not ended.success
        if "the driver stalled meanwhile" not in ended.message:
            break
        assert probe.call(SetBool, "estop", data=False).success
    assert "e-stop" in ended.message
    assert "record of RPM is under way" in second.wait().message
    assert len(list(folder.iterdir())) == 1
