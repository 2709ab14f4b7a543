# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The conversation with a simulated LOIS ECU, as the rest of the driver uses it."""

import math
from dataclasses import replace

import pytest
from lois_drives import HOST_GAINS, Rig, nominal

from omnibot_driver.core.board import Mode
from omnibot_driver.core.lois_ecu import (
    EStopButton,
    RecordKind,
    Setting,
    TerminalMode,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.messages import Heading, SetTerminalMode, Ticks
from omnibot_driver.core.lois_ecu.readings import (
    RecordFailed,
    RecordReading,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.readings import DisplacementReading
from omnibot_driver.simulator.lois_ecu import FIRMWARE, Firmware, LoisSettings

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])
RPM = math.tau / 60


@pytest.mark.slow
@BOTH
def test_opened_it_is_configured_and_drives(firmware: Firmware) -> None:
    """After the port is opened, the driver configures the board, and the robot can be driven.

    The driver writes the low-pass gain, the message periods and the controller gains.
    """
    rig = Rig(nominal(firmware), LoisEcuSettings(written={Setting.LEFT_KP: 0.5}))
    assert rig.driver.mode is Mode.UNKNOWN
    rig.run(5.0)
    assert rig.driver.mode is Mode.NOMINAL
    assert rig.driver._upkeep.writer.confirmed
    assert rig.board.wheels[0].controller.gains.kp == pytest.approx(0.5)
    rig.order(20, 20, 4.0)
    assert rig.board.truth.speed_mps > 0.2
    assert any(isinstance(reading, DisplacementReading) for reading in rig.readings)


@pytest.mark.slow
def test_a_restarted_board_is_configured_again() -> None:
    """The board restarts. Its low-pass gain is then 0, so the wheels do not turn.

    The driver configures the board again, and the robot can be driven.
    """
    rig = Rig(nominal("firmware"))
    rig.run(5.0)
    rig.order(20, 20, 4.0)
    rig.order(0, 0, 2.0)
    rig.board.reboot()
    for _ in range(18):
        rig.run(0.1)
    rig.driver.silence()
    rig.run(4.0)
    assert rig.driver._upkeep.writer.confirmed
    rig.order(20, 20, 4.0)
    assert rig.board.truth.speed_mps > 0.2
    place, true = rig.estimates[-1][0].pose, rig.estimates[-1][1]
    assert place.way_to(true).way_m < 0.15


@pytest.mark.slow
def test_a_restart_that_no_silence_shows_is_seen_in_the_counters() -> None:
    """A board restarts so fast that no silence shows it, but its tick counters begin at zero again.

    The driver notices the restart by the counters, and configures the board again.
    """
    rig = Rig(LoisSettings(quirks=replace(FIRMWARE, slow_boot=False)))
    rig.run(5.0)
    rig.order(20, 20, 6.0)
    rig.order(0, 0, 2.0)
    rig.board.reboot()
    rig.run(3.0)
    assert rig.driver._translation.counts.restarts == 1
    assert rig.board.wheels[0].controller.gains.low_pass == pytest.approx(0.1)


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize(
    "before", [TerminalMode.GPS, TerminalMode.HOST_WITHOUT_SUM, TerminalMode.VIRTUAL_COM]
)
def test_a_board_that_was_left_in_another_mode_is_fetched_back(
    firmware: Firmware, before: TerminalMode
) -> None:
    """Another program has left the board in some terminal mode.

    The driver switches the board back to the mode of the protocol.
    """
    rig = Rig(nominal(firmware))
    rig.run(2.1)
    for _ in range(6):
        rig.board.receive(encode_command(SetTerminalMode(before)))
        rig.board.step()
    rig.driver = LoisConversation(LoisEcuSettings())
    while not rig.driver._upkeep.writer.confirmed:
        rig.run(0.1)
        assert rig.now < 14.5
    rig.run(0.5)
    assert rig.driver.mode is Mode.NOMINAL
    assert rig.board.wheels[0].short_correction == pytest.approx(1.0761719)


@pytest.mark.slow
def test_a_board_without_checksum_is_driven_without() -> None:
    """A robot whose user has switched the checksums off can be driven.

    The driver restores the setting LEFT_SHORT_CORRECTION, which the command for lines without
    checksums (0x11, value 4) overwrites.
    """
    rig = Rig(nominal("firmware"), LoisEcuSettings(with_sum=False))
    while not rig.driver._upkeep.writer.confirmed:
        rig.run(0.1)
        assert rig.now < 14.5
    rig.run(0.5)
    assert rig.board.terminal_mode == 4
    assert rig.board.wheels[0].short_correction == pytest.approx(1.0761719)
    before_m = rig.way_m
    rig.order(20, 20, 4.0)
    assert rig.way_m - before_m > 0.7


@pytest.mark.slow
@BOTH
def test_standstill_is_proved_where_ticks_count(firmware: Firmware) -> None:
    """After a forward drive, the ticks prove that the robot is at rest.

    The public firmware counts no ticks backward, so its ticks prove nothing after a backward drive.
    """
    rig = Rig(nominal(firmware))
    rig.run(5.0)
    rig.order(20, 20, 4.0)
    assert rig.driver.stands(rig.now) is False
    rig.order(0, 0, 0.1)
    assert rig.driver.stands(rig.now) is False
    while not rig.driver.stands(rig.now):
        rig.order(0, 0, 0.05)
        assert rig.now < 11.0
    assert rig.board.standing
    rig.run(5.0)
    assert rig.driver.stands(rig.now)
    rig.order(-20, -20, 4.0)
    rig.order(0, 0, 0.75)
    rig.run(0.7)
    assert rig.driver.stands(rig.now) is (None if firmware == "firmware" else True)


@pytest.mark.slow
@BOTH
def test_a_robot_that_was_stopped_starts_again_at_any_speed(firmware: Firmware) -> None:
    """A robot that was stopped starts again at any speed, even without feed-forward.

    After a stop, the firmware keeps the last speed of each wheel, which would prevent a slower
    start. The driver clears this speed.
    """
    rig = Rig(nominal(firmware), LoisEcuSettings())
    rig.run(5.0)
    for speed in (-30, -8, 30, 8):
        before_m = rig.way_m
        rig.order(speed, speed, 3.0)
        assert rig.way_m - before_m > 0.1, speed
        rig.order(0, 0, 0.7)


@pytest.mark.slow
def test_without_clearing_a_slower_start_fails_on_the_public_firmware() -> None:
    """If a drive ends with Stop, but without RPM 0/0, a slower set-point does not start the wheels.

    The firmware's controller still uses the higher speed that it measured last, and gives no power.
    """
    rig = Rig(nominal("firmware"), LoisEcuSettings())
    rig.run(5.0)
    rig.order(-30, -30, 4.0)
    rig.order(0, 0, 0.7)
    for _ in range(60):
        rig.board.receive(b":02fff8fff838\n")
        for _ in range(5):
            rig.board.step()
    assert rig.board.motors[0].rpm == 0.0


@pytest.mark.slow
@BOTH
def test_the_button_is_told_and_ends_motion(firmware: Firmware) -> None:
    """The user presses the e-stop button.

    The board cuts the motors, and the driver publishes the press.
    """
    rig = Rig(nominal(firmware))
    rig.run(5.0)
    rig.order(20, 20, 3.0)
    rig.board.press(True)
    rig.run(1.0)
    assert EStopButton(True) in rig.readings
    assert rig.board.standing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("firmware", "kind"),
    [*(("firmware", kind) for kind in RecordKind), ("documented", RecordKind.TORQUE)],
)
def test_a_record_is_made_whole(firmware: Firmware, kind: RecordKind) -> None:
    """A record that is requested while the wheels turn is delivered with all its samples.

    The driver knows the unit of the times in the record, which depends on the firmware.
    """
    rig = Rig(nominal(firmware))
    rig.run(4.0)
    rig.order(20, 20, 1.5)
    rig.driver.record(kind, 21)
    found: list[RecordReading] = []
    while not found:
        rig.run(0.1)
        found = [reading for reading in rig.readings if isinstance(reading, RecordReading)]
        assert rig.now < 14.5
    (reading,) = found
    assert reading.record.kind is kind
    assert len(reading.record.left) == 21
    assert len(reading.record.right) == (0 if kind is RecordKind.HEADING else 21)
    assert reading.count_s == (1e-4 if firmware == "firmware" else 1e-7)
    assert not [reading for reading in rig.readings if isinstance(reading, RecordFailed)]


@pytest.mark.slow
@pytest.mark.parametrize(("loss", "outcome"), [(0.0, RecordReading), (0.004, RecordFailed)])
def test_ticks_after_a_record_are_not_taken_for_late(loss: float, outcome: type) -> None:
    """Tick reports after a record are not regarded as late, even if lines of the record are lost.

    The public firmware's clock stops for 0.12 s during a record; ``odom`` must not jump later.
    """
    rig = Rig(nominal("firmware"))
    rig.run(4.0)
    rig.order(40, 40, 2.0)
    rig.driver.record(RecordKind.RPM, 100)
    while not [reading for reading in rig.readings if isinstance(reading, outcome)]:
        rig._loss = loss * rig.driver._decoder.in_record
        rig.order(40, 40, 0.05)
    rig._loss = 0.0
    seen = len(rig.estimates)
    rig.order(40, 40, 3.0)
    errors_m = [fused.pose.way_to(true).x_m for fused, true in rig.estimates[seen:]]
    assert max(errors_m) - min(errors_m) < 0.03


def test_a_record_that_lost_a_line_is_given_up() -> None:
    """A line of a record is lost, so a part of the samples is missing.

    The driver reports the failure and discards all samples.
    """
    rig = Rig(nominal("firmware"))
    rig.run(5.0)
    rig.driver.record(RecordKind.TORQUE, 100)
    rig.run(9.0)
    while not rig.driver._decoder.in_record:
        rig.run(0.01)
    rig.board.step()
    rig.run(2.0)
    assert [reading for reading in rig.readings if isinstance(reading, RecordFailed)]
    assert not [reading for reading in rig.readings if isinstance(reading, RecordReading)]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\xff\xfa" + bytes(12), "OmniBot"),
        (b"$GPRMC,120000,A,4807.0,N,01131.0,E*00\r\n", "NMEA"),
        (bytes(range(128, 256)), "baudrate"),
        (b":1000000005\n", "without checksum"),
        (b":1000000005ff\n", "wrong checksums"),
        (b":100005\n", "lines of 8 characters"),
        (b"hello world\n", "line of this board"),
    ],
)
def test_what_is_not_a_lois_ecu_is_told_in_a_sentence(data: bytes, words: str) -> None:
    """Data that does not come from a LOIS ECU arrives. The advice names what probably sends it.

    The advice is removed when the first valid line arrives.
    """
    ecu = LoisConversation(HOST_GAINS)
    assert ecu.receive(data * 100, 0.0) == []
    assert ecu.advice is not None
    assert words in ecu.advice
    assert ecu.mode is Mode.UNKNOWN
    ecu.receive(b"\n" + encode_report(Heading(5)), 1.0)
    assert ecu.advice is None
    assert ecu.mode is Mode.NOMINAL


def test_the_number_of_damaged_groups_survives_a_new_connection() -> None:
    """The driver counts damaged groups of lines. The count continues after a reconnection."""
    ecu = LoisConversation(LoisEcuSettings())
    groups = [encode_report(Ticks(1000 + 200 * i, 5 + i, 7 + i)) for i in range(3)]
    last_line_at = 3 * len(groups[0]) // 4
    for faults in (1, 2, 3):
        ecu.connect()
        ecu.receive(groups[0][:last_line_at] + groups[1] + groups[2], 1.0)
        assert ecu.figures.faults == faults
    assert ecu.figures.discarded_bytes == 0
