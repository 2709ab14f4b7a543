# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of the core's session, made from checked parameter values.

If a board does not have a parameter, the setting has a default value.
"""

import math
from collections.abc import Mapping
from typing import Any, Final

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.imu.bias_correction import ImuCorrection
from omnibot_driver.core.imu.scale import STANDARD_GRAVITY
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.odometry.covariance import OdometryNoise
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.settings import SessionSettings

NOISE: Final = OdometryNoise()


def session_settings(values: Mapping[str, Any], wheels: Kinematics) -> SessionSettings:
    """Return the session's settings.

    ``values``: the checked parameter values. ``wheels``: the kinematics of the board's profile.
    """
    return SessionSettings(
        limits=SpeedLimits(
            linear_mps=values.get("max_linear_speed", 0.0),
            angular_radps=values.get("max_angular_speed", 0.0),
            wheel_radps=values.get("max_wheel_speed", 0.0),
            linear_mps2=values.get("max_linear_acceleration", 0.0),
            angular_radps2=values.get("max_angular_acceleration", 0.0),
        ),
        commands=CommandSettings(
            timeout_s=values["cmd_vel_timeout"], rate_hz=values["command_rate"]
        ),
        motion_monitor=values["motion_monitor"],
        odometry=OdometrySettings(
            noise=OdometryNoise(
                wheel_drift=values.get("odom_wheel_drift", NOISE.wheel_drift),
                wheel_scale=values.get("odom_wheel_scale", NOISE.wheel_scale),
                wheel_slip=values.get("odom_wheel_slip", NOISE.wheel_slip),
                wheels=wheels.rims,
                unheard_mps2=values.get("odom_gap_acceleration", NOISE.unheard_mps2),
                unheard_radps2=values.get("odom_gap_angular_acceleration", NOISE.unheard_radps2),
            ),
            use_board_pose=values.get("use_board_pose", True),
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
            linear_scale=values.get("odom_linear_scale", 1.0),
            angular_scale=values.get("odom_angular_scale", 1.0),
        ),
        motion=MotionLimits(
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
            fastest_mps2=values.get("fastest_linear_acceleration", math.inf),
            fastest_radps2=values.get("fastest_angular_acceleration", math.inf),
            force_step_mps2=values.get("largest_force_step", math.inf),
            full_scale_mps2=values.get("accel_range", math.inf) * STANDARD_GRAVITY,
        ),
        imu=_imu(values) if "gyro_bias" in values else ImuCorrection(),
    )


def _imu(values: Mapping[str, Any]) -> ImuCorrection:
    return ImuCorrection(
        gyro_bias=_vector(values["gyro_bias"]),
        accel_bias=_vector(values["accel_bias"]),
        auto_gyro_bias=values["auto_gyro_bias"],
    )


def _vector(numbers: list[float]) -> Vector3:
    x, y, z = numbers
    return x, y, z
