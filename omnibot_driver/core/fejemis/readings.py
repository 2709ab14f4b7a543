# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What only a Fejemis measures or answers, in SI units: values only. Each comes as an Extra."""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.values import value

RangeName = Literal["tof", "sonar", "ir1", "ir2"]
Quaternion = tuple[float, float, float, float]


class Job(Enum):
    """What can be asked besides motion; the value reads well in a sentence."""

    CALIBRATE_GYRO = "gyro calibration"
    CALIBRATE_ACCELEROMETER = "accelerometer calibration"
    SAVE = "saving of the configuration"
    LOAD = "loading of the configuration"
    POWER_OFF = "power off"


@value(frozen=True, slots=True)
class SteeringReading:
    """Angle of the steered wheel, positive to the left."""

    angle_rad: float


@value(frozen=True, slots=True)
class OrientedImuReading:
    """The board's orientation as a quaternion x, y, z, w, with the latest rates and forces."""

    orientation: Quaternion
    angular_velocity: Vector3
    specific_force: Vector3


@value(frozen=True, slots=True)
class MagneticReading:
    """In tesla, in the sensor's axes."""

    field_t: Vector3


@value(frozen=True, slots=True)
class BatteryReading:
    """``amps``: negative while it is discharged; NaN where unknown. ``cells``: 0 where unknown."""

    volts: float
    amps: float
    cells: int
    low: bool


@value(frozen=True, slots=True)
class RangeReading:
    """``distance_m`` is infinite where nothing is seen."""

    name: RangeName
    distance_m: float


@dataclass(frozen=True, slots=True)
class JobDone:
    """What came of a job; ``token`` is what the asker handed in."""

    token: object
    success: bool
    message: str
