# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the calibration of the gyro's bias, and of motions that must not be taken for a bias."""

import itertools
import math
from collections.abc import Iterable, Iterator
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.imu.gyro_calibration import (
    LARGEST_BIAS_RADPS,
    STILL_RADPS,
    GyroCalibration,
    deviation,
    mean,
)
from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.requests import RequestDone

NONE: Vector3 = (0.0, 0.0, 0.0)
GRAVITY: Vector3 = (0.0, 0.0, -9.8)
NOISE_RADPS = 0.0009
TICK_S = 0.01

biases = st.tuples(*[st.floats(-0.3, 0.3)] * 3)
vectors = st.tuples(*[st.floats(-40.0, 40.0)] * 3)


def noisy(bias: Vector3, noise: float, seed: int = 0) -> Iterator[Vector3]:
    random = Random(seed)
    while True:
        x, y, z = (random.gauss(value, noise) for value in bias)
        yield x, y, z


def stand(
    calibration: GyroCalibration,
    rates: Iterable[Vector3],
    seconds: float,
    *,
    start_s: float = 100.0,
    force: Vector3 = GRAVITY,
    rolling: Vector3 | None = NONE,
) -> None:
    """Give readings at 100 Hz to the calibration, and a displacement after every fourth reading.

    * ``rates``: gyro readings in rad/s.
    * ``force``: specific force in m/s².
    * ``rolling``: x and y in m, and turn in rad, of each displacement; None: no displacements.
    """
    count = round(seconds / TICK_S)
    for number, rate in enumerate(itertools.islice(rates, count)):
        calibration.hear(rate, force, start_s + number * TICK_S)
        if rolling is not None and number % 4 == 3:
            calibration.displaced(*rolling)


def answer(calibration: GyroCalibration) -> RequestDone:
    (only,) = calibration.answers
    assert not calibration.measuring
    assert calibration.wake_at == math.inf
    return only


@settings(max_examples=40)
@given(st.lists(vectors, min_size=1, max_size=30))
def test_moments_are_those_of_the_textbook(values: list[Vector3]) -> None:
    """Mean and standard deviation are those of the textbook's formulas, for each axis."""
    for axis in range(3):
        column = [value[axis] for value in values]
        middle = sum(column) / len(column)
        variance = sum((value - middle) ** 2 for value in column) / len(column)
        assert mean(values)[axis] == pytest.approx(middle, abs=1e-9)
        assert deviation(values)[axis] == pytest.approx(math.sqrt(variance), abs=1e-9)


@pytest.mark.slow
@settings(max_examples=40)
@given(biases, st.integers(0, 2**16))
def test_a_planted_bias_is_found_and_told(bias: Vector3, seed: int) -> None:
    """A calibration uses 2 s of noisy readings at rest.

    The bias is right within five standard errors of the mean.
    """
    calibration = GyroCalibration((0.1, 0.1, 0.1), refine=False)
    calibration.measure("token", 0.0)
    stand(calibration, noisy(bias, NOISE_RADPS, seed), 2.1)
    done = answer(calibration)
    assert (done.token, done.success) == ("token", True)
    assert calibration.bias == pytest.approx(bias, abs=5 * NOISE_RADPS / math.sqrt(200))
    assert calibration.noise == pytest.approx((NOISE_RADPS,) * 3, rel=0.3)
    assert all(f"{value:.5f}" in done.message for value in calibration.bias)


def test_without_wheels_the_gyro_alone_tells() -> None:
    """The board sends no displacements, as in IMU-only mode.

    A steady gyro is enough to prove rest.
    """
    calibration = GyroCalibration(NONE, refine=False)
    calibration.measure("token", 0.0)
    stand(calibration, noisy((0.02, 0.0, 0.0), NOISE_RADPS), 2.1, rolling=None)
    assert answer(calibration).success
    assert calibration.bias[0] == pytest.approx(0.02, abs=3e-4)


@pytest.mark.parametrize(
    ("rates", "rolling", "why"),
    [
        (noisy(NONE, NOISE_RADPS), (0.0005, 0.0, 0.0), "its wheels turn"),
        (noisy(NONE, NOISE_RADPS), (0.0, 0.0, -0.0005), "its wheels turn"),
        (noisy(NONE, 2 * STILL_RADPS), NONE, "its gyro varies by"),
        (noisy((0.0, 0.0, 0.4), NOISE_RADPS), NONE, "too much for a bias"),
        (((0.0, 0.0, 0.02 * math.sin(n / 20)) for n in itertools.count()), NONE, "varies"),
    ],
)  # fmt: skip
def test_a_robot_that_moves_is_refused_with_what_showed_it(
    rates: Iterator[Vector3], rolling: Vector3, why: str
) -> None:
    """The robot moves during a calibration. The calibration fails, and the bias stays as it was.

    The message says what showed the motion.
    """
    calibration = GyroCalibration((0.1, 0.2, 0.3), refine=True)
    calibration.measure("token", 0.0)
    stand(calibration, rates, 2.1, rolling=rolling)
    done = answer(calibration)
    assert not done.success
    assert why in done.message
    assert "call again" in done.message
    assert calibration.bias == (0.1, 0.2, 0.3)


def test_a_shaken_accelerometer_is_motion() -> None:
    """The robot is carried. The gyro does not show this, but the accelerometer does.

    The calibration fails.
    """
    calibration = GyroCalibration(NONE, refine=False)
    calibration.measure("token", 0.0)
    for number, rate in enumerate(itertools.islice(noisy(NONE, NOISE_RADPS), 210)):
        calibration.hear(rate, (math.sin(number / 10), 0.0, -9.8), number * TICK_S)
    assert "accelerometer varies" in answer(calibration).message


def test_readings_before_the_request_do_not_count() -> None:
    """The robot moves before a calibration is requested.

    The calibration uses only later readings.
    """
    calibration = GyroCalibration(NONE, refine=False)
    stand(calibration, noisy((0.0, 0.0, 2.0), 0.5), 0.9, rolling=(0.01, 0.0, 0.0))
    calibration.measure("token", 0.0)
    stand(calibration, noisy((0.0, 0.0, 0.01), NOISE_RADPS), 2.1, start_s=100.9)
    assert answer(calibration).success
    assert calibration.bias[2] == pytest.approx(0.01, abs=3e-4)


def test_a_gap_begins_anew_and_too_few_readings_are_an_answer_too() -> None:
    """If gaps in the readings restart the calibration again and again, it fails at its time limit.

    The bias stays as it was, and the message names the gaps.
    """
    calibration = GyroCalibration((0.1, 0.2, 0.3), refine=False)
    calibration.measure("token", 50.0)
    for start_s in (100.0, 102.0, 104.0):
        stand(calibration, noisy(NONE, NOISE_RADPS), 1.5, start_s=start_s)
    assert calibration.measuring
    assert calibration.wake_at < 55.0
    calibration.tick(calibration.wake_at)
    done = answer(calibration)
    assert not done.success
    assert "gap" in done.message
    assert calibration.bias == (0.1, 0.2, 0.3)


def test_a_measurement_that_is_given_up_says_why_once() -> None:
    """A calibration is cancelled. The caller gets one answer, with the reason."""
    calibration = GyroCalibration(NONE, refine=False)
    calibration.give_up("not asked")
    assert not calibration.answers
    calibration.measure("token", 0.0)
    calibration.give_up("the port was lost")
    calibration.give_up("again")
    assert answer(calibration).message.endswith("the port was lost")


@pytest.mark.slow
@settings(max_examples=10)
@given(biases)
def test_standstills_refine_the_bias_little_by_little(bias: Vector3) -> None:
    """At rest, the bias approaches the true one by a twentieth of the difference per second."""
    calibration = GyroCalibration(NONE, refine=True)
    rates = noisy(bias, NOISE_RADPS)
    stand(calibration, rates, 1.05)
    for known, seen in zip(calibration.bias, bias, strict=True):
        assert abs(known) <= 0.051 * (abs(seen) + 5 * NOISE_RADPS)
    stand(calibration, rates, 120.0, start_s=200.0)
    assert calibration.bias == pytest.approx(bias, abs=0.003)
    assert not calibration.answers


@pytest.mark.parametrize(
    ("refine", "rolling"), [(False, NONE), (True, None), (True, (0.001, 0.0, 0.0))]
)
def test_nothing_is_refined_unless_it_is_wanted_and_the_wheels_say_that_they_stand(
    refine: bool, rolling: Vector3 | None
) -> None:
    """The bias is refined only under two conditions.

    Refinement must be on, and displacements must show that the robot is at rest.
    """
    calibration = GyroCalibration(NONE, refine=refine)
    stand(calibration, noisy((0.1, 0.1, 0.1), NOISE_RADPS), 10.0, rolling=rolling)
    assert calibration.bias == NONE


@pytest.mark.slow
@given(st.lists(vectors, max_size=400), st.booleans())
def test_whatever_the_gyro_says_no_bias_is_larger_than_a_sensor_can_have(
    rates: list[Vector3], measure: bool
) -> None:
    """For any readings of the gyro, the bias is finite.

    It is never larger than the largest bias that a real sensor can have.
    """
    calibration = GyroCalibration(NONE, refine=True)
    if measure:
        calibration.measure("token", 0.0)
    stand(calibration, itertools.cycle(rates or [NONE]), 4.0)
    assert all(abs(value) <= LARGEST_BIAS_RADPS for value in calibration.bias)


def test_gravity_is_measured_at_rest_alone() -> None:
    """Gravity is unknown before the robot first rests.

    Later measurements are also made only at rest.
    """
    calibration = GyroCalibration(NONE, refine=False)
    assert calibration.gravity_mps2 is None
    stand(calibration, noisy(NONE, NOISE_RADPS), 1.1, force=(0.0, 6.0, -8.0))
    assert calibration.gravity_mps2 == pytest.approx(10.0)
    stand(calibration, noisy(NONE, 0.1), 1.1, start_s=200.0, force=(0.0, 0.0, -5.0))
    assert calibration.gravity_mps2 == pytest.approx(10.0)
