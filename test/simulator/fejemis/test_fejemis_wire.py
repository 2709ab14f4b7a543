# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the text lines that the two simulated Teensys (drive and front) send and obey.

Checksums, comments, subscriptions and firmware variants are tested.
"""

from itertools import pairwise

import pytest
from fejemis_rig import BEAT, DRIVE, FRONT, Rig

from omnibot_driver.simulator.fejemis import Firmware, wire

SUMS = Firmware(sums=True)


@pytest.mark.parametrize(
    "line",
    [
        ";19rc 1 0.5 65",
        ";69sub hbt 400",
        ";34sub fwl 15",
        ";50sub gyro 10",
        ";31leave",
        ";06hbt 44.97199 90 110 24.95 10 0",
    ],
)
def test_sums_are_those_of_the_public_hosts(line: str) -> None:
    """A line with a checksum is copied from one of the public host programs.

    The simulator computes the same checksum.
    """
    assert wire.checked(line)[0] is wire.Check.GOOD
    assert wire.line(line[3:], sums=True, carriage_return=False) == line.encode() + b"\n"


def test_heartbeats_come_unasked_every_400_ms_with_ids_90_and_91() -> None:
    """Each of the two Teensys sends a heartbeat every 400 ms, laid out as in the manual.

    The drive Teensy has the id 90, the front Teensy 91.
    """
    rig = Rig()
    rig.run(2.5)
    beats = [(at, text) for at, port, text in rig.lines if text.startswith("hbt") and port == DRIVE]
    assert [text.split()[2:] for _, text in beats] == [["90", "110", "24.90", "10", "0"]] * 6
    assert {round(b - a, 3) for (a, _), (b, _) in pairwise(beats)} == {0.4}
    assert len(beats[0][1].split()[1].partition(".")[2]) == 5
    (front, *_) = [text for _, port, text in rig.lines if port == FRONT and "hbt" in text]
    assert front.split()[2:] == ["91", "100", "0.00", "1", "0.011"]
    assert len(front.split()[1].partition(".")[2]) == 4


def test_a_wrong_sum_is_a_comment_and_nothing_else() -> None:
    """The host sends a line with a wrong checksum.

    The Teensy discards it and answers with a comment.
    """
    rig = Rig(firmware=SUMS).booted()
    (answer,) = rig.ask(DRIVE, ";20rc 2 0.5 0")
    assert "# CRC failed" in answer
    rig.run(0.5)
    assert rig.board.standing


def test_a_line_without_a_sum_is_executed_under_protest() -> None:
    """The host sends a line without a checksum to firmware that uses checksums.

    The Teensy obeys the line and answers with a comment.
    """
    rig = Rig(firmware=SUMS).booted()
    (answer,) = rig.ask(DRIVE, "rc 2 0.5 0")
    assert answer.endswith("# processing under protest - no CRC")
    rig.run(0.5)
    assert not rig.board.standing


def test_firmware_without_sums_does_not_know_them() -> None:
    """The host sends a line with a checksum to firmware that uses none.

    The Teensy reports an unknown command.
    """
    rig = Rig().booted()
    (answer,) = rig.ask(DRIVE, ";19rc 1 0.5 65")
    assert answer.startswith("# 1.0")
    assert answer.endswith("unhandled: ';19rc 1 0.5 65'")
    assert rig.board.standing


def test_an_unknown_command_is_a_comment() -> None:
    """The host sends an unknown command.

    The Teensy answers with a comment that names the command.
    """
    rig = Rig(firmware=SUMS).booted()
    (answer,) = rig.ask(FRONT, ";35fly")
    assert wire.checked(answer)[0] is wire.Check.GOOD
    assert answer.endswith("unhandled: 'fly'")


@pytest.mark.parametrize("text", ["stop", "start"])
def test_the_front_half_does_not_know_stop_and_start(text: str) -> None:
    """Only the drive Teensy has the commands ``stop`` and ``start``.

    The front Teensy reports an unknown command.
    """
    rig = Rig().booted()
    assert rig.ask(FRONT, text)[0].endswith(f"unhandled: '{text}'")
    assert rig.ask(DRIVE, text) == []


def test_an_upside_down_command_is_confirmed_by_newer_firmware_only() -> None:
    """The host sends ``!stop``.

    Newer firmware obeys and confirms it. Older firmware reports an unknown command.
    """
    newer = Rig(firmware=Firmware(sums=False, confirms=True)).booted()
    assert newer.ask(DRIVE, "!stop") == ["confirm !stop"]
    assert newer.board.drive.source == -1
    older = Rig().booted()
    assert "unhandled" in older.ask(DRIVE, "!stop")[0]
    assert older.board.drive.source == 10


def test_a_subscription_comes_in_its_period_until_it_is_set_to_zero() -> None:
    """The front Teensy does not acknowledge the host's subscription to a message.

    The Teensy sends the message periodically until the host sets the period to zero.
    """
    rig = Rig().booted()
    assert rig.ask(FRONT, "sub fwl 15") == []
    assert sum("fwl" in text for _, text in rig.run(1.5)) == 100
    rig.say(FRONT, "sub fwl 0")
    rig.run(0.01)
    assert not any("fwl" in text for _, text in rig.run(0.5))


def test_leave_ends_all_of_them_the_heartbeat_too() -> None:
    """``leave`` ends all subscriptions, also the subscription to the heartbeat."""
    rig = Rig().booted()
    rig.say(DRIVE, "sub pose 20", "sub gyro 10", "leave")
    rig.run(0.01)
    assert {port for port, _ in rig.run(1.0)} == {FRONT}
    rig.say(DRIVE, "sub hbt 100")
    assert sum(port == DRIVE for port, _ in rig.run(1.05)) == 10


KEYS = {
    DRIVE: "ver adc int bat time amp cvdrive cpdrive confs hbt id gyro gyroo acc acco mag magw mago"
    " imupose enc pose vel conf tofd tof1 sr04",
    FRONT: "hbt id mot adc int bat time cur ir svp svjt fwl fwo cvsteer cpsteer confs",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("port", "key"), [(port, key) for port, keys in KEYS.items() for key in keys.split()]
)
def test_each_value_comes_once_when_asked_for_and_by_subscription(port: int, key: str) -> None:
    """A host can request each value in the help text by its key, or subscribe to the value.

    Each reply begins with the key; only the reply to ``ir`` begins with ``irc``.
    """
    rig = Rig().booted()
    rig.say(port, "leave")
    rig.run(0.01)
    once = rig.ask(port, f"{key}i")[0]
    assert once.split()[0] == ("irc" if key == "ir" else key)
    rig.say(port, f"sub {key} 100")
    assert len([number for number, _ in rig.run(1.05) if number == port]) >= 10


def test_help_is_a_flood_of_text_without_comment_marks() -> None:
    """After ``help`` each Teensy prints the text of the manual, in many lines without ``#``."""
    rig = Rig().booted()
    drive, front = rig.ask(DRIVE, "help"), rig.ask(FRONT, "help")
    assert len(drive) > 55
    assert any("stop    Stop. No control allowed" in line for line in drive)
    assert any("brush 0/1" in line for line in front)
    assert not [line for line in drive + front if line.startswith("#")]


def test_a_line_of_more_than_200_characters_is_cut() -> None:
    """A line has more than 200 characters.

    The characters after the first 200 are read as a new line, here ``stop``.
    """
    rig = Rig().booted()
    rig.say(DRIVE, "x" * 200 + "stop")
    rig.run(0.01)
    assert rig.board.drive.source == -1


@pytest.mark.parametrize(
    ("line", "v", "turn_dps"),
    [
        ("rc 2 0.250 11.459", 0.25, 11.459),
        ("rc  0.250 1.459", 1.459, 0.0),  # the source is lost, and a digit
        ("rc 2 0.25", 0.25, 0.0),
        ("rc", 0.0, 0.0),
        ("rc2 .5 -3e1", 0.5, -30.0),
    ],
)
def test_numbers_are_read_one_after_the_other(line: str, v: float, turn_dps: float) -> None:
    """The drive Teensy reads the numbers of a line from left to right.

    So a lost number shifts the later ones. A number that is missing at the end is zero.
    """
    rig = Rig().booted()
    rig.say(DRIVE, line)
    rig.run(0.01)
    assert rig.board.drive.reference[0] == v
    assert rig.board.drive.turn_dps == pytest.approx(turn_dps)


@pytest.mark.parametrize(
    ("port", "line"),
    [
        (DRIVE, "rc 1e999 0 0"),
        (DRIVE, "sub pose 1e999"),
        (DRIVE, "setid 1e999"),
        (FRONT, "pwmf 1e999"),
        (FRONT, "ledb 1e999 0 0"),
    ],
)
def test_a_number_that_is_too_large_ends_no_board(port: int, line: str) -> None:
    """A number in a line overflows to infinity. The board continues to send heartbeats."""
    rig = Rig().booted()
    rig.say(port, line)
    assert any(number == port and BEAT.match(text) for number, text in rig.run(1.0))


def test_lines_end_with_or_without_a_carriage_return() -> None:
    """A Teensy accepts lines with and without a carriage return.

    A setting of the firmware determines whether a Teensy sends carriage returns. The manual does
    not show line ends.
    """
    rig = Rig().booted()
    rig.board.receive(b"stop\r\n", 0.0, DRIVE)
    rig.run(0.01)
    assert rig.board.drive.source == -1
    for carriage_return, end in ((True, b"0\r\n"), (False, b"0\n")):
        board = Rig(firmware=Firmware(sums=False, carriage_return=carriage_return)).board
        sent = b"".join(data for _ in range(600) for port, data in board.advance() if port == DRIVE)
        assert sent.endswith(end)


def test_variants_of_messages() -> None:
    """Some firmware adds a time to the wheel speeds, or a tilt to the pose.

    Some firmware sends accelerations in g instead of m/s².
    """
    usual = Rig(accel_noise_mps2=0.0, accel_bias_mps2=(0.0, 0.0, 0.0)).booted()
    assert len(usual.ask(DRIVE, "veli")[0].split()) == 3
    assert len(usual.ask(DRIVE, "posei")[0].split()) == 5
    assert usual.ask(DRIVE, "acci")[0].split()[3] == "9.8066"
    firmware = Firmware(sums=False, timed_velocity=True, tilt=True, acceleration_in_g=True)
    other = Rig(firmware=firmware, accel_noise_mps2=0.0, accel_bias_mps2=(0.0, 0.0, 0.0)).booted()
    assert len(other.ask(DRIVE, "veli")[0].split()) == 4
    assert len(other.ask(DRIVE, "posei")[0].split()) == 6
    assert other.ask(DRIVE, "acci")[0].split()[3] == "1.0000"


def test_single_precision_makes_steps_of_the_time_after_hours() -> None:
    """The board keeps its time in single precision.

    After two hours, the time advances in steps of about 0.5 ms.
    """
    firmware = Firmware(sums=False, single_precision=True)
    rig = Rig(firmware=firmware, uptime_s=8000.0)
    times = []
    for _ in range(20):
        times.append(float(rig.ask(DRIVE, "posei")[0].split()[1]))
    assert all(time * 2048 == pytest.approx(round(time * 2048), abs=0.03) for time in times)


def test_the_two_clocks_run_apart() -> None:
    """Each Teensy has its own crystal, so the clocks of the two Teensys differ more and more."""
    rig = Rig(clock_ppm=(200.0, -300.0))
    rig.run(20.0)
    assert rig.board.drive.clock_s == pytest.approx(20.004)
    assert rig.board.front.clock_s == pytest.approx(19.994)


@pytest.mark.slow
def test_each_half_runs_its_cycles_by_its_own_clock() -> None:
    """Each Teensy sends a heartbeat every 0.4 s by its own clock, which is fast or slow.

    The time in a heartbeat is late by at most one cycle (1 ms).
    """
    rig = Rig(clock_ppm=(200.0, -300.0))
    rig.run(20.1)
    for port in (DRIVE, FRONT):
        beats = [line for _, at, line in rig.lines if at == port and line.startswith("hbt ")]
        assert len(beats) > 45
        for number, beat in enumerate(beats, 1):
            late_s = float(beat.split()[1]) - 0.4 * number
            assert -1e-5 < late_s < 0.00101, (port, beat)


def test_bytes_to_the_boards_can_be_lost() -> None:
    """Some bytes to the Teensys are lost. The seed determines which bytes are lost."""
    heard = []
    for _ in range(2):
        rig = Rig(firmware=SUMS, lose_inbound=0.05, seed=3).booted()
        for _ in range(100):
            rig.say(DRIVE, ";06rc 2 0.250 11.459")
        rig.run(0.01)
        heard.append(bytes(rig.board.drive.received))
    assert heard[0] == heard[1]
    assert len(heard[0]) < 2090


def test_three_lost_characters_leave_a_valid_command() -> None:
    """A command loses the characters ``c``, ``2`` and ``1``, which add 0 to the checksum modulo 99.

    The checksum is still right, so the Teensy obeys the command.
    """
    rig = Rig(firmware=SUMS).booted()
    whole, cut = "rc 2 0.250 11.459", "rc  0.250 1.459"
    assert wire.sum_of(whole) == wire.sum_of(cut)
    rig.say(DRIVE, f";{wire.sum_of(whole):02d}{cut}")
    rig.run(0.01)
    assert rig.board.drive.reference[0] == 1.459


@pytest.mark.parametrize("exact", [True, False])
def test_a_word_with_a_space_behind_it_is_unknown_to_some_firmware(*, exact: bool) -> None:
    """The host sends ``stop`` with a space after the word.

    Firmware that compares whole lines reports an unknown command.
    """
    rig = Rig(firmware=Firmware(sums=False, exact_words=exact)).booted()
    rig.ask(DRIVE, "stop ")
    assert rig.board.drive.source == (10 if exact else -1)
    rig.ask(DRIVE, "stop")
    assert rig.board.drive.source == -1
