# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings and results that only a Fejemis has, in SI units.

An ``ExtraReading`` carries each of them to the node.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.requests import RequestDone
from omnibot_driver.core.values import value

RangeName = Literal["tof", "sonar", "ir1", "ir2"]


class Job(Enum):
    """A request of the user that takes some time. Its result is a JobDone.

    The value of each job is its name in service answers.
    """

    CALIBRATE_GYRO = "gyro calibration"
    CALIBRATE_ACCELEROMETER = "accelerometer calibration"
    SAVE = "saving of the configuration"
    LOAD = "loading of the configuration"
    POWER_OFF = "power-off"


@value(frozen=True, slots=True)
class SteeringReading:
    """Angle of the steered wheel in rad, positive to the left."""

    angle_rad: float


@value(frozen=True, slots=True)
class MagneticReading:
    """Magnetic field in tesla, in the sensor's axes."""

    field_t: Vector3


@value(frozen=True, slots=True)
class BatteryReading:
    """State of the battery.

    * ``amps``: current in A, negative during discharge; NaN if unknown.
    * ``cells``: number of cells; 0 if unknown.
    * ``low``: whether the mean voltage of a cell is below the limit in the settings.
    """

    volts: float
    amps: float
    cells: int
    low: bool


@value(frozen=True, slots=True)
class RangeReading:
    """Distance that a sensor measures.

    ``distance_m``: infinity if the sensor detects nothing.
    """

    name: RangeName
    distance_m: float


@dataclass(frozen=True, slots=True)
class JobDone(RequestDone):
    """Result of a job.

    ``token``: the object by which the caller identifies the job.
    """
