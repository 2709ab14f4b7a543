# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU as the rest of the driver sees it, against the simulated board."""

import math
from dataclasses import replace
from datetime import date

import pytest
from lois_drives import Rig, nominal

from omnibot_driver.core.board import Mode
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import (
    EStopButton,
    GpsDate,
    GpsTime,
    RecordKind,
    SetDuty,
    Setting,
    Stream,
    TerminalMode,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.board import LoisEcu
from omnibot_driver.core.lois_ecu.messages import Heading, SetTerminalMode
from omnibot_driver.core.lois_ecu.readings import (
    FixReading,
    HeadingReading,
    RecordFailed,
    RecordReading,
    TimeReading,
)
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.readings import DisplacementReading
from omnibot_driver.simulator.lois_ecu import DOCUMENTED, FIRMWARE, Firmware, LoisSettings

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])
STOP = b":01000000003b\n"
CLEAR = b":020000000038\n"
RPM = math.tau / 60


def started(settings: LoisEcuSettings | None = None) -> LoisEcu:
    """Past the first set-points after a Stop."""
    ecu = LoisEcu(LoisEcuSettings() if settings is None else settings)
    ecu.wrote(CLEAR * 3, 0.0)
    return ecu


# Set-points, by hand


def test_stop_is_duty_zero_and_the_emergency_stop_is_rpm_zero() -> None:
    """So both kinds of zero alternate under the e-stop."""
    ecu = LoisEcu(LoisEcuSettings())
    assert ecu.stop() == STOP
    assert ecu.emergency_stop() == CLEAR


@pytest.mark.parametrize(
    ("rates", "line"),
    [
        ((20, 20), b":020014001438\n"),
        ((20, -20), b":020014ffec3b\n"),
        ((0.4, -0.4), STOP),
        ((0.6, 0.0), b":020001000039\n"),
        ((100, 50), b":020032001938\n"),
        ((-500, 0), b":02ffce00006f\n"),
    ],
)
def test_wheel_rates_are_whole_rpm_at_most_50(rates: tuple[float, float], line: bytes) -> None:
    """Both are slowed alike; what rounds to nothing is Stop."""
    ecu = started()
    total = 0
    for character in line[:11]:
        total ^= character
    data = ecu.wheels([rate * RPM for rate in rates])
    assert data == line[:11] + b"%02x\n" % total
    assert ecu.figures.saturated == (max(map(abs, rates)) > 50)


def test_a_twist_is_said_and_understood() -> None:
    """0.2723 m/s forward are 20 RPM; turning left speeds up the right wheel."""
    ecu = started()
    assert ecu.velocity(BodyTwist(0.2723, 0.0, 0.0)) == b":020014001438\n"
    meaning = ecu.meaning(ecu.velocity(BodyTwist(0.3, 0.1, 0.5)))
    assert meaning.vx_mps == pytest.approx(0.3, abs=0.007)
    assert meaning.vy_mps == 0.0
    assert meaning.yaw_rate_radps == pytest.approx(0.5, abs=0.03)
    assert ecu.meaning(ecu.stop()) == BodyTwist(0.0, 0.0, 0.0)


def test_an_inverted_board_has_its_wheels_exchanged() -> None:
    """In what is said and in what is meant by it."""
    ecu = started(LoisEcuSettings(inverted=True))
    left = ecu.velocity(BodyTwist(0.0, 0.0, 0.5))
    assert left == started().velocity(BodyTwist(0.0, 0.0, -0.5))
    assert ecu.meaning(left).yaw_rate_radps > 0


def test_duty_is_limited_and_belongs_to_its_mode() -> None:
    """In percent, both slowed alike."""
    with pytest.raises(CommandRefused, match="drive_mode is rpm"):
        started().duty((10, 10))
    ecu = started(LoisEcuSettings(drive_mode="duty", max_duty=60))
    assert ecu.duty((50, 50)) == b":01003200323b\n"
    assert ecu.duty((120, 60)) == encode_command_duty(60, 30)
    assert ecu.velocity(BodyTwist(0.2, 0.0, 0.0)) == encode_command_duty(26, 26)
    assert ecu.meaning(encode_command_duty(26, 26)).vx_mps == pytest.approx(0.2)


def encode_command_duty(left: int, right: int) -> bytes:
    """By the codec, which has golden lines of its own."""
    return encode_command(SetDuty(left, right))


def test_the_first_set_points_after_a_stop_clear_the_measured_speed() -> None:
    """Three times, as one may be lost: a wheel that stands would never start otherwise."""
    ecu = started()
    drive = b":020014001438\n"
    for now in (1.0, 1.1):
        ecu.wrote(ecu.wheels((20 * RPM, 20 * RPM)), now)
    ecu.wrote(ecu.stop(), 2.0)
    for now in (2.1, 2.2, 2.3):
        data = ecu.wheels((20 * RPM, 20 * RPM))
        assert data == CLEAR + drive
        ecu.wrote(data, now)
    assert ecu.wheels((20 * RPM, 20 * RPM)) == drive


def test_a_record_that_cannot_complete_is_refused() -> None:
    """More than 1024 samples never end."""
    ecu = started()
    for samples in (0, 1025):
        with pytest.raises(RequestRefused, match="1 to 1024"):
            ecu.record(RecordKind.TORQUE, samples)


@pytest.mark.parametrize(
    ("kind", "samples", "line"),
    [
        (RecordKind.RPM, 100, b":04006400643e\n"),
        (RecordKind.TORQUE, 1, b":17000100013c\n"),
        (RecordKind.HEADING, 3, b":0c000000036a\n"),
    ],
)
def test_a_record_is_asked_for_three_times(kind: RecordKind, samples: int, line: bytes) -> None:
    """As a line may be lost; in a third of a second, as each makes the board begin anew."""
    ecu = started()
    ecu.record(kind, samples)
    sent = b"".join(ecu.due(0.01 * step) for step in range(100))
    assert sent.count(line) == 3
    ecu.record(kind, samples)
    assert line in b"".join(ecu.due(1.0 + 0.01 * step) for step in range(30))


# With a board


@BOTH
def test_opened_it_is_configured_and_drives(firmware: Firmware) -> None:
    """The low-pass, the periods and what the user set arrive in spite of what the board misses."""
    rig = Rig(nominal(firmware), LoisEcuSettings(written={Setting.LEFT_KP: 0.5}))
    assert rig.driver.mode is Mode.UNKNOWN
    rig.run(5.0)
    assert rig.driver.mode is Mode.NOMINAL
    assert rig.driver.configured
    assert rig.driver.confirmed
    assert rig.board.wheels[0].controller.gains.kp == pytest.approx(0.5)
    rig.order(20, 20, 4.0)
    assert rig.board.truth.speed_mps > 0.2
    assert any(isinstance(reading, DisplacementReading) for reading in rig.readings)


@pytest.mark.slow
def test_a_restarted_board_is_configured_again() -> None:
    """Else its wheels would not turn."""
    rig = Rig(nominal("firmware"))
    rig.run(5.0)
    rig.order(20, 20, 4.0)
    rig.order(0, 0, 2.0)
    rig.board.reboot()
    for _ in range(18):
        rig.run(0.1)
    rig.driver.silence()
    rig.run(4.0)
    assert rig.driver.confirmed
    rig.order(20, 20, 4.0)
    assert rig.board.truth.speed_mps > 0.2
    place, true = rig.estimates[-1][0].pose, rig.estimates[-1][1]
    assert place.way_to(true).way_m < 0.15


def test_a_restart_that_no_silence_shows_is_seen_in_the_counters() -> None:
    """Ticks that begin anew."""
    rig = Rig(LoisSettings(quirks=replace(FIRMWARE, slow_boot=False)))
    rig.run(5.0)
    rig.order(20, 20, 6.0)
    rig.order(0, 0, 2.0)
    rig.board.reboot()
    rig.run(3.0)
    assert rig.driver._translation.restarts == 1
    assert rig.board.wheels[0].controller.gains.low_pass == pytest.approx(0.1)


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize(
    "before", [TerminalMode.GPS, TerminalMode.HOST_WITHOUT_SUM, TerminalMode.VIRTUAL_COM]
)
def test_a_board_that_was_left_in_another_mode_is_fetched_back(
    firmware: Firmware, before: TerminalMode
) -> None:
    """Whatever a program before us has set; also with the checksum of what we say turned off."""
    rig = Rig(nominal(firmware))
    rig.run(2.1)
    for _ in range(6):
        rig.board.receive(encode_command(SetTerminalMode(before)))
        rig.board.step()
    rig.driver = LoisEcu(LoisEcuSettings())
    for _ in range(120):
        rig.run(0.1)
    assert rig.driver.mode is Mode.NOMINAL
    assert rig.driver.confirmed
    assert rig.board.wheels[0].short_correction == pytest.approx(1.0761719)


def test_a_board_without_checksum_is_driven_without() -> None:
    """0x11 value 4, and the left short correction that it overwrites."""
    rig = Rig(nominal("firmware"), LoisEcuSettings(with_sum=False))
    for _ in range(140):
        rig.run(0.1)
    assert rig.driver.confirmed
    assert rig.board.terminal_mode == 4
    assert rig.board.wheels[0].short_correction == pytest.approx(1.0761719)
    rig.order(20, 20, 4.0)
    assert rig.board.truth.speed_mps > 0.2


@BOTH
def test_standstill_is_proved_where_ticks_count(firmware: Firmware) -> None:
    """After driving forward; the public firmware tells nothing after driving backward."""
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
    """Also slower, in the same direction, at once: the firmware remembers the old speed."""
    rig = Rig(nominal(firmware))
    rig.run(5.0)
    for _ in range(3):
        for speed in (-30, -8, 30, 8):
            before_m = rig.way_m
            rig.order(speed, speed, 3.0)
            assert rig.way_m - before_m > 0.1, speed
            rig.order(0, 0, 0.7)


def test_without_clearing_a_slower_start_fails_on_the_public_firmware() -> None:
    """Why RPM 0/0 stands before the first set-points; without feed-forward."""
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
    """Latching is the driver's affair."""
    rig = Rig(nominal(firmware))
    rig.run(5.0)
    rig.order(20, 20, 3.0)
    rig.board.press(True)
    rig.run(1.0)
    assert EStopButton(True) in rig.readings
    assert rig.board.standing


def test_gps_and_compass_come_in_si_units_and_enu() -> None:
    """East is 0; without a date there is no time, and 0/0 is not a fix."""
    rig = Rig(
        LoisSettings(quirks=DOCUMENTED),
        LoisEcuSettings(periods_ms={Stream.TICKS: 200, Stream.GPS_DATE: 1000}),
    )
    rig.run(6.0)
    fixes = [reading for reading in rig.readings if isinstance(reading, FixReading)]
    assert fixes[-1].valid
    assert fixes[-1].latitude_deg == pytest.approx(48.1, abs=1e-5)
    headings = [reading for reading in rig.readings if isinstance(reading, HeadingReading)]
    assert headings[-1].yaw_rad == pytest.approx(0.0, abs=0.02)
    times = [reading.utc_s for reading in rig.readings if isinstance(reading, TimeReading)]
    assert times[-1] is not None
    day_s = 86400
    simulated = date(2020, 1, 1).toordinal() - date(1970, 1, 1).toordinal()
    assert times[-1] - simulated * day_s == pytest.approx(rig.now, abs=1.5)
    rig = Rig(nominal("firmware"))
    rig.run(5.0)
    fixes = [reading for reading in rig.readings if isinstance(reading, FixReading)]
    assert fixes
    assert not any(fix.valid for fix in fixes)


@pytest.mark.parametrize(
    ("day", "utc_s"),
    [
        (GpsDate(0, 1, 1), 946684800),
        (GpsDate(0, 2, 29), 951782400),
        (GpsDate(0, 3, 1), 951868800),
        (GpsDate(26, 12, 31), 1798675200),
    ],
    ids=str,
)
def test_a_date_is_seconds_of_utc(day: GpsDate, utc_s: int) -> None:
    """As `date -u +%s` has them."""
    ecu = LoisEcu(LoisEcuSettings())
    found = ecu.receive(encode_report(day) + encode_report(GpsTime(0, 0, 1)), 0.0)
    assert found == [TimeReading(utc_s + 1)]


def test_past_midnight_the_time_is_unknown_until_a_new_date_comes() -> None:
    """Else it would be a day late."""
    ecu = LoisEcu(LoisEcuSettings())
    said = [GpsDate(26, 11, 22), GpsTime(23, 59, 59), GpsTime(0, 0, 1), GpsDate(26, 11, 23)]
    found: list[object] = []
    for at, report in enumerate([*said, GpsTime(0, 0, 2)]):
        found += ecu.receive(encode_report(report), float(at))
    before, unknown, after = (item for item in found if isinstance(item, TimeReading))
    assert unknown == TimeReading(None)
    assert before.utc_s is not None
    assert after == TimeReading(before.utc_s + 3)


def test_declination_turns_the_heading() -> None:
    """East positive: yaw = pi/2 - (heading + declination)."""
    ecu = LoisEcu(LoisEcuSettings(declination_rad=0.1))
    found = ecu.receive(encode_report(Heading(90)) * 3, 0.0)
    assert found[-1] == HeadingReading(pytest.approx(-0.1))


def test_false_headings_at_north_are_refused() -> None:
    """A robot that turns through north on the public firmware."""
    rig = Rig(nominal("firmware"))
    rig.run(4.0)
    rig.readings.clear()
    errors = []
    for _ in range(300):
        before = len(rig.readings)
        rig.order(-10, 10, 0.1)
        for reading in rig.readings[before:]:
            if isinstance(reading, HeadingReading):
                off = math.remainder(reading.yaw_rad - rig.board.truth.yaw_rad, math.tau)
                errors.append(abs(off))
    assert len(errors) > 50
    assert max(errors) < math.radians(30)
    assert rig.driver._translation.headings.refused > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", RecordKind)
@BOTH
def test_a_record_is_made_whole(firmware: Firmware, kind: RecordKind) -> None:
    """While the wheels turn; its unit is that of the firmware, known by the board's clock."""
    rig = Rig(nominal(firmware))
    rig.run(5.0)
    rig.order(20, 20, 3.0)
    rig.driver.record(kind, 21)
    rig.run(7.0)
    (reading,) = [reading for reading in rig.readings if isinstance(reading, RecordReading)]
    assert reading.record.kind is kind
    assert len(reading.record.left) == 21
    assert len(reading.record.right) == (0 if kind is RecordKind.HEADING else 21)
    assert reading.count_s == (1e-4 if firmware == "firmware" else 1e-7)
    assert not [reading for reading in rig.readings if isinstance(reading, RecordFailed)]


def test_a_record_that_lost_a_line_is_given_up() -> None:
    """It is dropped whole."""
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


# What the line carries instead


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
def test_what_is_no_lois_ecu_is_told_in_a_sentence(data: bytes, words: str) -> None:
    """The message is withdrawn when it is one after all."""
    ecu = LoisEcu(LoisEcuSettings())
    assert ecu.receive(data * 100, 0.0) == []
    assert ecu.advice is not None
    assert words in ecu.advice
    assert ecu.mode is Mode.UNKNOWN
    ecu.receive(b"\n" + encode_report(Heading(5)), 1.0)
    assert ecu.advice is None
    assert ecu.mode is Mode.NOMINAL
