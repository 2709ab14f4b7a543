# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of motion lines that lose characters on their way to a board."""

import itertools
import math
import random
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.fejemis.machine import LEAST_VOLTS, MOST_VOLTS, lift_line
from omnibot_driver.core.fejemis.motion_lines import (
    STOP,
    drive_line,
    front_line,
    plain_drive_line,
    plain_front_line,
)
from omnibot_driver.core.fejemis.sums import line, robust, sum_of

FRONT_M = 0.42
COMMANDS = [
    (v, w)
    for v in (0.0, 0.015, 0.1, 0.15, 0.25, 0.5, 1.0, 1.25, -0.2, -0.65)
    for w in (0.0, 0.02, 0.1, 0.2, 0.5, 1.0, 2.5, -0.3, -1.2)
]
NUMBER = re.compile(rb"[ \t]*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")


def motions(data: bytes, keyword: bytes = b"rc", count: int = 3) -> list[tuple[float, ...]]:
    """Return the numbers of each command that a board with checksums may read from the bytes.

    The board is lenient: it reads numbers as in C, missing numbers as 0, and checksums of one
    digit.
    """
    found = []
    for text in re.split(rb"[\r\n]", data):
        bodies = [text]
        if text.startswith(b";"):
            bodies = []
            for digits in (2, 1):
                sum_text, body = text[1 : 1 + digits], text[1 + digits :]
                if len(sum_text) == digits and sum_text.isdigit() and int(sum_text) == sum_of(body):
                    bodies.append(body)
        for body in bodies:
            if not body.startswith(keyword):
                continue
            at, numbers = len(keyword), []
            while match := NUMBER.match(body, at):
                numbers.append(float(match[1]))
                at = match.end()
            found.append(tuple([*numbers, *count * [0.0]][:count]))
    return found


def without(data: bytes, places: tuple[int, ...]) -> bytes:
    return bytes(byte for at, byte in enumerate(data) if at not in places)


def test_the_example_of_the_manual_becomes_another_motion_by_two_lost_characters() -> None:
    """The manual's example of a motion line loses two characters.

    The checksum still fits, but the line commands another motion. So the driver writes the
    example's motion with other digits.
    """
    text = b";%02drc 2 0.250 11.459\n" % sum_of(b"rc 2 0.250 11.459")
    damaged = text.replace(b"rc 2 0.250 11", b"rc  0.250 1")
    assert motions(damaged) == [(0.25, 1.459, 0.0)]


@pytest.mark.slow
def test_no_loss_of_one_or_two_characters_makes_another_motion() -> None:
    """A motion line loses one or two characters. The board reads no wrong motion from it.

    If the line end is lost, the board reads this line and the next as one.
    """
    chance = random.Random(5)
    texts = {text for v, w in COMMANDS for text in (front_line(v, w, FRONT_M), drive_line(v, w))}
    behind = [line(b"fwl .04", sums=True), line(b"rc 2 .299 28.6", sums=True)]
    for text in sorted(texts - {STOP}):
        for after in chance.sample(behind, 1):
            data = line(text, sums=True) + after
            right = set(motions(data))
            length = data.index(b"\n") + 1
            for count in (1, 2):
                for lost in itertools.combinations(range(length), count):
                    assert set(motions(without(data, lost))) <= right, (text, lost)


@pytest.mark.slow
def test_no_loss_of_two_characters_in_any_of_many_commands() -> None:
    """In the lines of random motions, the checksum detects any loss of two characters.

    The driver avoids certain pairs of characters and certain checksums.
    """
    chance = random.Random(7)
    for _ in range(150):
        v = chance.uniform(-1, 1) * 10 ** chance.uniform(-2, 0.3)
        w = chance.uniform(-1, 1) * 10 ** chance.uniform(-2, 0.8)
        for text in (front_line(v, w, FRONT_M), drive_line(v, w)):
            pairs = itertools.combinations(text.removeprefix(b"rc"), 2)
            detected = all(sum(pair) % 99 for pair in pairs) and robust(text)
            assert text == STOP or detected, text


def test_nothing_can_be_lost_of_stop_that_makes_a_motion() -> None:
    """Any one to four characters are lost from the stop line. The board reads no motion."""
    data = line(STOP, sums=True)
    for count in range(1, 5):
        for lost in itertools.combinations(range(len(data)), count):
            assert all(v == w == 0.0 for _, v, w in motions(without(data, lost)))


@pytest.mark.parametrize("text", [b"motv -4.49 .499", b"rc 2 -.000424 -.422", b"rc 2 -.0700 -4.04"])
def test_no_lost_line_end_lets_a_sum_continue_the_number_before_it(text: bytes) -> None:
    """A stop line and the next line together lose two characters. No false motion is read.

    The driver writes an empty line between the two lines. Otherwise, the next line's checksum could
    continue the stop line's last number (``rc 2 0 092``).
    """
    assert sum_of(text) in (2, 92)
    data = line(STOP, sums=True) + line(text, sums=True)
    right = set(motions(data))
    for lost in itertools.combinations(range(len(data)), 2):
        assert set(motions(without(data, lost))) <= right, lost


def test_what_three_lost_characters_leave() -> None:
    """Three characters of a motion line are lost.

    In less than 1 % of these cases, the board reads another motion. The numbers are in
    docs/internals/fejemis_protocol.md.
    """
    passed = total = 0
    for v, w in ((0.25, 0.2), (0.5, -0.5), (0.15, 0.0)):
        for text in (front_line(v, w, FRONT_M), drive_line(v, w)):
            data = line(text, sums=True) + line(b"fwl .04", sums=True)
            right = set(motions(data))
            for lost in itertools.combinations(range(data.index(b"\n") + 1), 3):
                total += 1
                passed += not set(motions(without(data, lost))) <= right
    assert passed / total < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("v", "w"), COMMANDS)
def test_the_lines_say_what_is_commanded(v: float, w: float) -> None:
    """The angle in the front board's line is right within 0.02°, and a small angle within 1 %.

    The drive board's line has the outer wheel's speed within 0.6 %.
    """
    if v == w == 0.0:
        return
    _, front_v, front_w = motions(front_line(v, w, FRONT_M) + b"\n")[0]
    told = math.atan2(FRONT_M * math.radians(front_w), front_v)
    wanted = math.atan2(FRONT_M * w, v)
    assert told == pytest.approx(wanted, abs=min(3.5e-4, max(1e-5, 0.01 * abs(math.tan(wanted)))))
    _, drive_v, drive_w = motions(drive_line(v, w) + b"\n")[0]
    assert math.hypot(drive_v, math.radians(drive_w)) == pytest.approx(math.hypot(v, w), rel=6e-3)
    assert (drive_v < 0.0) is (v < 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("v", "w"), [(1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (-0.8, -0.6)])
def test_the_outer_wheel_has_every_speed(v: float, w: float) -> None:
    """The outer wheel reaches every speed within 1.8 %, although the lines avoid certain digits.

    Lines with a minus sign avoid the digit 6, too.
    """
    for rim in (0.0218, 0.00218, 0.0344, *(0.0011 * 1.12**n for n in range(60))):
        _, drive_v, drive_w = motions(drive_line(v * rim, w * rim) + b"\n")[0]
        assert math.hypot(drive_v, math.radians(drive_w)) == pytest.approx(rim, rel=0.018)


@pytest.mark.parametrize(
    "volts", [6.0, -6.0, 12.0, -12.0, 0.5, -0.7, 1.25, 1.99, 1.999, -0.1995, -0.1999]
)
def test_no_loss_of_one_or_two_characters_drives_the_lift_longer_or_harder(volts: float) -> None:
    """A lift line loses one or two characters. Its voltage and its duration do not increase.

    The undamaged line has 45 to 100 % of the requested voltage.
    """
    text, seconds = lift_line(volts, 0.5)
    data = line(text, sums=True)
    said_volts, said_s = motions(data, b"motv", 2)[0]
    assert said_s == seconds <= 0.5
    assert 0.45 * abs(volts) <= abs(said_volts) <= abs(volts)
    for count in (1, 2):
        for lost in itertools.combinations(range(len(data) - 1), count):
            for found_volts, found_s in motions(without(data, lost), b"motv", 2):
                assert 0.0 <= found_volts / said_volts <= 1.0
                assert found_s <= said_s


@given(
    volts=st.floats(LEAST_VOLTS, MOST_VOLTS),
    forward=st.booleans(),
    longest_s=st.floats(0.05, 10.0),
)
def test_every_lift_voltage_has_a_robust_line(
    volts: float, longest_s: float, *, forward: bool
) -> None:
    """For each voltage and run time, the driver finds a line whose checksum detects damage."""
    text, seconds = lift_line(volts if forward else -volts, longest_s)
    assert robust(text)
    assert seconds <= longest_s


@pytest.mark.parametrize("text", [b"stop", b"start", b"leave", b"gyroc", b"confsi", STOP])
@pytest.mark.parametrize("sums", [True, False])
def test_nothing_is_added_to_a_line(text: bytes, *, sums: bool) -> None:
    """A line has only its text, its checksum and the line end.

    A related firmware obeys ``stop`` only if the line contains nothing else.
    """
    data = line(text, sums=sums).lstrip(b"\n")
    assert data == (b";%02d" % sum_of(text) if sums else b"") + text + b"\n"


def plain(data: bytes) -> list[tuple[float, ...]]:
    """Return the motions that a board without checksums reads from these bytes."""
    return motions(data.replace(b";", b"?"))


@pytest.mark.slow
def test_without_sums_only_a_lost_point_or_digit_makes_the_outer_wheel_faster() -> None:
    """A motion line without a checksum loses one character.

    The outer wheel becomes faster only if a point or a digit is lost. It is reversed only if the
    minus sign is lost.
    """
    thousandths = [*range(1, 1100), *range(3000, 21_000, 1000)]
    for speed in (sign * each / 1000 for each in thousandths for sign in (1, -1)):
        text = plain_drive_line(speed, 0.0)
        assert plain(text) == [(2.0, speed, 0.0)]
        data = text + b"\nfwl 12\n"
        begin = len(b"rc 2 ")
        digits = range(begin + (speed < 0.0), begin + len(text.split()[2]))
        for lost in range(len(text) + 1):
            for _, v, w in plain(without(data, (lost,))):
                assert w == 0.0, (text, lost)
                assert abs(v) <= abs(speed) or lost in digits, (text, lost)
                assert v * speed >= 0.0 or text[lost : lost + 1] == b"-", (text, lost)


def test_without_sums_the_drive_board_gets_the_speed_of_the_outer_wheel() -> None:
    """Without checksums, the drive board gets the outer wheel's speed, and a turn rate of 0."""
    for speed, turn in ((0.25, 0.5), (0.0, 0.6), (1.25, -1.0), (-0.3, 0.2)):
        rim = math.copysign(math.hypot(speed, turn), speed)
        assert plain(plain_drive_line(speed, turn)) == [(2.0, pytest.approx(rim, abs=6e-4), 0.0)]


def test_without_sums_a_whole_speed_keeps_its_decimal_point() -> None:
    """The speed 1 m/s is written as ``1.``, so the line is ``rc 2 1. 0``.

    If the line loses its last space, it is ``rc 2 1.0``, and the speed is still 1 m/s.
    """
    assert plain_drive_line(1.0, 0.0) == b"rc 2 1. 0"
    assert plain(b"rc 2 1.0\n") == [(2.0, 1.0, 0.0)]


def test_without_sums_the_front_board_gets_both_numbers() -> None:
    """Without checksums, the front board's line still has a speed and a turn rate.

    The board needs both, because their ratio gives the wheel's angle.
    """
    assert plain_front_line(0.25, 0.5) == b"rc 2 0.25 28.65"
    assert plain_front_line(0.0, -0.5) == b"rc 2 0 -28.65"
    assert plain_drive_line(0.0004, 0.0) == STOP
