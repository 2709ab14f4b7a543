# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the sensor readings that the driver publishes for the Teensy boards, in SI units."""

import pytest
from fejemis_bench import DRIVE, FRONT, nominal

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.fejemis.readings import (
    BatteryReading,
    MagneticReading,
    RangeReading,
    SteeringReading,
)
from omnibot_driver.core.imu.bias_correction import ImuCorrection
from omnibot_driver.core.odometry.estimator import OdometrySettings
from omnibot_driver.core.readings import OrientedImuReading
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated


def test_all_sensors_are_told_in_si_units() -> None:
    """All sensor readings are published in SI units.

    These are battery, magnetometer, orientation, four ranges and the angle of the front wheel.
    """
    bench = nominal(Simulated(front_m=0.3))
    bench.run(1.0)
    battery = bench.extras(BatteryReading)[-1]
    assert battery.volts == pytest.approx(24.9, abs=0.1)
    assert battery.amps < 0.0
    assert battery.cells == 6
    assert not battery.low
    assert bench.extras(MagneticReading)[-1].field_t == pytest.approx((17e-6, 0.0, -47e-6))
    oriented = bench.extras(OrientedImuReading)[-1]
    assert oriented.orientation == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=0.01)
    assert oriented.specific_force[2] == pytest.approx(9.81, abs=0.4)
    ranges = {reading.name: reading.distance_m for reading in bench.extras(RangeReading)}
    assert ranges == pytest.approx({"tof": 0.3, "sonar": 0.3, "ir1": 0.3, "ir2": 0.3}, abs=0.01)
    assert bench.extras(SteeringReading)[-1].angle_rad == pytest.approx(0.0, abs=0.01)


def test_the_biases_are_subtracted_from_both_imu_topics() -> None:
    """The driver subtracts ``gyro_bias`` and ``accel_bias`` from the samples on both IMU topics.

    The topics are imu/data_raw and imu/data. Regression: the driver did not subtract the biases
    from the samples on imu/data, which have an orientation.
    """
    bench = nominal()
    settings = SessionSettings(
        limits=SpeedLimits(linear_mps=1.0, angular_radps=1.5),
        commands=CommandSettings(),
        odometry=OdometrySettings(),
        imu=ImuCorrection(accel_bias=(0.0, 0.0, 0.5)),
    )
    bench.session.configure(settings, bench.now)
    before = bench.extras(OrientedImuReading)[-1]
    bench.session.gyro_bias = (0.0, 0.0, 0.1)
    bench.events.clear()
    bench.run(1.0)
    for after in bench.imu[-1], bench.extras(OrientedImuReading)[-1]:
        assert after.angular_velocity[2] == pytest.approx(
            before.angular_velocity[2] - 0.1, abs=0.02
        )
        assert after.specific_force[2] == pytest.approx(before.specific_force[2] - 0.5, abs=0.3)


@pytest.mark.slow
def test_an_orientation_has_no_turn_rate_from_before_a_reconnect() -> None:
    """A robot turns at 1 rad/s, and the driver disconnects. The robot rests at the reconnect.

    The first orientations after the reconnect have a turn rate near zero.
    """
    bench = nominal()
    bench.drive_on(0.0, 1.0, 2.0)
    assert bench.extras(OrientedImuReading)[-1].angular_velocity[2] > 0.9
    bench.close()
    bench.robot.receive(b"rc 2 0 0\n", bench.now, DRIVE)
    bench.speaks = set()
    bench.run(2.0)
    bench.speaks = {DRIVE, FRONT}
    bench.events.clear()
    bench.open()
    bench.run(0.2)
    rates = [reading.angular_velocity[2] for reading in bench.extras(OrientedImuReading)]
    assert len(rates) >= 8
    assert max(map(abs, rates)) < 0.1


def test_an_orientation_without_a_recent_imu_sample_is_not_published() -> None:
    """The lines of the gyro are lost, but orientations still arrive.

    The driver does not publish these orientations, because the last turn rate is too old.
    """
    bench = nominal()
    bench.robot.drive._items["gyro"] = lambda: "lost"
    bench.run(0.1)
    bench.events.clear()
    bench.run(0.2)
    assert not bench.extras(OrientedImuReading)


def test_a_low_battery_is_not_told_with_each_message() -> None:
    """The voltage per cell is low for 4 s, in many messages. Only one notice reports this."""
    bench = nominal(Simulated(volts=20.4))
    bench.run(4.0)
    assert bench.extras(BatteryReading)[-1].low
    assert sum("battery is low" in text for text in bench.notices) == 1
