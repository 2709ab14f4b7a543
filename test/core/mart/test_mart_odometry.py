# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the odometry and its covariance when requests or replies are lost, late or doubled."""

import math
from dataclasses import astuple
from statistics import mean

import pytest
from honesty import RARE, nees
from mart_bench import MartBench

from omnibot_driver.core.mart import MartSettings, State
from omnibot_driver.core.mart.doubt import Doubt
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.odometry import MartOdometry
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.odometry.covariance import UNKNOWN_YAW_VARIANCE
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.mart import Firmware

WRONG_NEES = 28.0
"""A normalised squared error above this value is a failure of the test.

If the covariance is right, only 1 in 270,000 of these errors is above it.
"""


def at(at_s: float, *, doubtful: bool = False) -> Moment:
    return Moment(at_s, at_s - 0.005, at_s + 0.005, doubtful)


def after_equal_motions(twist: tuple[float, float], quiet_s: float) -> MartBench:
    """Return a test bench after two motions that end with equal encoder counts.

    No reply arrives from the start of each motion until ``quiet_s`` seconds after its stop begins.
    The covariance is checked after each motion.
    """
    bench = MartBench("source", gyro_noise_dps=0.0).ready()
    pilot, counts = bench.board._pilot, []
    for _ in range(2):
        bench.command_until(*twist, lambda: pilot.state is State.STARTING, 6.0)
        bench.speaks = False
        bench.command_until(*twist, lambda: pilot.state is State.STOPPING, 6.0)
        bench.run(quiet_s)
        bench.speaks = True
        for _ in range(15):
            bench.run(0.1)
            assert nees(bench) < WRONG_NEES
        counts.append(round(bench.server.chassis.counts))
    assert counts[0] == counts[1] != 0
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["documented", "source"])
@pytest.mark.parametrize("twist", [(0.3, 0.0), (0.3, 0.4), (0.0, 0.5), (-0.2, 0.0)])
def test_the_covariance_of_the_twist_covers_its_error(
    firmware: Firmware, twist: tuple[float, float]
) -> None:
    """The variances of the twist cover its error, also while the robot speeds up.

    The measured mean speed is then too low.
    """
    bench = MartBench(firmware, seed=1).ready()
    chassis = bench.server.chassis
    errors: list[tuple[float, float]] = []
    for step in range(3 * 100):
        if step % 100 < 60:
            bench.try_command(*twist)
        bench.run(0.05)
        told = bench.odometry[-1]
        assert told.twist is not None
        assert told.twist_variances is not None
        rate_radps = (chassis.right_mps - chassis.left_mps) / MartSettings().track_m
        linear, angular = told.twist_variances
        errors.append(
            (
                (told.twist.vx_mps - chassis.speed_mps) ** 2 / linear,
                (told.twist.yaw_rate_radps - rate_radps) ** 2 / angular,
            )
        )
    assert all(mean(each) < 1.0 for each in zip(*errors, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("speed_mps", [-0.2, 0.3])
def test_a_drive_of_which_no_reply_came_is_not_left_out_for_a_count_like_the_last(
    speed_mps: float,
) -> None:
    """Two drives end with equal encoder counts, and only the replies to their stops arrive.

    The odometry adds both drives, although the second could seem not to have happened.
    """
    error = after_equal_motions((speed_mps, 0.0), 0.05).error
    assert error.way_m < 0.05
    assert abs(error.yaw_rad) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(
    ("twist", "quiet_s"),
    [((-0.2, 0.0), 0.5), ((0.3, 0.0), 0.5), ((0.0, 0.5), 0.5), ((0.0, 0.5), 0.05)],
)
def test_a_motion_that_may_be_left_out_for_a_count_like_the_last_is_covered_by_the_covariance(
    twist: tuple[float, float], quiet_s: float
) -> None:
    """The robot makes two equal motions. No reply proves that the second one has begun.

    The odometry may leave out the second motion. If it does, the covariance covers the error.
    """
    after_equal_motions(twist, quiet_s)


def test_a_copy_of_an_ok_is_not_a_turn_where_the_start_was_lost() -> None:
    """The command that starts a turn is lost, and a copy of an older reply ``ok`` arrives.

    The encoder count does not change, so the driver does not add a turn to the odometry.
    """
    bench = MartBench("source", gyro_noise_dps=0.0).ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(2.0)
    receive, advance, copies = bench.robot.receive, bench.robot.advance, 0

    def lossy(data: bytes, now: float, channel: int) -> None:
        nonlocal copies
        if data.startswith(b"L "):
            copies += 1
        elif bench.board._pilot.state is not State.TURNING or data == b"SM":
            receive(data, now, channel)

    def doubled() -> list[Packet]:
        nonlocal copies
        out = [*advance(), *[(0, b"ok")] * copies]
        copies = 0
        return out

    bench.robot.receive = lossy  # type: ignore[method-assign]
    bench.robot.advance = doubled  # type: ignore[method-assign]
    bench.command(0.0, 0.5, 2.0)
    bench.run(2.0)
    assert any(data.startswith(b"L ") for data in bench.said())
    assert abs(bench.error.yaw_rad) < 0.02


def reversed_by_1000() -> MartOdometry:
    """Return the odometry of a robot that has reversed by 1000 counts, and begins a second motion.

    No encoder count has arrived since the beginning of the second motion.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(0, at(0.5))
    odometry.begin(Motion.REVERSE, 1.0)
    odometry.started(1.1, sure=True)
    odometry.counted(-1000, at(3.0))
    odometry.stand(4.0)
    odometry.counted(-1000, at(4.5))
    odometry.rest()
    odometry.begin(Motion.REVERSE, 5.0)
    return odometry


def test_a_start_that_the_server_has_not_obeyed_adds_no_doubt() -> None:
    """The server answers the stop of a second motion with "no motion".

    This shows that the server never got the start of the second motion. So the covariance hardly
    grows.
    """
    odometry = reversed_by_1000()
    before = odometry.doubt.total([]).xx
    odometry.wheel.refused()
    odometry.stand(8.0)
    odometry.counted(-1000, at(8.5))
    odometry.rest()
    assert odometry.pose.x_m == pytest.approx(-0.4)
    assert odometry.doubt.total([]).xx < before + 0.01**2


def test_a_start_that_was_obeyed_or_not_is_covered_by_the_covariance() -> None:
    """Two motions end with the same encoder count, which begins at zero in each motion.

    The covariance covers a lost start of the second motion and a second motion equal to the first.
    """
    odometry = reversed_by_1000()
    odometry.stand(8.0)
    odometry.counted(-1000, at(8.5, doubtful=True))
    assert odometry.told(8.6, blind_since_s=None).covariance.xx > 0.3**2
    odometry.counted(-1000, at(8.7))
    odometry.rest()
    assert odometry.told(9.0, blind_since_s=None).covariance.xx > 0.3**2


def test_a_count_that_stays_while_the_robot_is_driven_is_not_a_motion() -> None:
    """A copy of an older reply ``ok`` seems to confirm a motion, but the count is unchanged.

    The odometry adds no motion.
    """
    odometry = reversed_by_1000()
    odometry.started(5.1, sure=True)
    for at_s in (5.2, 5.3, 5.4):
        odometry.counted(-1000, at(at_s))
    odometry.stand(6.0)
    odometry.counted(-1000, at(6.5))
    odometry.rest()
    assert odometry.pose.x_m == pytest.approx(-0.4)
    assert odometry.doubt.total([]).xx < 0.05**2


def test_one_doubtful_count_moves_no_robot_that_stands() -> None:
    """A doubtful encoder count may in fact be the reply to a sonar query.

    So one doubtful count does not change the pose. Three doubtful counts in a row change it.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(1167, at(1.0))
    assert odometry.counted(152, at(1.1, doubtful=True)) is None
    odometry.counted(1167, at(1.2))
    assert odometry.pose.x_m == 0.0
    for at_s in (1.3, 1.4, 1.5):
        odometry.counted(1267, at(at_s, doubtful=True))
    assert odometry.pose.x_m == pytest.approx(0.04)


def test_a_curve_of_which_no_heading_came_leaves_the_place_uncertain() -> None:
    """During 1.2 s of a curve, no reply arrives. The covariance covers the unknown path."""
    settings = MartSettings()
    odometry = MartOdometry(settings)
    odometry.counted(0, at(0.9))
    odometry.begin(Motion.REFERENCE, 1.0)
    odometry.started(1.05, sure=True)
    for tenth in range(4):
        odometry.turned(0.0, at(1.1 + tenth / 10))
        odometry.counted(20 * tenth, at(1.15 + tenth / 10))
    odometry.counted(260, at(2.65))
    turn_rad = 0.5
    odometry.turned(math.degrees(turn_rad) * settings.heading_scale, at(2.7))
    odometry.counted(262, at(2.75))
    way_m = 202 * settings.metres_per_count - turn_rad * settings.track_m / 2
    assert odometry.pose.yaw_rad == pytest.approx(turn_rad, abs=0.03)
    wrong_m = way_m * turn_rad / 2 - odometry.pose.y_m
    assert abs(wrong_m) < 3.0 * math.sqrt(odometry.doubt.total([]).yy)


def test_a_reset_during_a_controlled_move_leaves_the_place_uncertain() -> None:
    """The odometry is reset during a controlled move.

    The encoder count of this move also contains the distance before the reset, so the odometry is
    wrong. The covariance covers this error.
    """
    bench = MartBench("source").ready()
    bench.go_to(1.0, 0.0, 0.0)
    bench.run_until(lambda: bench.truth.x_m > 0.5, 10.0)
    from_m = bench.truth.x_m
    bench.session.reset_odometry(bench.now)
    bench.until_it_stands()
    bench.run(2.0)
    told = bench.odometry[-1]
    error_m = told.pose.x_m - (bench.truth.x_m - from_m)
    assert error_m > 0.4
    assert error_m**2 < 4 * told.covariance.xx


def test_a_robot_that_starts_may_be_as_fast_as_it_is_commanded() -> None:
    """A motion has just begun, and its speed is not measured yet.

    The covariance covers a robot that already turns at the commanded rate.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(0, at(0.5))
    odometry.begin(Motion.SPIN, 1.0)
    odometry.started(1.06, sure=True)
    odometry.counted(2, at(1.07))
    covariance = odometry.told(1.13, blind_since_s=None).covariance
    assert covariance.yaw_yaw > 0.03**2


def test_a_start_before_any_heading_has_a_finite_covariance() -> None:
    """A drive begins before the server has reported a heading.

    All covariances are finite. The driver's checks of the odometry would reject a covariance that
    is not finite.
    """
    odometry = MartOdometry(MartSettings())
    odometry.begin(Motion.REFERENCE, 100.0)
    for ahead_s in (0.0, 0.1, 0.5, 2.0):
        told = odometry.told(100.0 + ahead_s, blind_since_s=None)
        assert all(map(math.isfinite, astuple(told.covariance)))


@pytest.mark.parametrize("command", [(-0.15, 0.2), (-0.15, -0.2), (-0.2, 0.1)])
def test_the_covariance_includes_a_change_that_is_carried_out_twice(
    command: tuple[float, float],
) -> None:
    """In a backward drive, the server carries out a change of the motors' speeds twice.

    The robot turns too far, which nothing measures, and the covariance covers the error.
    """
    bench = MartBench("source").ready()
    inner, first = bench.robot.receive, []

    def receive(data: bytes, now: float, channel: int) -> None:
        inner(data, now, channel)
        if data.startswith(b"CS") and not first:
            first.append(data)
            inner(data, now, channel)

    bench.robot.receive = receive  # type: ignore[method-assign]
    bench.command(*command, 3.0)
    bench.command(0.0, 0.0, 3.0)
    assert first
    assert abs(bench.error.yaw_rad) > 0.1
    assert nees(bench) < RARE


def test_a_way_back_in_another_unknown_direction_does_not_lead_back() -> None:
    """A robot drives 2 m forward, and 2 m back, each time after an unknown turn.

    The errors of the two drives do not cancel each other: x is uncertain by more than 1 m.
    """
    doubt = Doubt(MartSettings())
    for step_m in (0.2, -0.2):
        doubt.add(0.0, UNKNOWN_YAW_VARIANCE)
        for _ in range(10):
            doubt.moved(0.0, step_m, 0.0, 1.0, on_the_spot=False, bend=0.0, aside_m=0.0)
    assert 1.0 < math.sqrt(doubt.total([]).xx) < 5.0
