# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A robot that does not do what it is told, as its displacements show."""

import pytest
from bench import STOP, Bench
from robots import drive_on, driving, push, standing

from omnibot_driver.simulator import BoardSettings


@pytest.fixture
def bench() -> Bench:
    return driving()


def test_a_robot_that_is_commanded_and_does_not_move_is_told_of_once() -> None:
    """Blocked wheels, no motor power, or a switch that stands on position."""
    bench = Bench(BoardSettings(running=True, control="position"), control="velocity")
    bench.open()
    bench.run(1.5)
    for _ in range(10):
        drive_on(bench)
    assert len(bench.notices) == 1
    assert "`control_method`" in bench.notices[0]


def test_a_robot_that_has_obeyed_meanwhile_is_told_of_again() -> None:
    """The cable to it was cut twice."""
    bench = standing()
    for hears in (False, True, False):
        bench.hears = hears
        for _ in range(10):
            drive_on(bench)
        bench.drive()
        bench.run(3.0)
        bench.hears = True
        bench.run(3.0)
    assert len(bench.notices) == 2


def test_a_slow_command_and_a_command_to_stand_prove_nothing(bench: Bench) -> None:
    """Within the noise nobody can tell."""
    for _ in range(40):
        bench.drive(0.001, 0.0, 0.01)
        bench.run(0.1)
    for _ in range(40):
        bench.drive()
        bench.run(0.1)
    assert bench.notices == []


def test_in_imu_only_mode_nothing_is_found() -> None:
    """No displacement tells anything."""
    bench = Bench(BoardSettings(running=True, imu_only=True))
    bench.open()
    bench.run_until_state("imu_only")
    for _ in range(10):
        drive_on(bench)
    bench.run(5.0)
    assert bench.notices == []


def test_a_robot_that_did_not_hear_stop_is_stopped_when_it_can_hear_again(bench: Bench) -> None:
    """The cut outlasts the second of Stops; its deltas show that it drives on."""
    bench.hears = False
    bench.run(6.0)
    assert not bench.still()
    assert len([text for text in bench.notices if "although it is to stand" in text]) == 1
    bench.hears = True
    bench.run(0.5)
    assert bench.still()
    bench.run(3.0)
    start = len(bench.written)
    bench.run(3.0)
    assert bench.written_since(start) == b""


def test_a_robot_that_rolls_out_or_is_nudged_makes_no_notice(bench: Bench) -> None:
    """Standing takes a moment, and whoever bumps into it does not drive it."""
    bench.run(4.0)
    for _ in range(5):
        push(bench, 0.005, 0.0, 0.0)
        bench.run(0.4)
    assert bench.notices == []


def test_the_stops_for_a_robot_that_moves_unbidden_do_not_hinder_the_next_command(
    bench: Bench,
) -> None:
    """They are harmless, and a command replaces them."""
    bench.hears = False
    bench.run(4.0)
    bench.hears = True
    drive_on(bench)
    assert not bench.still()
    assert bench.written[-1][1] != STOP
