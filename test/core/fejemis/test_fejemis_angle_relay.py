# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the front wheel's angle, relayed to the drive board on a line that loses characters."""

import itertools
import math
import random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from test_fejemis_motion_lines import motions, without

from omnibot_driver.core.fejemis.angle_relay import ACROSS, AngleRelay, heard_instead
from omnibot_driver.core.fejemis.sums import line, robust

EVERY = [tenths / 10 for tenths in range(-900, 901)]
BEHIND = line(b"rc 2 .299 28.6", sums=True)


def relayed(angle_deg: float) -> bytes:
    return AngleRelay().text(math.radians(angle_deg), sums=True)


def angles(data: bytes) -> set[float]:
    return {angle_deg for (angle_deg,) in motions(data, b"fwl", 1)}


def has_a_six_to_the_right(angle_deg: float) -> bool:
    """Return whether an angle is to the right (negative), and its text may contain a 6.

    The checksum can miss damage to such a text. The result is True within 0.5° of −60° to −69°, and
    of −6°, −16°, −26° and so on.
    """
    return -69.5 < angle_deg < -59.5 or (angle_deg < 0.0 and 5.5 < -angle_deg % 10 < 6.5)


def test_every_angle_is_told_within_half_a_degree() -> None:
    """Every relayed angle is right within 0.5°.

    The driver rounds to 0.1°, or chooses a safer angle nearby if the checksum could miss damage to
    the text.
    """
    told = [float(relayed(angle_deg)[4:]) for angle_deg in EVERY]
    assert max(map(abs, told)) == 90.0
    off = [abs(one - angle_deg) for one, angle_deg in zip(told, EVERY, strict=True)]
    assert max(off) < 0.51
    assert sum(each < 0.01 for each in off) > 0.6 * len(off)
    assert sum(each < 0.26 for each in off) > 0.85 * len(off)


def test_no_two_lost_characters_of_an_angle_make_another_angle_or_it_is_known_which() -> None:
    """A line with an angle loses two characters.

    The checksum misses the loss only if the angle is negative (right) and contains a 6. The board
    then reads 0° to 10° (left).
    """
    across = 0
    for angle_deg in EVERY:
        text = relayed(angle_deg)
        assert robust(text), text
        if instead := list(heard_instead(text[4:].decode())):
            across += 1
            assert has_a_six_to_the_right(angle_deg), text
            assert all(0.0 <= other < ACROSS for other in instead), text
    assert across / len(EVERY) < 0.1


@pytest.mark.parametrize("angle_deg", [0.0, 5.5, 12.5, 35.5, 55.5, 90.0, -5.5, -30.4, -58.3])
def test_whichever_two_characters_are_lost_of_an_angle_no_other_angle_is_heard(
    angle_deg: float,
) -> None:
    """A line with an angle and a checksum loses one or two characters.

    No wrong angle is then read from the line, even by the most tolerant parser.
    """
    text = relayed(angle_deg)
    data = line(text, sums=True)
    for count in (1, 2):
        for lost in itertools.combinations(range(len(data)), count):
            assert angles(without(data + BEHIND, lost)) <= {float(text[4:])}, (data, lost)


def test_no_other_form_of_an_angle_between_60_and_69_degrees_to_the_right_is_better() -> None:
    """The text of every angle from −60° to −69° contains ``-`` and ``6``.

    The checksum misses their loss: their codes add up to 99, and the checksum is modulo 99.
    """
    assert (ord("-") + ord("6")) % 99 == 0
    for angle_deg in range(-69, -59):
        assert {"-", "6"} <= {*f"{angle_deg}"}


@pytest.mark.parametrize("seed", range(3))
def test_what_three_lost_characters_leave_of_an_angle(seed: int) -> None:
    """Three characters are lost from a line with an angle.

    In less than 1 % of these cases, the board reads a wrong angle.
    """
    chance = random.Random(seed)
    passed = total = 0
    for _ in range(3):
        angle_deg = chance.uniform(-59.0, 90.0)
        text = relayed(angle_deg)
        data = line(text, sums=True)
        for lost in itertools.combinations(range(len(data)), 3):
            total += 1
            passed += not angles(without(data + BEHIND, lost)) <= {float(text[4:])}
    assert passed / total < 0.01


def test_without_sums_no_loss_makes_the_inner_wheel_faster_than_the_outer_one() -> None:
    """A line with the front wheel's angle loses up to 3 characters. No angle beyond 90° is read.

    The line has no checksum. Beyond 90°, the inner wheel would be faster than the outer one.
    """
    for angle_deg in range(-90, 91):
        text = AngleRelay().text(math.radians(angle_deg), sums=False)
        assert text == b"fwl %d" % angle_deg
        for count in range(1, 4):
            for lost in itertools.combinations(range(len(text)), count):
                assert all(abs(other) <= 90.0 for other in angles(without(text + b"\n", lost)))


@pytest.mark.slow
@given(st.lists(st.floats(-90.0, 90.0) | st.sampled_from([85.0, 85.5, 89.4, 90.0]), max_size=12))
@example([85.0, 85.5, 85.0, 85.5, 90.0])
@example([-85.0, -85.5, -85.0, -85.5, -90.0])
def test_no_sequence_of_angles_makes_the_board_read_more_than_90_degrees(
    angles_deg: list[float],
) -> None:
    """For any sequence of angles, the board reads no angle beyond 90°.

    This also holds if a line with a checksum loses two characters unnoticed, or if a line without a
    checksum loses one.
    """
    summed, plain = AngleRelay(), AngleRelay()
    for angle_rad in map(math.radians, angles_deg):
        text = summed.text(angle_rad, sums=True)[4:].decode()
        assert all(abs(other) <= 90.0 for other in (float(text), *heard_instead(text)))
        data = plain.text(angle_rad, sums=False) + b"\n"
        for lost in range(len(data) + 1):
            assert all(abs(other) <= 90.0 for other in angles(without(data, (lost,))))


def test_rounding_errors_near_90_degrees_are_not_lost() -> None:
    """Near 90°, no relayed angle exceeds 90°, and the mean of the angles is right.

    The driver may add a rounding error to a later angle.
    """
    relay = AngleRelay()
    told = [float(relay.text(math.radians(89.7), sums=False)[4:]) for _ in range(200)]
    assert max(told) == 90.0
    assert sum(told) / len(told) == pytest.approx(89.7, abs=0.01)


@pytest.mark.parametrize("sums", [True, False])
@pytest.mark.parametrize("angle_deg", [0.3, 5.5, 12.4, 45.5, -6.25, -64.9])
def test_the_mean_of_what_is_told_is_the_angle(angle_deg: float, *, sums: bool) -> None:
    """The driver adds the rounding error of an angle to the next angle, so the mean is exact."""
    relay = AngleRelay()
    told = [float(relay.text(math.radians(angle_deg), sums=sums)[4:]) for _ in range(200)]
    assert sum(told) / len(told) == pytest.approx(angle_deg, abs=0.01)
    assert all(abs(each - angle_deg) < 1.01 for each in told)
