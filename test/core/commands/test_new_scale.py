# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of changes of the board's scales (LSB per unit) while the robot drives.

The current command is converted to the new scale.
"""

from robots import driving
from session_bench import STOP, Bench, bare

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.simulator.omnibot import BoardSettings

RAMP = SpeedLimits(linear_mps2=0.5)


def last(bench: Bench) -> bytes:
    return bare(bench.written[-1][1])


def going_to(x_m: float) -> Bench:
    """Return a bench on position control whose robot drives to a goal ``x_m`` ahead."""
    bench = Bench(BoardSettings(running=True, control="position"))
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    bench.go_to(x_m, 0.0, 0.0)
    return bench


def test_a_velocity_is_repeated_in_the_new_scale() -> None:
    """The robot drives at 0.4 m/s, and the scale changes from 70 to 100 LSB per m/s.

    The repeated command changes from 28 LSB to 40 LSB.
    """
    bench = driving()
    bench.drive(0.4)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 00 1C 00 00 00 00")
    bench.configure_board(linear_scale=100.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 00 28 00 00 00 00")


def test_wheel_rates_are_repeated_in_the_new_scale_and_for_the_new_wheel() -> None:
    """The wheels are commanded to turn at 10 rad/s, and the configured wheel radius is doubled.

    The repeated command changes from 20 LSB to 41 LSB.
    """
    bench = driving()
    bench.turn_wheels(10.0, 0.0, -10.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 02 00 14 00 00 FF EC")
    bench.configure_board(wheel_radius_m=0.058)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 02 00 29 00 00 FF D7")


def test_a_goal_is_repeated_in_the_new_scale() -> None:
    """The robot drives to a goal at 1 m, and the scale of positions is halved.

    The repeated goal changes from 1000 LSB to 500 LSB.
    """
    bench = going_to(1.0)
    assert last(bench) == bytes.fromhex("FF FE 01 03 E8 00 00 00 00")
    bench.configure_board(position_scale=500.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 01 F4 00 00 00 00")


def test_a_goal_that_the_new_scale_cannot_say_ends_with_stop_and_a_sentence() -> None:
    """With a new scale, the current goal at 10 m does not fit into a 16-bit word.

    The driver sends Stop, and a notice says why.
    """
    bench = going_to(10.0)
    bench.configure_board(position_scale=10_000.0)
    assert last(bench) == bare(STOP)
    assert "does not fit the new settings" in bench.notices[-1]
    bench.run(2.0)
    assert bench.still()


def test_a_ramp_goes_on_from_where_it_was() -> None:
    """The scale changes during a ramp. The ramp continues without a step in speed."""
    bench = Bench(BoardSettings(running=True), limits=RAMP)
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    for _ in range(10):
        bench.drive(0.4)
        bench.run(0.04)
    before = int.from_bytes(last(bench)[3:5], "big")
    bench.configure_board(linear_scale=84.0)
    bench.run(0.02)
    after = int.from_bytes(last(bench)[3:5], "big")
    assert 1.2 * (before - 0.5) - 0.5 <= after <= 1.2 * (before + 2.2) + 0.5
    for _ in range(20):
        bench.drive(0.4)
        bench.run(0.04)
    assert last(bench) == bytes.fromhex("FF FE 01 00 22 00 00 00 00")


def test_what_the_new_scale_rounds_to_nothing_is_stop() -> None:
    """With a new scale, the commanded speed is rounded to 0 on the line.

    The driver sends the Stop frame, not a velocity frame with zeros.
    """
    bench = driving()
    bench.drive(0.05)
    bench.configure_board(linear_scale=5.0)
    bench.run(0.1)
    assert last(bench) == bare(STOP)


def test_what_the_old_scale_rounded_to_nothing_does_not_become_motion() -> None:
    """A speed that the old scale rounded to 0 does not become a motion with the new scale.

    Only the next command moves the robot.
    """
    limits = SpeedLimits(linear_mps2=0.1)
    bench = Bench(BoardSettings(running=True), limits=limits)
    bench.open()
    bench.run_until_state("nominal")
    bench.configure_board(linear_scale=1.0)
    bench.drive(0.4)
    bench.run(0.1)
    assert last(bench) == bare(STOP)
    mark = len(bench.written)
    bench.configure_board(linear_scale=70.0)
    bench.run(0.6)
    assert b"\xff\xfe\x01" not in bench.written_since(mark)
    bench.drive(0.4)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 00 01 00 00 00 00")


def test_a_robot_that_nobody_commands_hears_nothing_of_it() -> None:
    """A scale changes while no command is active. The driver sends nothing."""
    bench = driving()
    bench.run(3.0)
    start = len(bench.written)
    bench.configure_board(linear_scale=100.0)
    bench.run(1.0)
    assert len(bench.written) == start
