# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Subtraction of the IMU's biases, and the figures of the IMU for the diagnostics."""

from dataclasses import dataclass, replace

from omnibot_driver.core.board import Board
from omnibot_driver.core.imu.gyro_calibration import GyroCalibration
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    OrientedImuReading,
    Vector3,
)
from omnibot_driver.core.reporting.figures import ImuFigures
from omnibot_driver.core.values import value


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuCorrection:
    """Biases of the IMU's readings, which the driver subtracts.

    * ``gyro_bias``: in rad/s.
    * ``accel_bias``: in m/s².
    * ``auto_gyro_bias``: whether to refine the gyro's bias while the robot is at rest.
    """

    gyro_bias: Vector3 = (0.0, 0.0, 0.0)
    accel_bias: Vector3 = (0.0, 0.0, 0.0)
    auto_gyro_bias: bool = False


@value(frozen=True, slots=True)
class ImuEstimate:
    """Specific force in m/s² and angular velocity in rad/s at ``stamp_s``, in the sensor's axes."""

    stamp_s: float
    specific_force: Vector3
    angular_velocity: Vector3


class BiasCorrector:
    """Removes the biases from the IMU's readings.

    ``calibration``: finds the gyro's bias, while the robot is at rest or on request.
    """

    def __init__(self, board: Board, correction: ImuCorrection) -> None:
        self._board = board
        self._correction = correction
        self.calibration = GyroCalibration(correction.gyro_bias, refine=correction.auto_gyro_bias)

    def configure(self, correction: ImuCorrection) -> None:
        """Use new settings, but keep the gyro's bias, which a calibration may have measured."""
        self.calibration.refine = correction.auto_gyro_bias
        self._correction = correction

    def corrected(self, content: object) -> object:
        """Return ``content`` minus the IMU's biases if it is an OrientedImuReading.

        Return any other content as it is.
        """
        if not isinstance(content, OrientedImuReading):
            return content
        (x, y, z), (bias_x, bias_y, bias_z) = content.specific_force, self._correction.accel_bias
        (u, v, w), (bias_u, bias_v, bias_w) = content.angular_velocity, self.calibration.bias
        return replace(
            content,
            specific_force=(x - bias_x, y - bias_y, z - bias_z),
            angular_velocity=(u - bias_u, v - bias_v, w - bias_w),
        )

    def estimate(self, reading: ImuReading, stamp_s: float) -> ImuEstimate:
        """Return the reading minus the biases, and pass the reading to the calibration."""
        (x, y, z), (bias_x, bias_y, bias_z) = reading.specific_force, self._correction.accel_bias
        force = x - bias_x, y - bias_y, z - bias_z
        (u, v, w) = rate = reading.angular_velocity
        self.calibration.hear(rate, force, stamp_s)
        bias_u, bias_v, bias_w = self.calibration.bias
        return ImuEstimate(stamp_s, force, (u - bias_u, v - bias_v, w - bias_w))

    def displaced(self, reading: DisplacementReading) -> None:
        """Pass a displacement of the wheels to the calibration, as evidence of motion or rest."""
        self.calibration.displaced(reading.dx_m, reading.dy_m, reading.dyaw_rad)

    @property
    def advice(self) -> str:
        """Advice on settings, if they contradict the measured gravity; otherwise empty."""
        gravity_mps2 = self.calibration.gravity_mps2
        return "" if gravity_mps2 is None else self._board.gravity_advice(gravity_mps2)

    @property
    def figures(self) -> ImuFigures:
        """The gyro's bias and noise, the measured gravity, and advice on the settings."""
        return ImuFigures(
            bias_radps=self.calibration.bias,
            gravity_mps2=self.calibration.gravity_mps2,
            noise_radps=self.calibration.noise,
            advice=self.advice,
        )
