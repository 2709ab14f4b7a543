# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Terminal modes of a LOIS ECU, in which the board passes on a sensor's lines to the host.

Before the mode changes, the driver stops the robot and refuses motion.
"""

import pytest
from lois_bench import FIRMWARE, Bench, configure, told

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.lois_ecu import (
    Record,
    RecordKind,
    TerminalLine,
    TerminalMode,
)
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.readings import RecordComes, RecordFailed, TerminalLeft
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.odometry.estimate import OdometryEstimate
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
    """The driver writes a terminal mode only after the robot's standstill is proved.

    In a terminal mode, the board reports no motion, so the stop could not be confirmed. No notice
    says that the stop is unconfirmed.
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
    """The user ends a terminal mode. The mode has overwritten a setting (left short correction).

    The driver restores this setting, and reports the end of the mode once.

    ``hears``: whether lines reach the board in the first 1.3 s.
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
    """While ``terminal_mode`` is gps, the board obeys an e-stop.

    After the release of the e-stop, the driver still refuses motion, because of this mode.
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


def test_a_latched_estop_does_not_jam_a_board_that_passes_it_on_to_the_compass() -> None:
    """While the e-stop is latched, the driver sends only Stop to a board in compass mode.

    The public firmware reads only 480 characters a second in this mode.
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
    """A record that the driver has given up is dropped when it arrives.

    The driver has given it up because the drive mode changed. The record still shows that the board
    is connected.
    """
    bench = Bench("firmware")
    bench.record(RecordKind.TORQUE, 60)
    bench.run(0.5)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    bench.run(8.0)
    assert told(bench, RecordFailed)
    assert told(bench, RecordComes)
    assert not told(bench, Record)
