# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings and answers that only a Fejemis has, in SI units; each comes as an ``ExtraReading``."""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.values import value

RangeName = Literal["tof", "sonar", "ir1", "ir2"]
Quaternion = tuple[float, float, float, float]


class Job(Enum):
    """Requests other than motion; each value is the name of the request in texts for the user."""

    CALIBRATE_GYRO = "gyro calibration"
    CALIBRATE_ACCELEROMETER = "accelerometer calibration"
    SAVE = "saving of the configuration"
    LOAD = "loading of the configuration"
    POWER_OFF = "power off"


@value(frozen=True, slots=True)
class SteeringReading:
    """Angle of the steered wheel in rad, positive to the left."""

    angle_rad: float


@value(frozen=True, slots=True)
class OrientedImuReading:
    """The board's orientation as a quaternion x, y, z, w, with the latest rates and forces.

    Rates are in rad/s, specific forces in m/s².
    """

    orientation: Quaternion
    angular_velocity: Vector3
    specific_force: Vector3


@value(frozen=True, slots=True)
class MagneticReading:
    """Magnetic field in tesla, in the sensor's axes."""

    field_t: Vector3


@value(frozen=True, slots=True)
class BatteryReading:
    """State of the battery.

    ``amps``: current in A, negative while discharging, NaN if unknown. ``cells``: count of cells, 0
    if unknown.
    """

    volts: float
    amps: float
    cells: int
    low: bool


@value(frozen=True, slots=True)
class RangeReading:
    """Distance that a sensor measures; ``distance_m``: infinite if nothing is detected."""

    name: RangeName
    distance_m: float


@dataclass(frozen=True, slots=True)
class JobDone:
    """Result of a job; ``token``: identifies the job for its caller."""

    token: object
    success: bool
    message: str
