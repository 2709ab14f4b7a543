# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated LOIS ECU: periodic messages and commands, with both firmware variants."""

import math
from functools import reduce
from operator import xor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lois_rig import LOW_PASS, Rig, ticks_in

from omnibot_driver.core.lois_ecu import (
    PERIOD_OFF,
    PERIOD_ONCE,
    BoardOdometry,
    DistributeBall,
    EStopButton,
    GpsDate,
    GpsPosition,
    GpsTime,
    Heading,
    SetDuty,
    SetLed,
    SetPeriod,
    SetRpm,
    SetTerminalMode,
    Stream,
    TerminalLine,
    TerminalMode,
    Ticks,
    encode_command,
)
from omnibot_driver.simulator.lois_ecu import DOCUMENTED, FIRMWARE, Quirks, SimulatedLois

BOTH = pytest.mark.parametrize("quirks", [DOCUMENTED, FIRMWARE], ids=["documented", "firmware"])


@BOTH
def test_it_sends_what_the_manual_lists_by_itself(quirks: Quirks) -> None:
    """Without a request, the board sends all periodic messages except the date.

    All arrive undamaged, with periods of about 400 ms, 1 s and 1.2 s.
    """
    rig = Rig(quirks)
    heard = rig.run(22.0)
    counts = dict.fromkeys((Ticks, Heading, BoardOdometry, GpsTime, GpsPosition, GpsDate), 0)
    for report in heard:
        counts[type(report)] += 1
    assert 46 <= counts[Ticks] <= 56
    assert 46 <= counts[Heading] <= 56
    appended = counts[Ticks] if quirks.appends_odometry else 0
    assert 46 <= counts[BoardOdometry] - appended <= 56
    assert 18 <= counts[GpsTime] <= 23
    assert 15 <= counts[GpsPosition] <= 19
    assert counts[GpsDate] == 0
    assert rig.decoder.statistics.faults == rig.decoder.group_statistics.damaged_groups == 0


@pytest.mark.slow
def test_periods_stretch_with_the_load() -> None:
    """The public firmware sends a message with a period of 400 ms only every 422 ms."""
    rig = Rig()
    rig.run(3.0)
    assert len(ticks_in(rig.run(42.2))) in range(98, 103)


@pytest.mark.slow
@BOTH
def test_the_robot_stands_at_the_commanded_speed_after_a_while(quirks: Quirks) -> None:
    """20 RPM are commanded once.

    Both wheels reach that speed and keep it, because set-points never expire.
    """
    rig = Rig(quirks).booted()
    rig.drive(20, 20, 10.0)
    speeds = []
    for _ in range(500):
        rig.board.step()
        speeds.append([motor.rpm for motor in rig.board.motors])
    for wheel in zip(*speeds, strict=True):
        assert sum(wheel) / len(wheel) == pytest.approx(20.5, abs=1.0)


@pytest.mark.slow
@BOTH
def test_both_kinds_of_zero_stop_it_in_each_mode(quirks: Quirks) -> None:
    """The robot drives by a speed or a duty command.

    Both zero RPM and zero duty stop it within 0.5 s.
    """
    rig = Rig(quirks).booted()
    for drive in (SetRpm(30, 30), SetRpm(-30, 30), SetDuty(45, 45), SetDuty(-45, 45)):
        for stop in (SetRpm(0, 0), SetDuty(0, 0)):
            rig.say(drive)
            rig.run(3.0)
            assert not rig.board.standing
            rig.say(stop)
            rig.run(0.5)
            assert rig.board.standing, (drive, stop)
            rig.say(SetRpm(0, 0))


@pytest.mark.parametrize("correction", [math.nan, math.inf, 1e30])
def test_a_correction_beyond_all_numbers_ends_no_board(correction: float) -> None:
    """The board survives a correction factor of NaN, infinity or 1e30 for a wheel's tick times.

    The wheels still turn, and the board continues to send.
    """
    rig = Rig(DOCUMENTED).booted()
    rig.board.wheels[0].short_correction = correction
    rig.say(SetDuty(45, 45))
    assert ticks_in(rig.run(1.0))
    assert not rig.board.standing


@pytest.mark.slow
@BOTH
def test_the_button_stops_it_and_is_told_both_ways(quirks: Quirks) -> None:
    """The button stops the robot, and the board reports when it is pressed and when it is released.

    A new set-point moves the robot even while the button is pressed.
    """
    rig = Rig(quirks).booted()
    rig.drive(20, 20, 4.0)
    rig.board.press(True)
    assert EStopButton(True) in rig.run(1.0)
    assert rig.board.standing
    rig.board.press(False)
    assert EStopButton(False) in rig.run(1.0)
    assert rig.board.standing
    rig.board.press(True)
    rig.drive(20, 20, 3.0)
    assert not rig.board.standing


@BOTH
def test_terminal_mode_passes_lines_of_a_sensor_and_silences_the_protocol(quirks: Quirks) -> None:
    """In a terminal mode the board sends only lines of the sensor, but still obeys commands."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.decoder.terminal = True
    rig.say(SetTerminalMode(TerminalMode.COMPASS))
    heard = rig.run(1.0)
    assert any(
        isinstance(report, TerminalLine) and report.text.startswith("$HCHDT,90") for report in heard
    )
    assert all(isinstance(report, TerminalLine) for report in heard)
    rig.say(SetTerminalMode(TerminalMode.GPS))
    texts = [report.text for report in rig.run(2.5) if isinstance(report, TerminalLine)]
    assert any(text.startswith("$GPRMC") for text in texts) or quirks.terminal_mixes_sensors
    rig.say(SetTerminalMode(TerminalMode.HOST))
    rig.run(0.5)
    assert ticks_in(rig.run(1.0))


@BOTH
def test_without_checksum_it_takes_shorter_lines_alone(quirks: Quirks) -> None:
    """After checksums are switched off, the board obeys only lines without a checksum.

    The lines that the board sends still have one.
    """
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetTerminalMode(TerminalMode.HOST_WITHOUT_SUM))
    rig.board.receive(b":0300000001\n" * 5)
    rig.run(0.2)
    assert rig.board.led
    rig.board.receive(b":030000000039\n" * 5)
    rig.run(0.2)
    assert rig.board.led
    assert ticks_in(rig.run(1.0))
    rig.say(SetTerminalMode(TerminalMode.HOST))
    rig.say(SetLed(False))
    assert not rig.board.led


@BOTH
def test_junk_before_a_colon_is_harmless(quirks: Quirks) -> None:
    """Characters between two commands are harmless: a colon begins a new line."""
    rig = Rig(quirks)
    rig.run(2.1)
    for line in (b"\xffx:030000000138\n", b":19000000003200:190000000032\n"):
        for _ in range(4):
            rig.board.receive(line)
            rig.run(0.1)
    assert rig.board.led
    assert rig.board.balls
    rig.say(DistributeBall())


@BOTH
def test_a_carriage_return_makes_a_line_too_long(quirks: Quirks) -> None:
    """A command ends with CR LF, so it has one character too many. The board rejects it."""
    rig = Rig(quirks)
    rig.run(2.1)
    for _ in range(4):
        rig.board.receive(b":030000000138\r\n")
        rig.run(0.1)
    assert not rig.board.commands


@pytest.mark.parametrize("payload", [b"0000 +01", b"00000x01", b"0000-fff"])
def test_the_firmware_reads_numbers_as_strtol_does(payload: bytes) -> None:
    """The firmware accepts a number with a space, a sign or a prefix, because ``strtol`` does."""
    rig = Rig(FIRMWARE)
    rig.run(2.1)
    text = b":03" + payload
    for _ in range(4):
        rig.board.receive(text + b"%02x\n" % reduce(xor, text))
        rig.run(0.1)
    assert rig.board.led


@BOTH
def test_a_message_can_be_asked_for_once_or_turned_off(quirks: Quirks) -> None:
    """A period of 0xfffe requests a message once. A period of 0xffff switches the message off."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetPeriod(Stream.TICKS, PERIOD_OFF), SetPeriod(Stream.GPS_DATE, PERIOD_ONCE))
    assert not ticks_in(rig.run(3.0))
    assert len([report for _, report in rig.heard if isinstance(report, GpsDate)]) == 1
    rig.heard.clear()
    rig.say(SetPeriod(Stream.TICKS, PERIOD_ONCE))
    rig.run(2.0)
    assert len(ticks_in([report for _, report in rig.heard])) == 1


@pytest.mark.slow
def test_the_gps_moves_with_the_robot() -> None:
    """The reported longitude agrees with the robot's x axis, which points east."""
    rig = Rig(DOCUMENTED)
    rig.drive(20, 20, 20.0)
    fixes = [report for report in rig.drive(0, 0, 3.0) if isinstance(report, GpsPosition)]
    way = (fixes[-1].longitude_deg - 11.5) * 111195 * math.cos(math.radians(48.1))
    assert rig.board.truth.x_m > 4.0
    assert way == pytest.approx(rig.board.truth.x_m, abs=0.05)


def test_a_reboot_is_two_silent_seconds_and_forgets_all_but_the_place() -> None:
    """A reboot makes the board silent for 2 s, and resets everything but the robot's true pose.

    Until the low-pass filter is set again, the board obeys no speed command.
    """
    rig = Rig().booted()
    rig.drive(20, 20, 4.0)
    place = rig.board.truth
    rig.board.reboot()
    assert rig.run(1.9) == []
    assert rig.board.standing
    assert rig.board.truth.x_m >= place.x_m
    assert ticks_in(rig.run(1.0))[-1].left == 0
    rig.drive(20, 20, 2.0)
    assert rig.board.standing


@pytest.mark.parametrize(("quirks", "unit_s"), [(DOCUMENTED, 1e-9), (FIRMWARE, 1e-3)])
def test_a_reboot_restarts_the_clock(quirks: Quirks, unit_s: float) -> None:
    """A reboot resets the clock of the tick reports, but not the time of the GPS receiver.

    The board reboots after 3 s.
    """
    rig = Rig(quirks, running=True)
    rig.run(3.0)
    rig.board.reboot()
    began_s = rig.now
    rig.run(3.0)
    at_s, ticks = [(at, one) for at, one in rig.heard if isinstance(one, Ticks)][-1]
    assert ticks.time_counts * unit_s == pytest.approx(at_s - began_s, abs=0.3)
    times = [one for _, one in rig.heard if isinstance(one, GpsTime)]
    assert times == sorted(times, key=lambda time: (time.hours, time.minutes, time.seconds))


def test_a_reboot_switches_the_led_off_and_another_ball_may_drop_at_once() -> None:
    """A reboot switches the LED off, and the board can drop the next ball at once.

    Without a reboot, the board would refuse a second ball for 6 s.
    """
    rig = Rig().booted()
    rig.say(SetLed(True), DistributeBall())
    rig.board.reboot()
    assert not rig.board.led
    rig.booted()
    rig.say(DistributeBall())
    assert rig.board.balls == 2


def test_input_while_booting_is_kept_up_to_600_characters() -> None:
    """The board keeps the first 600 characters that arrive during the boot, and obeys them.

    Here, 700 characters arrive. The last 100 are lost.
    """
    rig = Rig()
    rig.board.receive(encode_command(LOW_PASS) * 50)
    rig.run(2.3)
    assert len(rig.board.commands) == 42
    assert rig.board.lost_bytes == 100


def test_planted_errors_are_in_the_truth_alone() -> None:
    """The true wheels are 5 % larger than the board assumes.

    So the distance in the board's odometry is too short.
    """
    rig = Rig(DOCUMENTED, wheel_radius_scale=(1.05, 1.05))
    rig.drive(20, 20, 10.0)
    rig.say(SetRpm(0, 0))
    rig.run(1.0)
    truth, told = rig.board.truth, rig.board.odometry.pose
    assert math.hypot(truth.x_m, truth.y_m) / math.hypot(*told[:2]) == pytest.approx(1.05, rel=0.01)


@given(st.lists(st.binary(max_size=200), max_size=6))
@settings(max_examples=30)
def test_any_bytes_are_taken(chunks: list[bytes]) -> None:
    """The board receives any bytes. No exception is raised, and equal input gives equal output."""
    sent = []
    for _ in range(2):
        board = SimulatedLois()
        out = b""
        for chunk in chunks:
            board.receive(chunk)
            out += b"".join(board.step() for _ in range(5))
        sent.append((out, board.truth))
    assert sent[0] == sent[1]
