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
    """The board's own pose in its earth frame, as in the 5 Hz pose frame. The yaw is unwrapped."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    theta_mrad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardSettings:
    """Properties of a simulated board, and deviations of its robot from the ideal.

    seed: seed of all random numbers. Two boards with equal settings and input send equal bytes.
    frame: meaning of the 25 Hz frame (delta). "earth": the difference of two positions in the
    board's earth frame. "body": the sum of each control tick's displacement in the robot's frame.
    "wheel_counts": the encoder counts of wheels A, B, C (manual, Deprecated). delta_period_s:
    period of the 25 Hz frame, in s: a multiple of the tick of 10 ms. The manual also has 10 Hz.
    imu_only: whether the board runs in IMU only mode instead of nominal mode. linear_scale: LSB per
    m/s, of Vx and Vy, and of the rim speeds in wheel mode. angular_scale: LSB per rad/s, of Omega.
    control: position of the on-board switch. With this switch, base vector control commands either
    a velocity, or a goal pose in the board's own earth frame. position_scale: LSB per m, of X and
    Y. heading_scale: LSB per rad, of theta, which is unwrapped as in the 5 Hz frame. receiver: how
    the firmware finds commands among the bytes. obeys_estop: whether an emergency stop frame stops
    the robot. If not, it is ignored. estop_latches: whether the board refuses all motion after an
    emergency stop frame until a reset. If not, the next motion command moves the robot again.
    pose_byte_order: byte order of the three floats of the 5 Hz frame. axis_signs: signs of the
    board's x, y and yaw relative to the robot's (forward, left, counter-clockwise). wheel_gains:
    gains of the firmware's three speed controllers. motors: properties of the motors of wheels A,
    B, C. motor_wiring: for each controller, the motor that it drives, 1 to 3 for wheels A to C. The
    number is negative if the two poles of the motor are swapped. The encoders are not affected.
    wheel_radius_m, base_radius_m, counts_per_revolution: values that the firmware assumes (manual,
    Vehicle Parameters). wheel_radius_scale: true radius of wheels A, B, C divided by
    ``wheel_radius_m``. base_radius_scale: true distance of the wheels from the centre divided by
    ``base_radius_m``. slip: mean fraction of each wheel's rim motion that is lost on the floor. The
    actual fraction varies around this mean, independently for each wheel. slope_pwm: force with
    which a sloping floor pulls the robot, in PWM steps: the motor effort at the rim that equals
    this force. The force is along the x axis that the robot had at construction. imu_rpy_rad:
    mounting of the IMU. Roll, pitch and yaw about fixed axes turn the body's axes into the sensor's
    axes, as in a URDF. gyro_bias_dps, gyro_noise_dps: in the sensor's axes, in °/s. The noise is
    rms per reading. gyro_walk_dps: rms change of the gyro bias within 1 s, in °/s. The change grows
    with the square root of time. accel_bias_g, accel_noise_g: in the sensor's axes, in g. The noise
    is rms per reading. gyro_stuck: raw counts that the gyro always reads, whatever the motion; None
    if the gyro works. boot_time_s: time from power-up or reset until the board is paused. Until
    then the board sends and obeys nothing. initial_pose: the board's own pose at construction, for
    a board that has already driven. running: whether the board is awake and in its running mode at
    construction.
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
