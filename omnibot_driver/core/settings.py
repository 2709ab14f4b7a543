# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings that exist for every board, and can change while a session runs."""

from dataclasses import dataclass, field

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.imu.bias_correction import ImuCorrection
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.odometry.estimate import OdometrySettings


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSettings:
    """The settings of a session. To change one of them, replace the whole object."""

    limits: SpeedLimits
    commands: CommandSettings
    odometry: OdometrySettings
    motion: MotionLimits = field(default_factory=MotionLimits)
    imu: ImuCorrection = field(default_factory=ImuCorrection)
    motion_monitor: bool = True
    """Whether the driver stops a robot that does not move as commanded."""

    @property
    def kinematics(self) -> Kinematics:
        """Geometry of the robot's wheels, but with a wheel radius of 1 m.

        With this radius, a wheel rate in rad/s is also the rim's speed in m/s.
        """
        return self.odometry.noise.wheels
