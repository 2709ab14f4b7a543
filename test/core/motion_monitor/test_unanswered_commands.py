# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Robots that do not move when commanded, or move without a command."""

import pytest
from disobedient_robots import (
    PERIOD_S,
    started,
)
from robots import drive_on, driving, push, standing
from session_bench import STOP, TICK_S, Bench

from omnibot_driver.simulator.omnibot import BoardSettings
from omnibot_driver.simulator.omnibot.motors import WheelGains


@pytest.fixture
def bench() -> Bench:
    return driving()


@pytest.mark.slow
def test_a_robot_that_is_commanded_and_does_not_move_is_told_of_once() -> None:
    """The board's switch is set to position control, so the robot does not obey velocities.

    It does not move. The driver reports this once.
    """
    bench = started(BoardSettings(running=True, control="position"), control="velocity")
    for _ in range(10):
        drive_on(bench)
    assert len(bench.notices) == 1
    assert "`control_method`" in bench.notices[0]
    assert bench.session.figures(bench.now).commands.trips == 0


@pytest.mark.slow
@pytest.mark.parametrize("held_s", [0.3, 0.8, 3.0])
@pytest.mark.parametrize("gains", [WheelGains(), WheelGains(proportional=0.0, integral=0.3)])
def test_a_robot_that_somebody_holds_may_leap_when_it_is_released(
    held_s: float, gains: WheelGains
) -> None:
    """A held robot is released and may leap. The motion monitor does not trip.

    The robot can leap, because its wheel controllers have wound up while it was held.
    """
    bench = driving(wheel_gains=gains)
    bench.board.grip()
    for _ in range(round(held_s / PERIOD_S)):
        bench.drive(0.4)
        bench.run(PERIOD_S)
    bench.board.let_go()
    for _ in range(20):
        bench.drive(0.4)
        bench.run(PERIOD_S)
    assert len(bench.notices) == (held_s > 1.0)
    assert bench.session.figures(bench.now).commands.trips == 0


@pytest.mark.slow
def test_a_robot_that_has_obeyed_meanwhile_is_told_of_again() -> None:
    """A robot ignores a first drive command, obeys a second one, and ignores a third one.

    The driver reports for the first and the third command that the robot does not move.
    """
    bench = standing()
    for hears in (False, True, False):
        bench.hears = hears
        for _ in range(10):
            drive_on(bench)
        bench.drive()
        bench.run(3.0)
        bench.hears = True
        bench.run(3.0)
    assert len([text for text in bench.notices if "does not move" in text]) == 2


def test_a_slow_command_and_a_command_to_stand_prove_nothing(bench: Bench) -> None:
    """No notice appears for a command of 1 mm/s, or for a zero speed.

    Neither shows whether the robot obeys: a motion of 1 mm/s is within the noise.
    """
    for _ in range(40):
        bench.drive(0.001, 0.0, 0.01)
        bench.run(0.1)
    for _ in range(40):
        bench.drive()
        bench.run(0.1)
    assert bench.notices == []


def test_in_imu_only_mode_nothing_is_found() -> None:
    """In IMU-only mode, the board sends no displacements to compare with the commands.

    So the motion monitor does not trip.
    """
    bench = Bench(BoardSettings(running=True, imu_only=True, linear_scale=70 / 2.38))
    bench.open()
    bench.run_until_state("imu_only")
    for _ in range(10):
        drive_on(bench)
    bench.run(5.0)
    assert not [text for text in bench.notices if text.startswith("robot")]
    assert bench.session.figures(bench.now).commands.trips == 0


@pytest.mark.slow
def test_a_robot_that_did_not_hear_stop_is_stopped_when_it_can_hear_again(bench: Bench) -> None:
    """The robot has missed the first Stops. Its deltas show motion, so Stop is sent again."""
    bench.hears = False
    bench.run(20.0)
    assert not bench.still()
    assert len([text for text in bench.notices if "without a command" in text]) == 1
    bench.hears = True
    bench.run(0.5)
    assert bench.still()
    bench.run(3.0)
    start = len(bench.written)
    bench.run(3.0)
    assert bench.written_since(start) == b""


def test_a_robot_that_rolls_out_or_is_nudged_makes_no_notice(bench: Bench) -> None:
    """The robot rolls out after Stop, and is later bumped for a moment. No notice appears."""
    bench.run(4.0)
    for _ in range(5):
        push(bench, 0.005, 0.0, 0.0)
        bench.run(0.4)
    assert bench.notices == []


@pytest.mark.slow
def test_a_robot_that_is_pushed_for_long_is_not_stopped_without_end() -> None:
    """A robot is pushed for a long time. The driver sends Stop at once, and then ever more rarely.

    After the push, the robot obeys commands.
    """
    bench = standing()
    bench.board.grip(0.3, 0.0, 0.2)
    start = len(bench.written)
    begun = bench.now
    while bench.written_since(start) == b"":
        bench.run(TICK_S)
    assert bench.now - begun <= 0.3
    bench.run(80.0)
    times = [at - begun for at, _ in bench.written[start:]]
    assert sum(40.0 < at < 80.0 for at in times) <= 150
    assert len([text for text in bench.notices if "without a command" in text]) == 1
    bench.board.let_go()
    bench.run(1.0)
    drive_on(bench)
    assert not bench.still()


def test_the_stops_for_a_robot_that_moves_without_a_command_do_not_hinder_the_next_one(
    bench: Bench,
) -> None:
    """The driver repeats Stop for a robot that moves without a command.

    A new command ends the repetition, and the robot obeys it.
    """
    bench.hears = False
    bench.run(4.0)
    bench.hears = True
    drive_on(bench)
    assert not bench.still()
    assert bench.written[-1][1] != STOP
