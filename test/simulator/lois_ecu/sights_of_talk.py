# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detectors of quirks in communication: what a board receives, sends and records.

A quirk is a deviation from the manual. Each function detects the quirk after which it is named.
"""

from dataclasses import replace
from itertools import pairwise

from lois_rig import Rig, odometry_in, ticks_in

from omnibot_driver.core.lois_ecu import (
    PERIOD_OFF,
    DistributeBall,
    EStopButton,
    GpsPosition,
    Heading,
    Record,
    RecordHeading,
    RecordKind,
    RecordRpm,
    RecordTorque,
    Reset,
    SetDuty,
    SetPeriod,
    SetRpm,
    SetTerminalMode,
    Setting,
    Stream,
    TerminalMode,
    WriteSetting,
    encode_command,
)
from omnibot_driver.simulator.lois_ecu import Quirks


def with_sum(text: bytes) -> bytes:
    """Return the text, its checksum and a line feed. The checksum is the XOR of all characters."""
    total = 0
    for character in text:
        total ^= character
    return text + b"%02x\n" % total


def extra_settings(quirks: Quirks) -> bool:
    """Return whether the feed-forward setting exists: it turns the wheel although Kp is 0."""
    rig = Rig(replace(quirks, low_pass_starts_at_zero=False))
    rig.run(2.1)
    for setting in (Setting.LEFT_KP, Setting.RIGHT_KP):
        rig.say(WriteSetting(setting, 0.0))
    rig.say(WriteSetting(Setting.LEFT_FEED_FORWARD, 2.0))
    rig.drive(30, 30, 1.0)
    return rig.board.motors[0].rpm > 20


def appends_odometry(quirks: Quirks) -> bool:
    """Return whether the board also sends its odometry as messages 0x12."""
    return any(group.appended for group in odometry_in(Rig(quirks).run(4.0)))


def clock_in_ms(quirks: Quirks) -> bool:
    """Return whether the driver's decoder finds that the board's times are in ms, not in ns."""
    rig = Rig(quirks)
    rig.run(6.0)
    return rig.decoder.clock_unit == "ms"


def clock_stops_while_sending(quirks: Quirks) -> bool:
    """Return whether the board's clock is over 3 % slow, because it stops during each message."""
    rig = Rig(quirks)
    rig.run(3.0)
    times_s, counts = [], []
    for _ in range(200):
        for ticks in ticks_in(rig.run(0.05)):
            times_s.append(rig.now)
            counts.append(ticks.time_counts)
    passed = sum((after - before) % 2**32 for before, after in pairwise(counts))
    return passed < 0.97 * (times_s[-1] - times_s[0]) * (1e3 if quirks.clock_in_ms else 1e9)


def deaf_while_sending(quirks: Quirks) -> bool:
    """Return whether the board loses more than 2 of 150 lines that are not repeated."""
    rig = Rig(quirks)
    rig.run(2.1)
    for number in range(150):
        rig.board.receive(encode_command(SetRpm(number, 0)))
        rig.run(0.05 + number % 7 / 100)
    obeyed = len(rig.board.commands)
    assert obeyed > 130
    return obeyed < 148


def deaf_while_counting(quirks: Quirks) -> bool:
    """Return whether the board, at full motor power, loses over 10 % of lines sent only once."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetDuty(100, 100))
    rig.run(1.0)
    before = len(rig.board.commands)
    for number in range(100):
        rig.board.receive(encode_command(SetDuty(100, 90 + number % 10)))
        rig.run(0.05 + number % 7 / 100)
    return len(rig.board.commands) - before < 90


def button_waits_while_sending(quirks: Quirks) -> bool:
    """Return whether a press of the button leaves the motors on while the board sends a record."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetDuty(50, 50), RecordTorque(100, 100))
    while not any(start in rig.board.step() for start in (b":0405", b":1705")):
        pass
    rig.board.press(True)
    rig.board.step()
    rig.board.step()
    return rig.board.driven


def odometry_period_is_fixed(quirks: Quirks) -> bool:
    """Return whether the board still sends message 0x20 after its period was switched off."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetPeriod(Stream.ODOMETRY, PERIOD_OFF))
    rig.run(0.5)
    return any(not group.appended for group in odometry_in(rig.run(3.0)))


def terminal_mode_zeroes_correction(quirks: Quirks) -> bool:
    """Return whether command 0x11, which sets the terminal mode, sets ``short_correction`` to zero.

    The test sends the command with the mode that the board already has.
    """
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetTerminalMode(TerminalMode.HOST))
    return rig.board.wheels[0].short_correction < 1e-6


def button_is_lost_in_terminal_mode(quirks: Quirks) -> bool:
    """Return whether a press of the button in a terminal mode is never reported."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetTerminalMode(TerminalMode.GPS))
    rig.board.press(True)
    heard = rig.run(1.0)
    rig.say(SetTerminalMode(TerminalMode.HOST))
    return EStopButton(True) not in heard + rig.run(1.0)


def terminal_mixes_sensors(quirks: Quirks) -> bool:
    """Return whether the board, in the GPS mode, also forwards sentences of the compass."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetTerminalMode(TerminalMode.GPS))
    return b"$HCHDT" in b"".join(rig.board.step() for _ in range(100))


def terminal_passes_input_on(quirks: Quirks) -> bool:
    """Return whether the board misses most lines in compass mode: it obeys fewer than 20 of 100.

    With this quirk, the board reads nothing while it forwards a line to the compass at 4800 baud.
    """
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(SetTerminalMode(TerminalMode.COMPASS))
    for _ in range(100):
        rig.board.receive(encode_command(SetDuty(0, 0)))
        rig.run(0.02)
    return len(rig.board.commands) < 20


def one_ball_in_six_seconds(quirks: Quirks) -> bool:
    """Return whether the board ignores a request for a ball within 6 s after the previous ball.

    The board's ball distribution device drops one ball for each request.
    """
    rig = Rig(quirks)
    rig.run(2.1)
    rig.say(DistributeBall(), DistributeBall())
    rig.run(6.0)
    rig.say(DistributeBall())
    return rig.board.balls == 2


def reset_clears_ticks_only(quirks: Quirks) -> bool:
    """Return whether, after command 0x18, the odometry is kept and the robot still drives."""
    rig = Rig(quirks).booted()
    rig.drive(20, 30, 4.0)
    rig.say(Reset())
    assert rig.board.wheels[0].ticks < 5
    rig.run(1.0)
    return rig.board.driven and abs(rig.board.odometry.pose[0]) > 0.1


def gps_is_ignored(quirks: Quirks) -> bool:
    """Return whether the board reports latitude 0, longitude 0 instead of the GPS position."""
    return GpsPosition(0.0, 0.0) in Rig(quirks).run(4.0)


def headings_average_over_north(quirks: Quirks) -> bool:
    """Return whether the reported heading jumps to the south as the robot turns through north."""
    rig = Rig(quirks).booted()
    rig.say(SetPeriod(Stream.HEADING, 40), SetPeriod(Stream.TICKS, PERIOD_OFF))
    rig.drive(-20, 20, 12.0)
    reports = [report for _, report in rig.heard if isinstance(report, Heading)]
    leaps = [
        abs((after.heading_deg - before.heading_deg + 180) % 360 - 180)
        for before, after in pairwise(reports)
    ]
    return max(leaps[40:]) > 60


def _record(rig: Rig, kind: RecordKind, count: int, seconds: float) -> Record | None:
    made = {RecordKind.RPM: RecordRpm, RecordKind.TORQUE: RecordTorque}.get(kind)
    rig.decoder.expect_record(kind, count, count if made else 0)
    rig.say(made(count, count) if made else RecordHeading(count))
    found = [report for report in rig.run(seconds) if isinstance(report, Record)]
    return found[0] if found else None


def records_in_100_us(quirks: Quirks) -> bool:
    """Return whether the times in a record are in units of 100 µs.

    Wheel ticks at 20 RPM are then about 500 units apart.
    """
    rig = Rig(quirks).booted()
    rig.drive(20, 20, 5.0)
    record = _record(rig, RecordKind.RPM, 20, 4.0)
    assert record is not None
    assert len(record.left) == len(record.right) == 20
    return 450 < sum(record.left) / 20 < 550


def torque_comes_as_rpm(quirks: Quirks) -> bool:
    """Return whether the board answers the request 0x17 (torque) with the number 0x04 (RPM)."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.board.receive(encode_command(RecordTorque(5, 5)))
    sent = b"".join(rig.board.step() for _ in range(300))
    assert (b":1700" in sent) != (b":0400c8" in sent)
    return b":0400c8" in sent


def record_waits_for_one_more(quirks: Quirks) -> bool:
    """Return whether a record of 3 headings is still missing after the third sample."""
    rig = Rig(quirks, compass_period_s=1.0)
    rig.run(2.5)
    return _record(rig, RecordKind.HEADING, 3, 3.1) is None


def large_records_never_end(quirks: Quirks) -> bool:
    """Return whether the board never sends a record of 1025 ticks.

    The host requests the record, and both wheels turn by more than 1025 ticks.
    """
    rig = Rig(quirks, steps=120)
    rig.run(2.1)
    rig.say(SetDuty(100, 100))
    rig.board.receive(with_sum(b":0404010401"))
    rig.run(0.1)
    assert rig.board.commands[-1].command == 0x04
    rig.decoder.expect_record(RecordKind.RPM, 1024, 1024)
    reports = rig.run(13.0)
    assert [len(wheel.record) for wheel in rig.board.wheels] == [1024, 1024]
    return not any(isinstance(report, Record) for report in reports)


def lenient_hex(quirks: Quirks) -> bool:
    """Return whether a payload that is not hexadecimal is accepted if the checksum is right."""
    rig = Rig(quirks)
    rig.run(2.1)
    for _ in range(5):
        rig.board.receive(with_sum(b":020014zz14"))
        rig.run(0.1)
    return any(obeyed.payload == 0x00140000 for obeyed in rig.board.commands)


def slow_boot(quirks: Quirks) -> bool:
    """Return whether the board sends nothing and obeys nothing in the first 2 s after power-up.

    The board keeps the commands that arrive in these 2 s, and obeys them afterwards.
    """
    rig = Rig(quirks)
    rig.board.receive(encode_command(SetDuty(0, 0)))
    early = rig.run(1.9)
    deaf = not rig.board.commands
    rig.run(0.2)
    assert len(rig.board.commands) == 1
    assert deaf is not bool(early)
    return deaf
