# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that commands in SI units are encoded as the OmniBot's bytes."""

import math
import re
import struct

import pytest
from frame_strategies import words
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from session_bench import bare
from strategies import twists

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.omnibot import OmniBotSettings
from omnibot_driver.core.omnibot.command_encoder import CommandEncoder
from omnibot_driver.core.packets import packed

STOP = bytes(8) + bytes.fromhex("FF FE 02 00 00 00 00 00 00")

HARMFUL = re.compile(rb"[SPR]|\xff\xfe")
"""Bytes on which the board would act if the header before them were lost."""


def encoder(**settings: object) -> CommandEncoder:
    return CommandEncoder(OmniBotSettings(**settings))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("twist", "typed"),
    [
        ((0.5, 0.0, 0.0), "FF FE 01 00 23 00 00 00 00"),
        ((0.0, -0.5, 0.0), "FF FE 01 00 00 FF DD 00 00"),
        ((0.0, 0.0, 0.5), "FF FE 01 00 00 00 00 00 FA"),
        ((0.1, 0.2, -0.3), "FF FE 01 00 07 00 0E FF 6A"),
    ],
)
def test_a_velocity_is_70_lsb_for_a_metre_and_500_for_a_radian(
    twist: tuple[float, float, float], typed: str
) -> None:
    """A velocity is encoded in mode 1, with 70 LSB per m/s and 500 LSB per rad/s."""
    assert bare(encoder().velocity(BodyTwist(*twist))) == bytes.fromhex(typed)


def test_the_scales_are_those_of_the_settings() -> None:
    """The encoder uses the scales of the settings, here 100 LSB per m/s and 200 LSB per rad/s."""
    commands = encoder(linear_scale=100.0, angular_scale=200.0)
    typed = bytes.fromhex("FF FE 01 00 64 FF 38 00 C8")
    assert bare(commands.velocity(BodyTwist(1.0, -2.0, 1.0))) == typed


def test_wheel_rates_are_rim_speeds_in_the_linear_unit() -> None:
    """A frame of wheel rates (mode 2) contains the speeds of the rims.

    With a radius of 29 mm, 10 rad/s is 0.29 m/s, or 20 LSB.
    """
    assert bare(encoder().wheels((10.0, -10.0, 1.0))) == bytes.fromhex("FF FE 02 00 14 FF EC 00 02")
    wide = encoder(wheel_radius_m=0.058)
    assert bare(wide.wheels((10.0, 0.0, 0.0))) == bytes.fromhex("FF FE 02 00 29 00 00 00 00")


def test_commands_are_rounded_to_the_nearest() -> None:
    """Commands are rounded to the nearest LSB. 3.451 LSB are sent as 3, and 3.556 LSB as 4."""
    assert bare(encoder().velocity(BodyTwist(0.0493, -0.0508, 0.0)))[3:7] == bytes.fromhex(
        "00 03 FF FC"
    )


@given(twists)
def test_a_velocity_that_rounds_to_nothing_is_the_stop_frame(twist: BodyTwist) -> None:
    """A velocity whose words all round to zero is sent as Stop.

    Zeros in mode 1 would be a goal pose, the origin, if the board's switch is on "position".
    """
    command = bare(encoder().velocity(twist))
    assert command != bytes.fromhex("FF FE 01 00 00 00 00 00 00")
    counts = (70 * twist.vx_mps, 70 * twist.vy_mps, 500 * twist.yaw_rate_radps)
    if max(map(abs, counts)) < 0.5:
        assert command == bare(STOP)
    else:
        assert command[2] == 1 or max(map(abs, counts)) == 0.5


@pytest.mark.parametrize("tiny", [0.0, -0.0, 0.005, -0.007, 5e-324])
def test_almost_nothing_is_the_stop_frame(tiny: float) -> None:
    """Velocities and wheel rates that are almost zero are sent as Stop."""
    assert encoder().velocity(BodyTwist(tiny, -tiny, tiny / 10)) == STOP
    assert encoder().wheels((tiny, -tiny, tiny)) == STOP


@given(st.tuples(*[st.floats(-1e308, 1e308)] * 3).filter(lambda v: max(map(abs, v)) < 1e305))
def test_a_command_too_large_for_the_wire_keeps_its_direction(
    values: tuple[float, float, float],
) -> None:
    """A velocity is too large for 16-bit words. All words are scaled down by the same factor."""
    command = bare(encoder().velocity(BodyTwist(*values)))
    counts = (70 * values[0], 70 * values[1], 500 * values[2])
    largest = max(1.0, max(map(abs, counts)) / 32767)
    sent = [int.from_bytes(command[n : n + 2], "big", signed=True) for n in (3, 5, 7)]
    fitting = [count / largest for count in counts]
    off = 512.5 if HARMFUL.search(struct.pack(">3h", *map(round, fitting))) else 0.500001
    for word, count in zip(sent, fitting, strict=True):
        assert word == pytest.approx(count, abs=off)


@given(words, words, words)
def test_what_is_commanded_comes_back_as_it_was_meant(x: int, y: int, omega: int) -> None:
    """The words of a velocity frame are exactly the commanded numbers, if these are whole LSB.

    The test omits words with the bytes of a letter or a header, because the driver changes them.
    """
    x, y, omega = (max(-32767, word) for word in (x, y, omega))
    assume(not HARMFUL.search(struct.pack(">3h", x, y, omega)))
    command = bare(encoder().velocity(BodyTwist(x / 70, y / 70, omega / 500)))
    sent = tuple(int.from_bytes(command[n : n + 2], "big", signed=True) for n in (3, 5, 7))
    assert sent == (x, y, omega)


@pytest.mark.parametrize(
    ("pose", "typed"),
    [
        ((1.0, -0.5, 1.571), "FF FE 01 03 E8 FE 0C 06 23"),
        ((32.767, -32.767, 0.0), "FF FE 01 7F FF 80 01 00 00"),
        ((0.0, 0.0, 0.0), "FF FE 01 00 00 00 00 00 00"),
        ((0.0006, -0.0006, 0.0), "FF FE 01 00 01 FF FF 00 00"),
    ],
)
def test_a_pose_to_drive_to_is_millimetres_and_milliradians(
    pose: tuple[float, float, float], typed: str
) -> None:
    """A goal is encoded in mode 1, in mm and mrad. The origin is a goal like any other."""
    assert bare(encoder().drive_to(Pose(*pose))) == bytes.fromhex(typed)


@pytest.mark.parametrize("far", [33.0, -33.0, 1e300, math.inf, math.nan])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_pose_that_does_not_fit_the_line_is_refused_and_not_another_place(
    far: float, place: int
) -> None:
    """A goal beyond 32.77 m or rad, the limit of a 16-bit word, is rejected.

    If the driver limited the values instead, the robot would drive to another place.
    """
    values = [0.0, 0.0, 0.0]
    values[place] = far
    with pytest.raises(CommandRefused, match=r"32\.77 m and 32\.77 rad.*~/reset"):
        encoder().drive_to(Pose(*values))


def test_commands_that_do_not_fit_the_wire_are_counted() -> None:
    """The driver counts the commands that were scaled down.

    A command exactly at the limit is not counted.
    """
    commands = encoder(linear_scale=10_000.0)
    commands.velocity(BodyTwist(3.2767, 0.0, 0.0))
    assert commands.saturated == 0
    commands.velocity(BodyTwist(3.3, 0.0, 0.0))
    assert commands.saturated == 1
    sent = bare(commands.velocity(BodyTwist(6.5534, 2.0, 0.0)))
    assert sent == bytes.fromhex("FF FE 01 7F FF 27 10 00 00")  # twice the limit: halved


def test_settings_may_be_replaced_while_it_runs() -> None:
    """The settings are replaced while the driver runs. The next command uses the new scales."""
    commands = encoder()
    commands.settings = OmniBotSettings(linear_scale=100.0)
    assert bare(commands.velocity(BodyTwist(1.0, 0.0, 0.0)))[3:5] == b"\x00\x64"


@pytest.mark.parametrize(
    ("typed", "twist"),
    [
        ("FF FE 01 00 23 00 00 00 00", (0.5, 0.0, 0.0)),
        ("FF FE 01 FF F9 00 0E FF 6A", (-0.1, 0.2, -0.3)),
        ("FF FE 02 00 00 00 00 00 00", (0.0, 0.0, 0.0)),
        ("FF FE 10 00 00 00 00 00 00", (0.0, 0.0, 0.0)),
        ("FF FE 02 FF F2 FF F2 FF F2", (0.0, 0.0, 0.2 / 0.143)),
        ("FF FE 02 00 00 00 00 00 15", (0.0, 0.2, -0.1 / 0.143)),
        ("53", (0.0, 0.0, 0.0)),
        ("FF FE 01 00 23 00 00 00 00 FF FE 02 00 00 00 00 00 00", (0.0, 0.0, 0.0)),
    ],
)
def test_a_frame_means_the_velocity_that_it_commands(
    typed: str, twist: tuple[float, float, float]
) -> None:
    """The driver computes the commanded velocity from the bytes that it has sent.

    The last of several frames counts. Zeros before a frame are ignored.
    """
    found = encoder().meaning(packed(bytes(8) + bytes.fromhex(typed)))
    assert (found.vx_mps, found.vy_mps, found.yaw_rate_radps) == pytest.approx(twist, abs=1e-9)


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=[HealthCheck.filter_too_much])
@given(twists)
def test_what_a_velocity_means_is_what_was_commanded_but_for_rounding(twist: BodyTwist) -> None:
    """The velocity computed back from a frame is the commanded one, except for rounding.

    Rounding changes a number in the frame by up to 0.5 LSB, or by up to 1.5 LSB to avoid a
    harmful byte.
    """
    found = encoder().meaning(packed(encoder().velocity(twist)))
    assume(max(abs(twist.vx_mps), abs(twist.vy_mps), abs(twist.yaw_rate_radps)) < 3.0)
    assert found.vx_mps == pytest.approx(twist.vx_mps, abs=1.51 / 70)
    assert found.vy_mps == pytest.approx(twist.vy_mps, abs=1.51 / 70)
    assert found.yaw_rate_radps == pytest.approx(twist.yaw_rate_radps, abs=1.51 / 500)
