# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the covariance of odometry: its form, its growth, and its agreement with real errors."""

import math
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lossy_drives import attached
from lossy_odometry import Line
from strategies import displacements
from synthetic_board import (
    PERIOD_S,
    SETTINGS,
    Triple,
    arc,
    body,
)

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.covariance import Covariance, OdometryNoise, Uncertainty
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import DisplacementReading, PoseReading
from omnibot_driver.simulator.omnibot import BoardSettings


def minors(c: Covariance) -> Triple:
    """Return the leading principal minors, which are positive if ``c`` is positive definite."""
    first = c.xx
    second = c.xx * c.yy - c.xy**2
    third = (
        c.xx * (c.yy * c.yaw_yaw - c.y_yaw**2)
        - c.xy * (c.xy * c.yaw_yaw - c.y_yaw * c.x_yaw)
        + c.x_yaw * (c.xy * c.y_yaw - c.yy * c.x_yaw)
    )
    return first, second, third


@given(st.lists(displacements("body"), max_size=60))
def test_the_covariance_is_positive_definite_and_grows(readings: list[DisplacementReading]) -> None:
    """With each displacement, the covariance's determinant and the variance of yaw grow or stay."""
    odometry = Odometry(OdometrySettings(noise=OdometryNoise(wheel_scale=0.0, wheel_slip=0.0)))
    before = Covariance()
    for reading in readings:
        (estimate,) = odometry.displace(reading, 0.0)
        now = estimate.covariance
        assert min(minors(now)) > 0
        assert now.yaw_yaw >= before.yaw_yaw
        assert minors(now)[2] >= minors(before)[2] * (1 - 1e-6)
        before = now


@given(st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3, st.sampled_from("mmmmgghsbu"))))
def test_the_covariance_is_positive_definite_after_gaps_and_restarts(
    steps: list[tuple[float, float, float, str]],
) -> None:
    """The covariance is positive definite after any sequence of motions, gaps and restarts.

    The sequence also has events after which the uncertainty of all gaps is removed, replaced or
    made permanent.
    """
    uncertainty, yaw_rad = Uncertainty(OdometryNoise()), 0.0
    for x, y, turn_rad, event in steps:
        if event == "m":
            uncertainty.move(yaw_rad, Pose(x, y, turn_rad))
            yaw_rad += turn_rad
        elif event == "g":
            uncertainty.miss(abs(x), 0.5, 5.0)
        elif event == "h":
            uncertainty.halt(abs(x), 2 * turn_rad)
        elif event == "b":
            uncertainty.bound(x, turn_rad)
        else:
            (uncertainty.settle if event == "s" else uncertainty.give_up)()
        covariance = uncertainty.total(Pose())
        assert min(minors(covariance)) > 0.0
        assert min(minors(covariance.of_direction)) > 0.0


def test_a_robot_that_turned_unheard_has_an_unknown_heading_and_no_more() -> None:
    """The robot may have turned by 50 rad in a gap, and then drives 2 m.

    The direction of the drive is unknown, so x and y become uncertain by 1 to 5 m, and no more.
    """
    uncertainty = Uncertainty(OdometryNoise())
    uncertainty.miss(10.0, 0.0, 5.0)
    uncertainty.give_up()
    uncertainty.move(0.0, Pose(2.0))
    covariance = uncertainty.total(Pose())
    assert 1.0 < math.sqrt(covariance.xx) < 5.0
    assert 1.0 < math.sqrt(covariance.yy) < 5.0


def test_two_wheels_of_wrong_sizes_turn_a_robot_that_drives_straight() -> None:
    """Two wheel sizes are uncertain by 1 %, and the robot drives 1 m forward.

    Each wheel adds standard deviations of 0.025 rad in yaw and 5 mm in x.
    """
    noise = OdometryNoise(
        wheel_drift=0.0,
        wheel_scale=0.01,
        wheel_slip=0.0,
        wheels=DifferentialKinematics(wheel_radius_m=1.0, track_m=0.4),
    )
    odometry = Odometry(OdometrySettings(noise=noise))
    (ahead,) = odometry.displace(body(1.0, 0.0), 0.0)
    assert ahead.covariance.yaw_yaw == pytest.approx(2 * 0.025**2, rel=0.01)
    assert ahead.covariance.xx == pytest.approx(2 * 0.005**2, rel=0.03)


def test_a_robot_at_rest_grows_no_less_sure() -> None:
    """The robot is at rest, so its wheels do not slip. The covariance does not grow."""
    odometry = Odometry(SETTINGS)
    for _ in range(100):
        (estimate,) = odometry.displace(body(0.0, 0.0), 0.0)
    assert estimate.covariance == Covariance()


def test_the_covariance_is_a_random_walk_over_the_way() -> None:
    """The robot drives 1 m forward, so wheels A and B roll 0.87 m each.

    The covariance is the same whether odometry adds this motion in 10 or in 100 steps.
    """
    noise = OdometryNoise(wheel_drift=0.01, wheel_scale=0.0, wheel_slip=0.0)
    for steps in (10, 100):
        odometry = Odometry(OdometrySettings(noise=noise))
        for _ in range(steps):
            (ahead,) = odometry.displace(body(1.0 / steps, 0.0), 0.0)
        of_a_metre = 0.01**2 * math.cos(math.pi / 6) * 2
        assert ahead.covariance.xx == pytest.approx(of_a_metre / 3 + 1e-6, rel=0.01)
        assert ahead.covariance.yaw_yaw == pytest.approx(of_a_metre / (3 * 0.143) ** 2, rel=0.01)


def test_wheels_that_drift_spread_the_robots_as_the_covariance_says() -> None:
    """2000 simulated robots have random wheel errors.

    The spread of their poses fits the covariance.
    """
    random, deviation, n, steps = Random(1), 0.003, 2000, 25
    noise = OdometryNoise(wheel_drift=deviation, wheel_scale=0.0, wheel_slip=0.0)
    odometry = Odometry(OdometrySettings(noise=noise))
    for _ in range(steps):
        (estimate,) = odometry.displace(body(0.06, 0.04, 0.05), 0.0)
    c, radius = math.cos(math.pi / 6), 0.143
    rims = (-c * 0.06 - 0.02 - radius * 0.05, c * 0.06 - 0.02 - radius * 0.05, 0.04 - radius * 0.05)
    ends = []
    for _ in range(n):
        x, y, yaw = (random.gauss(0.0, 1e-3) for _ in range(3))
        for _ in range(steps):
            a, b, d = (rim + random.gauss(0.0, deviation * math.sqrt(abs(rim))) for rim in rims)
            dx, dy, turn = (b - a) / (2 * c), (2 * d - a - b) / 3, -(a + b + d) / (3 * radius)
            ahead, left = arc(dx, dy, turn)
            x, y = (
                x + math.cos(yaw) * ahead - math.sin(yaw) * left,
                y + math.sin(yaw) * ahead + math.cos(yaw) * left,
            )
            yaw += turn
        off = estimate.pose
        ends.append((x - off.x_m, y - off.y_m, yaw - off.yaw_rad))
    pairs = {"xx": (0, 0), "xy": (0, 1), "x_yaw": (0, 2), "yy": (1, 1), "y_yaw": (1, 2)}
    for name, (i, j) in {**pairs, "yaw_yaw": (2, 2)}.items():
        products = [end[i] * end[j] for end in ends]
        mean = sum(products) / n
        error = math.sqrt(sum((product - mean) ** 2 for product in products)) / n
        assert getattr(estimate.covariance, name) == pytest.approx(mean, abs=4 * error), name


def test_an_error_of_a_wheels_size_grows_with_the_way_and_a_way_back_undoes_it() -> None:
    """The error of uncertain wheel sizes grows with the distance, and a drive back removes it.

    The standard deviation of the yaw after 10 m is ten times that after 1 m.
    """
    noise = OdometryNoise(wheel_drift=0.0, wheel_scale=0.01, wheel_slip=0.0)
    deviations = []
    odometry = Odometry(OdometrySettings(noise=noise))
    for step in [0.02] * 500 + [-0.02] * 500:
        (estimate,) = odometry.displace(body(step, 0.0), 0.0)
        deviations.append(math.sqrt(estimate.covariance.yaw_yaw - 1e-6))
    assert deviations[499] == pytest.approx(10 * deviations[49], rel=1e-6)
    assert deviations[49] == pytest.approx(0.01 * math.sqrt(2 / 3) / 2 / 0.143, rel=0.01)
    assert deviations[999] == pytest.approx(0.0, abs=1e-7)
    assert estimate.covariance.yy < 1e-3


@pytest.mark.slow
def test_the_error_of_many_slipping_robots_is_what_the_covariance_says() -> None:
    """The mean NEES of forty robots with wheel sizes wrong by 1 % and slip of 2 % is about 3.

    The limits, 2.29 and 3.80, contain 95 % of such means.
    """
    total = 0.0
    for seed in range(40):
        random = Random(seed)
        a, b, c = (1 + random.gauss(0.0, 0.01) for _ in range(3))
        board = BoardSettings(seed=seed, running=True, slip=0.02, wheel_radius_scale=(a, b, c))
        on = Line(board, seed=seed)
        estimate = on.run(8.0)[-1]
        true = on.board.truth
        off = estimate.pose - Pose(true.x_m, true.y_m, true.yaw_rad)
        total += squared(off, estimate)
    assert 2.29 < total / 40 < 3.80


def squared(off: Pose, estimate: OdometryEstimate) -> float:
    """Return the normalised squared error (NEES) of an estimate whose error is ``off``."""
    c = estimate.covariance
    rows = [
        [c.xx, c.xy, c.x_yaw, off.x_m],
        [c.xy, c.yy, c.y_yaw, off.y_m],
        [c.x_yaw, c.y_yaw, c.yaw_yaw, off.yaw_rad],
    ]
    total = 0.0
    for pivot in range(3):
        head = rows[pivot]
        total += head[3] ** 2 / head[pivot]
        for row in rows[pivot + 1 :]:
            factor = row[pivot] / head[pivot]
            row[:] = [value - factor * above for value, above in zip(row, head, strict=True)]
    return total


def test_settling_removes_nothing_but_the_gap() -> None:
    """If no displacement is lost, a pose of the board leaves the covariance unchanged.

    The board computes poses and displacements from the same wheels, with the same errors.
    """
    odometry = attached(OdometrySettings(noise=OdometryNoise(wheel_drift=0.01)))
    ahead = DisplacementReading(0.02, 0.0, 0.0, "earth", PERIOD_S, 0)
    for number in range(50):
        (before,) = odometry.displace(ahead, 0.0)
        odometry.settle(PoseReading(0.02 * (number + 1), 0.0, 0.0))
    still = DisplacementReading(0.0, 0.0, 0.0, "earth", PERIOD_S, 0)
    (after,) = odometry.displace(still, 0.0)
    assert after.covariance.xx == pytest.approx(before.covariance.xx)
    assert after.covariance.yaw_yaw == pytest.approx(before.covariance.yaw_yaw)


@pytest.mark.slow
def test_the_twist_is_as_good_as_its_default_covariance_says() -> None:
    """Robots slip, speed up and brake. The RMS errors of the twist fit its default covariance.

    They are below 0.02 m/s and 0.025 rad/s.
    """
    linear, angular, n = 0.0, 0.0, 0
    for seed in range(8):
        random = Random(seed)
        a, b, c = (1 + random.gauss(0.0, 0.01) for _ in range(3))
        board = BoardSettings(seed=seed, running=True, slip=0.02, wheel_radius_scale=(a, b, c))
        on = Line(board, seed=seed)
        on.run(1.0)
        for _ in range(100):
            twist, true = on.run(PERIOD_S)[-1].twist, on.board.truth
            assert twist is not None
            linear += ((twist.vx_mps - true.vx_mps) ** 2 + (twist.vy_mps - true.vy_mps) ** 2) / 2
            angular += (twist.yaw_rate_radps - true.yaw_rate) ** 2
            n += 1
    assert 0.2 * 0.02 < math.sqrt(linear / n) < 0.02
    assert 0.2 * 0.025 < math.sqrt(angular / n) < 0.025
