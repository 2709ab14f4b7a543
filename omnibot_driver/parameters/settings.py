# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From checked values to what the core is set to: each value under its meaning there."""

from collections.abc import Mapping
from typing import Any

from omnibot_driver.core.board import Vector3
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.stream import CommandSettings
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.imu.bias_correction import ImuCorrection
from omnibot_driver.core.imu.scale import STANDARD_GRAVITY, ImuScale
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.odometry.covariance import OdometryNoise
from omnibot_driver.core.odometry.estimator import OdometrySettings
from omnibot_driver.core.omnibot import OmniBotSettings
from omnibot_driver.core.session import SessionSettings


def board_settings(values: Mapping[str, Any]) -> OmniBotSettings:
    """What the board's translator needs of checked values."""
    return OmniBotSettings(
        baudrate=values["baudrate"],
        linear_scale=values["linear_scale"],
        angular_scale=values["angular_scale"],
        position_scale=values["position_scale"],
        heading_scale=values["heading_scale"],
        wheel_radius_m=values["wheel_radius"],
        base_radius_m=values["base_radius"],
        counts_per_revolution=values["counts_per_revolution"],
        delta_frame=values["delta_frame"],
        delta_period_s=values["delta_period"],
        pose_byte_order=values["pose_byte_order"],
        imu=ImuScale(accel_range_g=values["accel_range"], gyro_range_dps=values["gyro_range"]),
    )


def kinematics(values: Mapping[str, Any]) -> Kinematics:
    """The wheels, by checked values."""
    return OmniKinematics(values["wheel_radius"], values["base_radius"])


def session_settings(values: Mapping[str, Any]) -> SessionSettings:
    """What the session needs of checked values."""
    return SessionSettings(
        limits=SpeedLimits(
            linear_mps=values["max_linear_speed"],
            angular_radps=values["max_angular_speed"],
            wheel_radps=values["max_wheel_speed"],
            linear_mps2=values["max_linear_acceleration"],
            angular_radps2=values["max_angular_acceleration"],
        ),
        commands=CommandSettings(
            timeout_s=values["cmd_vel_timeout"], rate_hz=values["command_rate"]
        ),
        motion_monitor=values["motion_monitor"],
        odometry=OdometrySettings(
            noise=OdometryNoise(
                wheel_drift=values["odom_wheel_drift"],
                wheel_scale=values["odom_wheel_scale"],
                wheel_slip=values["odom_wheel_slip"],
                wheels=OmniKinematics(wheel_radius_m=1.0, base_radius_m=values["base_radius"]),
                unheard_mps2=values["odom_gap_acceleration"],
                unheard_radps2=values["odom_gap_angular_acceleration"],
            ),
            use_board_pose=values["use_board_pose"],
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
            linear_scale=values["odom_linear_scale"],
            angular_scale=values["odom_angular_scale"],
        ),
        motion=MotionLimits(
            fastest_mps=values["fastest_linear_speed"],
            fastest_radps=values["fastest_angular_speed"],
            fastest_mps2=values["fastest_linear_acceleration"],
            fastest_radps2=values["fastest_angular_acceleration"],
            force_step_mps2=values["largest_force_step"],
            full_scale_mps2=values["accel_range"] * STANDARD_GRAVITY,
        ),
        imu=ImuCorrection(
            gyro_bias=_vector(values["gyro_bias"]),
            accel_bias=_vector(values["accel_bias"]),
            auto_gyro_bias=values["auto_gyro_bias"],
        ),
    )


def _vector(numbers: list[float]) -> Vector3:
    x, y, z = numbers
    return x, y, z
