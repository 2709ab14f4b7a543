# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of steering by keys: the robot stops when the key is released."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.tools.monitor.teleop import (
    ASLEEP_S,
    DEAF_S,
    FIRST_S,
    HALT,
    MOTIONS,
    REPEAT_S,
    ZEROS,
    DeadMan,
)

TICK_S = 0.05
keys = st.sampled_from(sorted(MOTIONS))


def commands(dead_man: DeadMan, since_s: float, ticks: int) -> list[BodyTwist | None]:
    return [dead_man.command(since_s + tick * TICK_S) for tick in range(ticks)]


@given(st.lists(st.tuples(keys, st.floats(0.0, ASLEEP_S - 0.01)), min_size=1, max_size=20))
def test_nobody_moves_longer_than_the_last_key_allows(presses: list[tuple[str, float]]) -> None:
    """The user presses keys, then none. The motion ends at most 0.6 s after the last key press.

    The monitor then sends five zero commands.
    """
    dead_man, now_s = DeadMan(), 0.0
    for key, wait_s in presses:
        now_s += wait_s
        assert dead_man.press(key, now_s)
        assert dead_man.command(now_s) not in (None, HALT)
    said = commands(dead_man, now_s + FIRST_S, 100)
    assert said == [HALT] * ZEROS + [None] * (100 - ZEROS)


@given(keys, st.floats(0.02, FIRST_S - 0.01), st.floats(0.02, REPEAT_S - 0.01))
def test_a_held_key_moves_without_a_break(key: str, delay_s: float, every_s: float) -> None:
    """The user holds a key.

    The robot moves without a break, even before the keyboard repeats the key.
    """
    dead_man = DeadMan()
    dead_man.press(key, 0.0)
    assert dead_man.command(delay_s - 0.001) not in (None, HALT)
    for number in range(20):
        now_s = delay_s + number * every_s
        dead_man.press(key, now_s)
        assert dead_man.command(now_s + every_s - 0.001) not in (None, HALT)


def test_a_repeated_key_ends_sooner_than_a_new_one() -> None:
    """After the first press of a key, the motion ends after 0.6 s.

    If the key is repeated before that, the motion ends 0.3 s after the last repetition.
    """
    dead_man = DeadMan()
    dead_man.press("w", 0.0)
    assert dead_man.command(0.59) != HALT
    dead_man.press("w", 0.595)
    assert dead_man.command(0.89) != HALT
    assert dead_man.command(0.90) == HALT


@pytest.mark.parametrize("key_first", [True, False])
def test_keys_that_waited_while_it_was_suspended_move_nobody(key_first: bool) -> None:
    """Keys that the user presses while the program is suspended are discarded. Later keys steer."""
    dead_man = DeadMan()
    dead_man.press("w", 0.0)
    assert dead_man.command(0.0) not in (None, HALT)
    if not key_first:
        assert dead_man.command(10.0) == HALT
    for number in range(20):
        assert dead_man.press("w", 10.0 + 0.01 * number)
        assert dead_man.command(10.0 + 0.01 * number) in (None, HALT)
    dead_man.press("w", 10.01 + DEAF_S)
    assert dead_man.command(10.02 + DEAF_S) not in (None, HALT)


def test_stop_is_at_once() -> None:
    """After ``stop`` the next command is zero, although the last key press is still recent."""
    dead_man = DeadMan()
    dead_man.press("w", 0.0)
    assert dead_man.command(0.01) != HALT
    dead_man.stop()
    assert dead_man.command(0.02) == HALT


def test_who_has_not_steered_commands_nothing() -> None:
    """Before the first steering key, the monitor publishes no commands, not even zero commands.

    Zero commands would disturb another node that drives the robot.
    """
    dead_man = DeadMan()
    assert not dead_man.press("x", 0.0)
    assert commands(dead_man, 0.0, 100) == [None] * 100
    assert not dead_man.has_driven


@pytest.mark.parametrize(
    ("key", "signs"),
    [
        *((key, (1, 0, 0)) for key in ("w", "up")),
        *((key, (-1, 0, 0)) for key in ("s", "down")),
        *((key, (0, 1, 0)) for key in ("a", "left")),
        *((key, (0, -1, 0)) for key in ("d", "right")),
        ("j", (0, 0, 1)),
        ("l", (0, 0, -1)),
    ],
)
def test_a_key_means_its_direction(key: str, signs: tuple[int, int, int]) -> None:
    """Each key commands its direction.

    In a command, x is forward, y is left, and left turns are positive.
    """
    dead_man = DeadMan()
    dead_man.press(key, 0.0)
    command = dead_man.command(0.0)
    assert command == BodyTwist(*(0.15 * sign for sign in signs))


@given(st.lists(st.sampled_from([1, -1]), max_size=50), keys)
def test_speeds_stay_within_the_drivers_limits(steps: list[int], key: str) -> None:
    """The user changes the speeds.

    Each speed stays between 10 % and 100 % of the driver's limit for it.
    """
    dead_man = DeadMan()
    dead_man.fastest = (0.4, 1.5)
    for step in steps:
        dead_man.change_speed(step)
    assert 0.04 <= dead_man.speeds[0] <= 0.4
    assert 0.15 <= dead_man.speeds[1] <= 1.5
    dead_man.press(key, 0.0)
    command = dead_man.command(0.0)
    assert command
    assert not command.faster_than(0.4, 1.5)
