# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of a simulated board and its robot: values only, no behaviour."""

from dataclasses import dataclass
from math import pi
from typing import Literal

from omnibot_driver.simulator.omnibot.motors import MANUAL, USUAL, MotorConstants, WheelGains
from omnibot_driver.simulator.omnibot.receivers import COUNTING, ReceiverKind
from omnibot_driver.simulator.omnibot.wire import ByteOrder, Triple

DeltaFrameMeaning = Literal["earth", "body", "wheel_counts"]
ControlMethod = Literal["velocity", "position"]


@dataclass(frozen=True, slots=True)
class BoardPose:
    """The board's own pose in its earth frame, as sent at 5 Hz. The yaw is unwrapped."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    theta_mrad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardSettings:
    """Properties of a simulated board, and deviations of its robot from the ideal.

    * ``frame``: content of the 25 Hz message: "earth" (difference of positions in the board's earth
      frame), "body" (sum of the ticks' displacements) or "wheel_counts" (manual, Deprecated).
    * ``delta_period_s``: period of the 25 Hz message, a multiple of 10 ms. The manual also states
      0.1 s.
    * ``linear_scale``: LSB per m/s of Vx, Vy and rim speeds.
    * ``angular_scale``: LSB per rad/s.
    * ``control``: the on-board switch: commands are velocities, or poses in the earth frame.
    * ``position_scale``: LSB per m.
    * ``heading_scale``: LSB per rad of an unwrapped heading.
    * ``estop_latches``: whether an emergency stop lasts until a reset; otherwise, it lasts until
      the next motion command.
    * ``axis_signs``: signs of the board's x, y and yaw relative to REP-103.
    * ``motor_wiring``: for each controller, the number of its motor, 1 to 3; negative if the
      motor's poles, but not its encoder, are swapped.
    * ``wheel_radius_m``, ``base_radius_m``, ``counts_per_revolution``: assumed by the firmware.
    * ``wheel_radius_scale``, ``base_radius_scale``: true value divided by the assumed one.
    * ``slip``: mean fraction of the rim motion that is lost. The slip of each wheel varies.
    * ``slope_pwm``: pull of a slope along the initial x axis, in PWM steps.
    * ``imu_rpy_rad``: orientation of the sensor in the body, as roll, pitch and yaw in a URDF.
    * ``gyro_noise_dps``, ``accel_noise_g``: rms per reading, in the sensor's axes.
    * ``gyro_walk_dps``: rms change of the bias in 1 s; grows with the square root of time.
    * ``gyro_stuck``: raw counts that a broken gyro always reads.
    * ``boot_time_s``: duration of the boot, in which the board sends and obeys nothing.
    * ``running``: whether the board is awake and in its running mode at construction.
    """

    seed: int = 0
    frame: DeltaFrameMeaning = "earth"
    delta_period_s: float = 0.04
    imu_only: bool = False
    linear_scale: float = 70.0
    angular_scale: float = 500.0
    control: ControlMethod = "velocity"
    position_scale: float = 1000.0
    heading_scale: float = 1000.0
    receiver: ReceiverKind = COUNTING
    obeys_estop: bool = True
    estop_latches: bool = False
    pose_byte_order: ByteOrder = "big"
    axis_signs: tuple[int, int, int] = (1, 1, 1)
    wheel_gains: WheelGains = MANUAL
    motors: tuple[MotorConstants, MotorConstants, MotorConstants] = (USUAL, USUAL, USUAL)
    motor_wiring: tuple[int, int, int] = (1, 2, 3)
    wheel_radius_m: float = 0.029
    base_radius_m: float = 0.143
    counts_per_revolution: int = 390 * 4
    wheel_radius_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    base_radius_scale: float = 1.0
    slip: float = 0.0
    slope_pwm: float = 0.0
    imu_rpy_rad: tuple[float, float, float] = (pi, 0.0, 0.0)
    gyro_bias_dps: tuple[float, float, float] = (-0.046, -0.038, -0.031)
    gyro_noise_dps: float = 0.05
    gyro_walk_dps: float = 0.0
    accel_bias_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accel_noise_g: float = 0.0028
    gyro_stuck: Triple | None = None
    boot_time_s: float = 0.3
    initial_pose: BoardPose = BoardPose()
    running: bool = False

    @property
    def rim_m_per_count(self) -> float:
        """Rim distance per encoder count that the firmware assumes, in m (manual: 2πr/N)."""
        return 2 * pi * self.wheel_radius_m / self.counts_per_revolution
