# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the topics and services that only a LOIS ECU has, on a real pseudo-terminal."""

import math
import signal
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from lois_ecu_rig import Ecu, ecu_of, set_parameter
from probe import Probe, leave_events_out
from rcl_interfaces.msg import Log
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus, TimeReference
from std_msgs.msg import Float32MultiArray, String
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.tools.calibrate import listener
from omnibot_driver.tools.calibrate.connection import connect
from omnibot_driver.tools.calibrate.interruption import Interruption
from omnibot_driver.tools.calibrate.tick_records import read
from omnibot_driver.tools.needs import ToolError

Start = Callable[..., Any]
NODE: Final = "omnibot_driver"


def test_led_and_ball(ecu: Ecu, probe: Probe) -> None:
    """One service switches the LED on and off. Another service sends the ball command exactly once.

    The board may miss the ball command, but a repetition could drop a second ball.
    """
    assert probe.call(SetBool, "led", data=True).success
    ecu.wait_for(lambda board: board.led)
    assert probe.call(SetBool, "led", data=False).success
    ecu.wait_for(lambda board: not board.led)
    assert probe.call(Trigger, "distribute_ball").success
    assert probe.call(SetBool, "led", data=True).success
    ecu.wait_for(lambda board: board.led)
    assert ecu.do(lambda board: board.received.count(b":19")) == 1
    assert ecu.do(lambda board: board.balls) <= 1


def test_gps_time_and_heading_are_published_where_the_board_tells_them(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """The driver publishes the board's GPS fix, time and heading.

    If the compass shows east and the declination is 0.1 rad, the heading is -0.1 rad: magnetic east
    is to the right of true east.
    """
    ecu = ecu_of("documented", stack, running=True)
    driver = start_driver(
        ecu.path, board="lois_ecu", date_period=0.5, time_period=0.5, magnetic_declination=0.1
    )
    probe: Probe = probe_of(driver)
    fixes = probe.listen(NavSatFix, "fix")
    times = probe.listen(TimeReference, "time_reference")
    headings = probe.listen(Imu, "imu/heading")
    probe.wait_for(lambda: times and headings)
    probe.wait_for(lambda: fixes and fixes[-1].status.status == NavSatStatus.STATUS_FIX)
    assert fixes[-1].header.frame_id == "gps_link"
    assert fixes[-1].latitude == pytest.approx(48.1, abs=1e-4)
    assert fixes[-1].position_covariance[0] >= 0.16
    assert times[-1].time_ref.sec > 946_684_800
    turn = headings[-1].orientation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(-0.1, abs=0.03)
    assert headings[-1].angular_velocity_covariance[0] == -1.0


def test_a_fix_of_the_public_firmware_is_none(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """The public firmware sends zeros instead of a position. The driver reports no fix."""
    probe: Probe = probe_of(start_driver(ecu_of("firmware", stack).path, board="lois_ecu"))
    fixes = probe.listen(NavSatFix, "fix")
    probe.wait_for(lambda: fixes)
    assert fixes[-1].status.status == NavSatStatus.STATUS_NO_FIX


def test_duties_are_commanded_in_duty_mode_and_one_that_waited_is_refused(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """The driver refuses a duty command that waited while the driver was suspended.

    Later duties are obeyed, limited to ``max_duty``, and expire like other commands.
    """
    ecu = ecu_of("firmware", stack)
    driver = start_driver(ecu.path, board="lois_ecu", drive_mode="duty", max_duty=40)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    publisher = probe.publisher(Float32MultiArray, "duty_cmd")
    driver.process.send_signal(signal.SIGSTOP)
    ecu.stands_for_good()
    publisher.publish(Float32MultiArray(data=[30.0, 30.0]))
    driver.answers.clear()  # the probe does not publish it again
    driver.process.send_signal(signal.SIGCONT)
    driver.wait_for_line("motion command refused: it waited")
    ecu.stands_for_good()
    assert ecu.do(lambda board: board.truth.x_m) == 0.0
    timer = probe.node.create_timer(
        0.1, lambda: publisher.publish(Float32MultiArray(data=[30.0, 60.0]))
    )
    ecu.wait_for(lambda board: [wheel.duty_percent for wheel in board.wheels] == [20, 40])
    ecu.wait_for(lambda board: not board.standing)
    probe.remove(timer)
    ecu.stands_for_good()


def test_duty_cmd_is_a_topic_of_its_own(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """Duties are commanded, then wheel rates. The diagnostics name the topic that commands.

    Regression: the diagnostics named ``wheel_cmd`` for commanded duties, too.
    """
    ecu = ecu_of("firmware", stack)
    probe: Probe = probe_of(start_driver(ecu.path, board="lois_ecu", drive_mode="duty"))
    probe.wait_for_state("nominal")
    diagnoses = probe.listen(DiagnosticArray, "/diagnostics")

    def source() -> str:
        pairs = (pair for one in diagnoses[-1:] for part in one.status for pair in part.values)
        return next((str(pair.value) for pair in pairs if pair.key == "Source"), "")

    for topic, value in (("duty_cmd", 30.0), ("wheel_cmd", 2.0)):
        publisher = probe.publisher(Float32MultiArray, topic)
        message = Float32MultiArray(data=[value, value])
        timer = probe.node.create_timer(0.1, lambda p=publisher, m=message: p.publish(m))
        probe.wait_for(lambda topic=topic: source() == topic)
        probe.remove(timer)
        probe.forget_message()


def test_a_terminal_mode_passes_lines_on_and_the_drive_mode_changes_while_it_runs(
    start_driver: Start, probe_of: Start, stack: ExitStack
) -> None:
    """The terminal mode and the drive mode can be changed while the driver runs.

    * Terminal mode "gps": ``~/terminal`` has the board's lines.
    * Drive mode "duty": the driver obeys ``duty_cmd``.
    """
    ecu = ecu_of("firmware", stack, running=True)
    probe: Probe = probe_of(start_driver(ecu.path, board="lois_ecu"))
    probe.wait_for_state("nominal")
    lines = probe.listen(String, f"{NODE}/terminal")
    log = probe.listen(Log, "/rosout")
    set_parameter(probe, "terminal_mode", "gps")
    probe.wait_for(lambda: any(line.data.startswith("$HCHDT") for line in lines))
    set_parameter(probe, "terminal_mode", "host")
    probe.wait_for(lambda: any("presses and releases" in line.msg for line in log))
    set_parameter(probe, "drive_mode", "duty")
    publisher = probe.publisher(Float32MultiArray, "duty_cmd")
    timer = probe.node.create_timer(
        0.1, lambda: publisher.publish(Float32MultiArray(data=[30.0, 30.0]))
    )
    ecu.wait_for(lambda board: [wheel.duty_percent for wheel in board.wheels] == [30, 30])
    probe.remove(timer)


def recorded(robot: Any) -> Path:
    """Record while the robot drives, and return the path of the record.

    On a busy computer, a record may fail, so the function tries at most ten times.
    """
    for _ in range(10):
        try:
            return Path(robot.record("record_rpm", "wheel_cmd", [3.0, 3.0]))
        except ToolError as error:
            if "call again" not in str(error):
                raise
    raise AssertionError("no record was made in ten calls")


def test_a_calibration_records_while_it_drives_and_leaves_the_robot_standing(
    start_driver: Start, stack: ExitStack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The calibration tool records the ticks of both wheels during a drive, and stops the robot.

    With a latched e-stop, the tool reports why a record fails.
    """
    leave_events_out(monkeypatch)
    monkeypatch.setattr(listener, "LOST_S", 3.0)  # for a busy computer
    ecu = ecu_of("firmware", stack, running=True)
    driver = start_driver(
        ecu.path,
        board="lois_ecu",
        record_samples=40,
        record_directory=str(tmp_path),
        cmd_vel_timeout=3.0,
    )
    driver.wait_for_line("state: nominal")
    with Interruption() as interruption, connect(driver.namespace, [], interruption) as robot:
        path = recorded(robot)
        ecu.stands_for_good()
        found = read(path)
        assert [len(found[side]) for side in ("left", "right")] == [40, 40]
        assert robot.parameters["motion_monitor"] is True
        robot.call("estop", on=True)
        with pytest.raises(ToolError, match="e-stop"):
            robot.record("record_rpm", "wheel_cmd", [3.0, 3.0])
