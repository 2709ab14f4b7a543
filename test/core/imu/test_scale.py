# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the conversion of the MPU6050's counts to SI units."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.imu.scale import ImuScale, gravity_advice

triples = st.tuples(*[st.integers(-32768, 32767)] * 3)

Triple = tuple[int, int, int]


@pytest.mark.parametrize(("range_g", "counts"), [(2, 16384), (4, 8192), (8, 4096), (16, 2048)])
def test_one_g_is_the_datasheets_counts(range_g: int, counts: int) -> None:
    """A sensor measures 1 g. In each range, its counts are those in the datasheet (section 6.2)."""
    scale = ImuScale(accel_range_g=range_g)
    assert scale.specific_force((counts, -counts, 0)) == pytest.approx((9.80665, -9.80665, 0.0))


@pytest.mark.parametrize(
    ("range_dps", "counts_per_10_dps"), [(250, 1310), (500, 655), (1000, 328), (2000, 164)]
)
def test_ten_degrees_a_second_are_the_datasheets_counts(
    range_dps: int, counts_per_10_dps: int
) -> None:
    """A sensor turns at 10°/s. In each range, its counts are those in the datasheet (section 6)."""
    scale = ImuScale(gyro_range_dps=range_dps)
    assert scale.angular_velocity((0, counts_per_10_dps, -counts_per_10_dps)) == pytest.approx(
        (0.0, 0.17453292519943295, -0.17453292519943295)
    )


def test_two_g_and_250_degrees_a_second_are_the_default() -> None:
    """The default ranges are those of the sensor at power-up: 2 g and 250 °/s."""
    assert ImuScale().specific_force((0, 0, 16384))[2] == pytest.approx(9.80665)
    assert ImuScale().angular_velocity((131, 0, 0))[0] == pytest.approx(math.radians(1.0))


@settings(max_examples=40)
@given(triples)
def test_axes_stay_the_sensors_own(counts: Triple) -> None:
    """The conversion of counts to SI units does not turn, swap or shift the axes."""
    for measured in (ImuScale().specific_force(counts), ImuScale().angular_velocity(counts)):
        for value, count in zip(measured, counts, strict=True):
            assert math.copysign(1, value) == math.copysign(1, count)
            assert (value == 0) == (count == 0)


def test_full_scale_is_the_range() -> None:
    """32768 counts are 2 g (19.6 m/s²) in the smallest range and 16 g in the largest range."""
    assert ImuScale(accel_range_g=2).specific_force((-32768, 0, 0))[0] == pytest.approx(-19.6133)
    assert ImuScale(accel_range_g=16).specific_force((-32768, 0, 0))[0] == pytest.approx(-156.9064)


@pytest.mark.parametrize(("accel", "gyro"), [(3, 250), (2, 300)])
def test_a_range_that_the_sensor_does_not_have_is_an_error(accel: int, gyro: int) -> None:
    """The user sets a range that the MPU6050 does not have. This raises an error."""
    scale = ImuScale(accel_range_g=accel, gyro_range_dps=gyro)
    with pytest.raises(KeyError):
        (scale.specific_force((0, 0, 0)), scale.angular_velocity((0, 0, 0)))


@pytest.mark.parametrize("actual_g", [2, 4, 8, 16])
@pytest.mark.parametrize("believed_g", [2, 4, 8, 16])
def test_gravity_tells_which_range_the_sensor_is_set_to(actual_g: int, believed_g: int) -> None:
    """If sensor and driver have different ranges, the advice is to set ``accel_range``.

    An error of 8 % in gravity does not change the advice.
    """
    for error in (0.92, 1.0, 1.08):
        text = gravity_advice(error * 9.80665 * believed_g / actual_g, believed_g)
        assert bool(text) == (actual_g != believed_g)
        assert not text or text.endswith(f"set `accel_range` to {actual_g}")


@pytest.mark.parametrize("gravity", [0.0, 7.0, 12.0, 100.0])
def test_what_is_gravity_in_no_range_is_a_bias_or_a_broken_sensor(gravity: float) -> None:
    """No range of the sensor can explain the gravity that is measured at rest.

    The advice is to check the range, the bias and the sensor.
    """
    assert gravity_advice(gravity, 2).endswith(
        "check `accel_range` and `accel_bias`, or the sensor"
    )
