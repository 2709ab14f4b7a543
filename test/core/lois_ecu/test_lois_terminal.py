# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Changes of the terminal mode and of the drive mode of a LOIS ECU.

Before such a change, the driver stops the robot and refuses motion. In a terminal mode, the board
passes on the lines of a sensor.
"""

from dataclasses import replace

import pytest
from lois_bench import FIRMWARE, Bench, configure, told

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.lois_ecu import (
    Record,
    RecordKind,
    SetDuty,
    SetRpm,
    TerminalLine,
    TerminalMode,
)
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import RecordComes, RecordFailed, TerminalLeft
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.terminal import ModeChange
from omnibot_driver.core.odometry.estimator import OdometryEstimate
from omnibot_driver.core.requests import Request

GPS = LoisEcuSettings(terminal_mode=TerminalMode.GPS)
COMPASS = LoisEcuSettings(terminal_mode=TerminalMode.COMPASS)


@pytest.mark.slow
@FIRMWARE
def test_a_terminal_mode_stops_first_and_refuses_motion(firmware: str) -> None:
    """The user sets a terminal mode during a drive. The driver stops the robot first.

    Then the sensor's lines are passed on, and motion is refused.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    begun = len(bench.written)
    configure(bench, COMPASS)
    stood: list[bool] = []
    while bench.board.terminal_mode == 0:
        with pytest.raises(CommandRefused, match=r"terminal_mode is (changing to )?compass"):
            bench.drive()
        bench.run(0.05)
        stood.append(bench.board.standing)
        assert len(stood) < 200
    assert stood[-1]
    assert bench.written[begun][1].startswith(b":01000000003b\n")
    bench.run(2.0)
    with pytest.raises(CommandRefused, match="terminal_mode is compass, so the board reports no"):
        bench.drive()
    assert told(bench, TerminalLine)[-1].text.startswith("$HCHDT")
    assert bench.robot.stands
    bench.drive(0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "drive_s"),
    [("documented", 2.5), ("documented", 2.62), ("firmware", 2.56), ("firmware", 2.68)],
)
def test_a_terminal_mode_begins_after_the_proof_of_the_stop(firmware: str, drive_s: float) -> None:
    """The user sets a terminal mode during a drive. In this mode, the board reports no motion.

    So the driver first stops the robot, and writes the mode only after the standstill is proved.
    The driver does not log that the stop is unconfirmed.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, drive_s)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.run(3.0)
    notices = [event.text for event in bench.events if isinstance(event, Notice)]
    assert not [text for text in notices if "unconfirmed" in text]


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("hears", [True, False])
def test_out_of_a_terminal_mode_the_correction_is_back_and_the_button_is_unknown(
    firmware: str, hears: bool
) -> None:
    """The user ends a terminal mode. The board may miss the first lines that end the mode.

    The driver still reports the end of the mode, and reports it once. It also restores the "short
    correction", a setting of the board that the mode overwrote. Then the robot obeys commands
    again.
    """
    bench = Bench(firmware)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.run(2.0)
    assert not told(bench, TerminalLeft)
    bench.hears = hears
    configure(bench, LoisEcuSettings())
    bench.run(1.3)
    bench.hears = True
    bench.run_until(lambda: bool(told(bench, TerminalLeft)))
    bench.run(2.0)
    assert len(told(bench, TerminalLeft)) == 1
    assert bench.board.terminal_mode == 0
    assert bench.board.wheels[0].short_correction == pytest.approx(1.0761719)
    bench.drive_on()
    assert not bench.robot.stands


def test_a_board_that_restarts_in_a_terminal_mode_is_put_back_into_it() -> None:
    """The board restarts while it is in a terminal mode. After the boot, it is in its normal mode.

    The driver writes the settings, and then the terminal mode again.
    """
    bench = Bench("firmware", GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.run(1.0)
    bench.board.reboot()
    bench.run(2.5)
    assert bench.board.terminal_mode == 0
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    assert bench.board.wheels[0].controller.gains.low_pass == 1.0


@pytest.mark.slow
@FIRMWARE
@pytest.mark.parametrize("settings", [GPS, COMPASS], ids=["gps", "compass"])
def test_odometry_stops_in_a_terminal_mode_and_continues_after_it(
    firmware: str, settings: LoisEcuSettings
) -> None:
    """In a terminal mode the board reports no motion.

    No odometry is published until the mode ends.
    """
    bench = Bench(firmware)
    configure(bench, settings)
    bench.run_until(lambda: bool(told(bench, TerminalLine)))
    bench.events.clear()
    for _ in range(300):
        bench.run(0.01)
        assert bench.session.wake_at > bench.now
    assert bench.session.state == "nominal"
    assert not [event for event in bench.events if isinstance(event, OdometryEstimate)]
    configure(bench, LoisEcuSettings())
    bench.run_until(lambda: bool(told(bench, TerminalLeft)))
    bench.run(1.0)
    assert [event for event in bench.events if isinstance(event, OdometryEstimate)]


@FIRMWARE
def test_an_estop_is_obeyed_in_a_terminal_mode(firmware: str) -> None:
    """In a terminal mode, the board obeys an e-stop.

    After the release of the e-stop, the driver still refuses motion, because of the terminal mode.
    """
    bench = Bench(firmware)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    bench.estop(True)
    bench.run(0.5)
    assert bench.board.commands[-1].command in (0x01, 0x02)
    bench.estop(False)
    with pytest.raises(CommandRefused, match="terminal_mode is gps"):
        bench.drive()


@pytest.mark.slow
@FIRMWARE
def test_another_drive_mode_stops_first(firmware: str) -> None:
    """The user sets another drive mode while the robot drives.

    The driver stops the robot, and refuses motion until the robot rests.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    with pytest.raises(CommandRefused, match="drive_mode is changing to duty"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)
    with pytest.raises(CommandRefused, match="wait"):
        bench.drive()
    bench.run(1.0)
    bench.drive_on(0.3, 2.0)
    assert bench.board.commands[-1].command == 0x01
    assert not bench.robot.stands


@pytest.mark.slow
@FIRMWARE
def test_backward_duty_after_a_forward_drive_is_backward_motion(firmware: str) -> None:
    """Odometry shows backward motion by duty after a forward drive.

    The user sets duty mode in a forward drive, then drives backward. After a Stop, the public
    firmware still has the RPM target of the forward drive. While this target is positive, the
    firmware counts all ticks as forward. So the driver clears the target before it drives by duty.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    bench.run_until(lambda: refusal(bench, -0.3) == "")
    before_m, before = bench.robot.way_m, bench.odometry[-1].pose
    bench.drive_on(-0.3, 1.5)
    assert bench.robot.way_m < before_m - 0.1
    assert before.way_to(bench.odometry[-1].pose).x_m < -0.1
    assert not [notice for notice in bench.notices if "motion monitor" in notice]


def test_another_duty_scale_stops_a_robot_that_is_driven_by_duties() -> None:
    """The robot is driven by duties, which depend on the duty scale. The user changes this scale.

    The driver stops the robot first.
    """
    bench = Bench("firmware", LoisEcuSettings(drive_mode="duty"))
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty", duty_scale=500.0))
    with pytest.raises(CommandRefused, match="duty_scale is changing to 500"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)


def test_a_latched_estop_does_not_jam_a_board_that_passes_it_on_to_the_compass() -> None:
    """While the e-stop is latched, the driver does not overload a board in compass mode.

    In this mode, the public firmware reads only 480 characters a second, so the driver sends only
    Stop. Lines that it sends later still arrive.
    """
    bench = Bench("firmware")
    configure(bench, COMPASS)
    bench.run_until(lambda: bench.board.terminal_mode == 2)
    bench.estop(True)
    bench.run(3.0)
    obeyed = len(bench.board.commands)
    bench.run(1.0)
    assert len(bench.board.commands) - obeyed > 10
    configure(bench, LoisEcuSettings())
    bench.run_until(lambda: bench.board.terminal_mode == 0)


def test_a_terminal_mode_ends_a_record() -> None:
    """A terminal mode that begins during a record ends this record.

    The driver abandons the record, because it cannot arrive in a terminal mode.
    """
    bench = Bench("firmware")
    board = bench.session.board
    assert isinstance(board, LoisEcuBoard)
    board.record(RecordKind.TORQUE, 500)
    bench.run(0.5)
    configure(bench, GPS)
    bench.run(0.5)
    assert "terminal_mode is changing to gps" in told(bench, RecordFailed)[0].reason
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    with pytest.raises(RequestRefused, match="terminal_mode is gps"):
        board.record(RecordKind.TORQUE, 500)


@pytest.mark.slow
@FIRMWARE
def test_a_terminal_mode_refuses_a_reset_at_once(firmware: str) -> None:
    """In a terminal mode, the board sends no counts, so nothing can show that it obeys a reset.

    The driver refuses the reset. After the mode has ended, a reset succeeds.
    """
    bench = Bench(firmware)
    configure(bench, GPS)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    begun = len(bench.written)
    with pytest.raises(RequestRefused, match="reset refused: terminal_mode is gps"):
        bench.session.request(Request.RESET, "token", bench.now)
    bench.run(1.0)
    assert b":18" not in b"".join(data for _, data in bench.written[begun:])
    configure(bench, LoisEcuSettings())
    with pytest.raises(RequestRefused, match="the board has not left its terminal mode yet"):
        bench.session.request(Request.RESET, "token", bench.now)
    bench.run_until(lambda: bool(told(bench, TerminalLeft)))
    assert bench.reset().success


@pytest.mark.slow
def test_a_record_that_was_given_up_is_dropped_when_it_comes() -> None:
    """The driver drops a record that it has given up, when the record arrives later.

    The drive mode changes during the record, so the driver gives the record up. The board completes
    the record and sends it. Its lines still show the driver that the board is connected.
    """
    bench = Bench("firmware")
    bench.record(RecordKind.TORQUE, 60)
    bench.run(0.5)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    bench.run(8.0)
    assert told(bench, RecordFailed)
    assert told(bench, RecordComes)
    assert not told(bench, Record)


def refusal(bench: Bench, vx: float = 0.3) -> str:
    """Return why the driver refuses a motion command; empty if it accepts the command."""
    try:
        bench.drive(vx)
    except CommandRefused as refused:
        return str(refused).removeprefix("motion command refused: ")
    return ""


@pytest.mark.slow
@FIRMWARE
def test_each_reason_for_a_refusal_appears_exactly_while_it_is_true(firmware: str) -> None:
    """The driver gives each reason for a refusal only while this reason is true.

    The user sets a terminal mode during a drive, and later ends it. Until the mode is written, the
    reason is that the mode is changing. While the board is in the mode, the reason is the mode.
    After the user has ended the mode, the reason is that the board has not left it yet.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, GPS)
    assert "the robot is being stopped first" in refusal(bench)
    told_before, told_in_gps, told_after = set(), set(), set()
    while not any(b":1100000001" in data for _, data in bench.written):
        told_before.add(refusal(bench))
        bench.run(0.01)
    assert all(one.startswith("terminal_mode is changing to gps") for one in told_before)
    bench.run_until(lambda: bench.board.terminal_mode == 1)
    for _ in range(20):
        told_in_gps.add(refusal(bench))
        bench.run(0.1)
    assert told_in_gps == {
        "terminal_mode is gps, so the board reports no motion; set terminal_mode to host"
    }
    configure(bench, LoisEcuSettings())
    while not told(bench, TerminalLeft):
        told_after.add(refusal(bench))
        bench.run(0.05)
    assert told_after == {
        "the board has not left its terminal mode yet; wait until its reports arrive"
    }
    assert refusal(bench) == ""


def test_a_mode_that_is_not_written_yet_is_still_changing() -> None:
    """In two situations, refusals say that the terminal mode is still changing.

    In the first, the robot is at rest, but the driver must write its settings before the mode. In
    the second, the driver has written the mode, but messages of the normal mode arrive. They show
    that the board is not in the terminal mode.
    """
    change = ModeChange()
    change.want(TerminalMode.GPS)
    assert change.stops(0.0, stands=False, cleared=False) == SetDuty(0, 0)
    assert change.stops(0.1, stands=True, cleared=False) == SetRpm(0, 0)
    assert change.stops(0.2, stands=True, cleared=True) is None
    changing = "terminal_mode is changing to gps; set terminal_mode to host"
    assert change.due(0.2, settled=False) is None
    assert change.reason == changing
    assert change.due(1.0, settled=True) is TerminalMode.GPS
    assert change.reason.startswith("terminal_mode is gps, so the board reports no motion")
    change.protocol_heard(2.0)
    assert change.reason == changing


def test_a_terminal_mode_that_is_taken_back_refuses_no_motion() -> None:
    """A terminal mode that the user takes back does not lead to refusals of motion.

    The user sets a terminal mode. While the robot is being stopped, the user sets ``host`` (the
    normal mode) again. The board stays in its normal mode, so motion is allowed. The earlier motion
    is not continued.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, 1.0)
    configure(bench, GPS)
    bench.run(0.1)
    configure(bench, LoisEcuSettings())
    bench.run(2.0)
    assert bench.robot.stands
    assert refusal(bench) == ""
    assert bench.board.terminal_mode == 0


def test_a_terminal_mode_that_is_taken_back_does_not_end_another_stop() -> None:
    """A terminal mode that is taken back does not end the stop for a new drive mode.

    The user changes the drive mode, sets a terminal mode, and takes the terminal mode back. The new
    drive mode can begin only when the robot has been stopped, so the driver still stops the robot.
    Until the new drive mode begins, refusals name the drive mode. They no longer name the terminal
    mode.
    """
    bench = Bench("documented")
    bench.drive_on(0.3, 2.0)
    duty = LoisEcuSettings(drive_mode="duty")
    configure(bench, duty)
    configure(bench, replace(duty, terminal_mode=TerminalMode.GPS))
    both = "drive_mode is changing to duty and terminal_mode is changing to gps, and the robot"
    assert refusal(bench).startswith(both)
    configure(bench, duty)
    while reason := refusal(bench):
        assert (
            reason == "drive_mode is changing to duty, and the robot is being stopped first; wait"
        )
        bench.run(0.05)
    bench.run(0.5)
    assert not [line for line in bench.board.commands if line.command == 0x11]
