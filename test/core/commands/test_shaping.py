# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that commands are checked, limited, and written as the frames of the manual."""

import math

import pytest
from robots import standing
from session_bench import STOP, Bench, bare

from omnibot_driver.core.errors import CommandRefused


@pytest.fixture
def bench() -> Bench:
    return standing()


def test_a_command_is_on_the_wire_before_the_call_returns(bench: Bench) -> None:
    """The frame of a commanded twist is sent before the call returns.

    Computed by hand: 0.3 m/s is 21 LSB, −0.2 m/s is −14 LSB, 0.5 rad/s is 250 LSB.
    """
    start = len(bench.written)
    bench.drive(0.3, -0.2, 0.5)
    assert bare(bench.written_since(start)) == bytes.fromhex("FF FE 01 00 15 FF F2 00 FA")


def test_wheel_commands_are_rim_speeds_on_the_wire(bench: Bench) -> None:
    """Wheel rates are sent as rim speeds: 10 rad/s at 29 mm radius is 20 LSB.

    If a wheel exceeds its limit, all wheels are scaled by the same factor.
    """
    start = len(bench.written)
    bench.session.command_wheels((10.0, -10.0, 0.0), bench.now)
    bench.settle()
    assert bare(bench.written_since(start)) == bytes.fromhex("FF FE 02 00 14 FF EC 00 00")
    bench.run(0.02)
    start = len(bench.written)
    bench.session.command_wheels((34.0, -17.0, 0.0), bench.now)
    bench.settle()
    assert bare(bench.written_since(start)) == bytes.fromhex("FF FE 02 00 23 FF EF 00 00")


def test_a_zero_twist_is_the_stop_frame_and_never_zeros_in_mode_one(bench: Bench) -> None:
    """A zero twist is sent as the Stop frame.

    The board could take a velocity frame with zeros for a goal at the origin.
    """
    bench.drive(0.3)
    start = len(bench.written)
    bench.drive()
    assert bench.written_since(start) == STOP


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_counts_as_no_command(bench: Bench, bad: float) -> None:
    """The driver rejects a command with infinity or NaN. The previous command expires as usual."""
    bench.drive(0.3)
    bench.run(0.4)
    with pytest.raises(CommandRefused, match="NaN or infinity"):
        bench.drive(bad)
    with pytest.raises(CommandRefused, match="NaN or infinity"):
        bench.session.command_wheels((0.0, 1.0, bad), bench.now)
    bench.run(0.2)
    assert bench.written[-1][1] == STOP


@pytest.mark.parametrize("count", [0, 2, 4])
def test_a_wheel_command_has_exactly_three_values(bench: Bench, count: int) -> None:
    """A wheel command with 0, 2 or 4 rates is rejected, with this number in the error."""
    start = len(bench.written)
    with pytest.raises(CommandRefused, match=f"{count} values"):
        bench.session.command_wheels([1.0] * count, bench.now)
    bench.settle()
    assert bench.written_since(start) == b""


def test_a_huge_command_is_limited_in_its_own_direction(bench: Bench) -> None:
    """The user commands 1e300 m/s to the front left. The driver sends 0.5 m/s, 25 LSB per axis."""
    start = len(bench.written)
    bench.drive(1e300, 1e300, -1e300)
    assert bare(bench.written_since(start)) == bytes.fromhex("FF FE 01 00 19 00 19 FF 06")
