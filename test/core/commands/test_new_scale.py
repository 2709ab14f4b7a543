# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's scales change while the robot drives, and the current command is converted."""

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
    """At 0.4 m/s, 28 LSB become 40 LSB when the scale changes from 70 to 100 LSB per m/s."""
    bench = driving()
    bench.drive(0.4)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 00 1C 00 00 00 00")
    bench.configure_board(linear_scale=100.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 00 28 00 00 00 00")


def test_wheel_rates_are_repeated_in_the_new_scale_and_for_the_new_wheel() -> None:
    """At 10 rad/s, 20 LSB become 41 LSB when the wheel radius is doubled."""
    bench = driving()
    bench.turn_wheels(10.0, 0.0, -10.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 02 00 14 00 00 FF EC")
    bench.configure_board(wheel_radius_m=0.058)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 02 00 29 00 00 FF D7")


def test_a_goal_is_repeated_in_the_new_scale() -> None:
    """For a goal at 1 m, 1000 LSB become 500 LSB when the scale is halved."""
    bench = going_to(1.0)
    assert last(bench) == bytes.fromhex("FF FE 01 03 E8 00 00 00 00")
    bench.configure_board(position_scale=500.0)
    bench.run(0.1)
    assert last(bench) == bytes.fromhex("FF FE 01 01 F4 00 00 00 00")


def test_a_goal_that_the_new_scale_cannot_say_ends_with_stop_and_a_sentence() -> None:
    """A goal at 10 m with 10,000 LSB per m does not fit a 16-bit word."""
    bench = going_to(10.0)
    bench.configure_board(position_scale=10_000.0)
    assert last(bench) == bare(STOP)
    assert "does not fit the new scale" in bench.notices[-1]
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
    """The new scale rounds the commanded speed to 0. The driver sends Stop, not zeros in mode 1."""
    bench = driving()
    bench.drive(0.05)
    bench.configure_board(linear_scale=5.0)
    bench.run(0.1)
    assert last(bench) == bare(STOP)


def test_a_robot_that_nobody_commands_hears_nothing_of_it() -> None:
    """A scale changes while no command is active. The driver sends nothing."""
    bench = driving()
    bench.run(3.0)
    start = len(bench.written)
    bench.configure_board(linear_scale=100.0)
    bench.run(1.0)
    assert len(bench.written) == start
