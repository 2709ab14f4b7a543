# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that neither lost replies nor a heavy robot look like a failure."""

import math

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES
from mart_goals import first_distance

from omnibot_driver.core.mart.goal import INCH_M, STRETCH
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.relative_heading import RelativeHeading
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

HEAVY_S = 0.2
"""Time constant in s of the motors of a heavy robot.

The wheels turn for longer after a stop than the server waits for a standstill.
"""


def test_one_heading_does_not_show_that_the_heading_is_constant() -> None:
    """The time without a change of the heading is counted from the first heading of a drive.

    This heading comes 0.7 s after the start. An earlier change cannot be seen.
    """
    heading = RelativeHeading()
    heading.begin(10.0, anew=True)
    heading.tell(-0.02, Moment(10.7, 10.7, 10.7), math.inf)
    assert heading.changed_s == heading.told_s == 10.7
    heading.tell(-0.02, Moment(11.3, 11.3, 11.3), math.inf)
    assert heading.changed_s == 10.7
    heading.tell(-0.03, Moment(11.4, 11.4, 11.4), math.inf)
    assert heading.changed_s == 11.4


@pytest.mark.slow
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_network_that_loses_a_few_replies_does_not_look_like_a_stuck_robot(
    firmware: Firmware,
) -> None:
    """The network loses 3 % of the datagrams while the robot drives and stops several times.

    The driver reports neither that the robot does not move nor that the IMU is dead.
    """
    for seed in range(2):
        bench = MartBench(firmware, NetworkFaults(lose=0.03), seed=seed, motor_lag_s=0.1).ready()
        for _ in range(6):
            bench.command(0.3, 0.1, 1.2)
            bench.command(0.0, 0.0, 1.5)
        told = " ".join(bench.notices)
        assert "does not move" not in told, seed
        assert "IMU is dead" not in told, seed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "firmware"),
    list(zip([(-0.3, 0.0), (0.4, 0.0), (0.0, 0.5)], FIRMWARES, strict=True)),
)
def test_a_stop_that_takes_long_does_not_discard_the_next_goal(
    before: tuple[float, float], firmware: Firmware
) -> None:
    """A slow stop of a heavy robot does not discard the next goal.

    One notice says that the wheels still turned after the server's stop. The robot reaches the
    goal.
    """
    bench = MartBench(firmware, motor_lag_s=HEAVY_S).ready()
    bench.command(*before, 3.0)
    bench.go_to(-0.5, 0.5, 1.0)
    pilot = bench.board._pilot
    bench.run_until(lambda: pilot.goal_progress.startswith("over"), 60.0)
    bench.run(2.0)
    assert math.hypot(bench.truth.x_m + 0.5, bench.truth.y_m - 0.5) < 0.1
    assert sum("the wheels still turned" in notice for notice in bench.notices) == 1
    assert not any("goal" in notice or "obstacle" in notice for notice in bench.notices)


@pytest.mark.slow
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_goal_that_is_replaced_while_a_heavy_robot_moves_is_reached(firmware: Firmware) -> None:
    """New goals arrive during a straight move and during a turn of a heavy robot.

    The robot reaches the last goal.
    """
    bench = MartBench(firmware, motor_lag_s=HEAVY_S).ready()
    for goal, seconds in (((2.0, 0.0, 0.0), 3.0), ((0.5, -1.0, 0.0), 2.0), ((0.0, 0.0, 0.0), 0.5)):
        bench.go_to(*goal)
        bench.run(seconds)
    bench.run_until(lambda: bench.board._pilot.goal_progress.startswith("over"), 60.0)
    bench.run(2.0)
    assert math.hypot(bench.truth.x_m, bench.truth.y_m) < 0.1
    assert len(bench.notices) == 1


@pytest.mark.slow
@pytest.mark.parametrize("stuck", ["right", "both"])
def test_a_turn_with_a_stuck_motor_still_discards_the_goal(stuck: str) -> None:
    """If a motor is stuck in the turn to a goal, the driver discards the goal.

    The server's reply "Start timedout" alone is not a sufficient reason: a heavy robot that still
    moves causes it, too.
    """
    bench = MartBench(motor_lag_s=HEAVY_S).ready()
    bench.server.chassis.change(stuck=stuck)
    bench.go_to(0.0, 1.0, 0.0)
    bench.run(5.0)
    assert any("start timedout; the goal" in notice for notice in bench.notices)


@pytest.mark.slow
def test_an_obstacle_that_stops_a_heavy_robot_does_not_make_the_next_move_longer() -> None:
    """An obstacle ends a move of a heavy robot early. The next move is not longer than usual.

    The server reports the obstacle only in its reply to the next move.
    """
    bench = MartBench(front_m=0.9, motor_lag_s=0.3).ready()
    first_distance(bench, 2.0)
    bench.run(15.0)
    assert any("clearance" in notice for notice in bench.notices)
    assert 0.3 < bench.truth.x_m < 0.6
    assert first_distance(bench, bench.truth.x_m - 2.0) <= round(2.0 / INCH_M / STRETCH) + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "robot"),
    [
        (NetworkFaults(), {"motor_lag_s": 0.25, "dead_zone_units": 2.0}),
        (NetworkFaults(delay_s=0.012), {"motor_lag_s": 0.1}),
    ],
    ids=["a heavy robot", "a network that delays replies"],
)
@pytest.mark.parametrize("seed", [3, 7])
def test_a_turn_that_is_begun_anew_has_other_units(
    faults: NetworkFaults, robot: dict[str, float], seed: int
) -> None:
    """A turn on the spot (L) has a wrong rate. Before each start, the motors get new units (SSP).

    The robot is heavy, or replies are late, so the driver may not get the angle of the turn.
    """
    bench = MartBench("source", faults, seed=seed, motor_inequality=-0.05, **robot).ready()
    since = len(bench.written)
    bench.command(0.0, 0.5, 8.0)
    said = [data.split()[0] for data in bench.said(since)]
    starts = [word for word in said if word in (b"SSP", b"L")]
    assert len(starts) > 2
    assert starts == [b"SSP", b"L"] * (len(starts) // 2)


@pytest.mark.slow
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_heavy_robot_that_coasts_after_a_stop_does_not_look_like_a_stray_one(
    firmware: Firmware,
) -> None:
    """Coasting of a heavy robot after a stop is not reported as a motion without a command."""
    bench = MartBench(firmware, motor_lag_s=0.25).ready()
    for number, twist in enumerate(((0.5, 0.0), (-0.3, 0.0), (0.3, 0.4), (0.0, 0.9))):
        bench.command(*twist, 2.0)
        if (number + FIRMWARES.index(firmware)) % 2:
            bench.estop(True)
        bench.run(2.5)
        bench.estop(False)
        bench.run(0.5)
    assert not any("robot moves" in notice for notice in bench.notices), bench.notices


def test_each_reply_delays_the_report_of_a_silence_even_if_it_has_no_value() -> None:
    """The last reply before a silence has no measurement, only the server's name.

    This reply also delays the report of the silence.
    """
    bench = MartBench().ready()
    bench.speaks = False
    bench.run(0.4)
    bench.session.inbound.receive(b"ok BBB", bench.now, 0)
    bench.run(1.4)
    assert bench.session.state == "nominal"
    bench.run(0.2)
    assert bench.session.state == "connecting"
