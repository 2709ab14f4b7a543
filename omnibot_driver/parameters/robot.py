# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Common parameters of the robot, of its IMU, and of the noise of its measurements.

The module ``table`` selects the parameters that a board has. This module does not use ROS.
"""

from typing import Final

from omnibot_driver.parameters.parameter import Parameter

ROBOT: Final = (
    Parameter(
        "axis_signs",
        [1, 1, 1],
        "",
        "Signs of x, y and yaw. -1 reverses the board's axis, in commands and in odometry.",
        choices=(1, -1),
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "odom_linear_scale",
        1.0,
        "m/m",
        "Ratio of the true distance to the distance in odom, measured with this parameter at 1."
        " The driver multiplies measured distances by this ratio. The command `calibrate geometry`"
        " measures the ratio.",
        low=0.5,
        high=2.0,
        calibrated=True,
    ),
    Parameter(
        "odom_angular_scale",
        1.0,
        "rad/rad",
        "Ratio of the true angle of a turn to the angle in odom, measured with this parameter at"
        " 1. The driver multiplies measured angles by this ratio. The command `calibrate geometry`"
        " measures the ratio.",
        low=0.5,
        high=2.0,
        calibrated=True,
    ),
    Parameter(
        "fastest_linear_speed",
        2.0,
        "m/s",
        "Highest linear speed that the robot can reach, even if it is pushed. The driver rejects"
        " faster displacements. Corrections never move odom faster than this speed. The value must"
        " not be below max_linear_speed.",
        low=0.1,
        high=10.0,
    ),
    Parameter(
        "fastest_angular_speed",
        8.0,
        "rad/s",
        "Highest yaw rate that the robot can reach, even if it is pushed. The driver rejects"
        " faster displacements. The value must not be below max_angular_speed.",
        low=0.1,
        high=100.0,
    ),
    Parameter(
        "fastest_linear_acceleration",
        15.0,
        "m/s²",
        "Highest linear acceleration that the robot can reach, even in a collision. The driver"
        " rejects a displacement if it jumps by more than this acceleration permits and the next"
        " displacement is back at the old value. docs/internals/architecture.md has the exact rule"
        " (Implausible readings).",
        low=0.1,
        high=1000.0,
    ),
    Parameter(
        "fastest_angular_acceleration",
        50.0,
        "rad/s²",
        "Highest angular acceleration that the robot can reach, even in a collision. The driver"
        " rejects a displacement or a gyro reading if it jumps by more than this acceleration"
        " permits and the next displacement or reading is back at the old value."
        " docs/internals/architecture.md has the exact rule (Implausible readings).",
        low=1.0,
        high=10_000.0,
    ),
    Parameter(
        "largest_force_step",
        4.0,
        "m/s²",
        "Largest change of an accelerometer axis from one reading to the next that the driver"
        " always accepts. The driver rejects a larger change only under two conditions: a flipped"
        " bit can explain it, and the next reading is back at the old value."
        " docs/internals/architecture.md has the exact rule (Implausible readings).",
        low=0.1,
        high=1000.0,
    ),
    Parameter(
        "calibration_file",
        "",
        "",
        "YAML file that calibrations write. Its values replace the parameters that you give at"
        " start (docs/tools/calibrate.md).",
        fixed=True,
    ),
)

IMU: Final = (
    Parameter(
        "gyro_bias",
        [0.0, 0.0, 0.0],
        "rad/s",
        "Reading of the gyro at rest, in its own axes. The driver subtracts it. ~/calibrate_gyro"
        " measures it.",
        low=-1.0,
        high=1.0,
        calibrated=True,
    ),
    Parameter(
        "accel_bias",
        [0.0, 0.0, 0.0],
        "m/s²",
        "Offset of the accelerometer, in its own axes. The driver subtracts it.",
        low=-5.0,
        high=5.0,
        calibrated=True,
    ),
    Parameter(
        "auto_gyro_bias",
        False,
        "",
        "Refine the gyro's bias slowly while the robot stands still. Leave this off on a moving"
        " base (ship, turntable).",
    ),
)

NOISE: Final = (
    Parameter(
        "linear_acceleration_stddev",
        0.028,
        "m/s²",
        "Standard deviation of one accelerometer sample (400 µg/√Hz over 50 Hz), for the"
        " covariance.",
        low=1e-6,
        high=100.0,
        calibrated=True,
    ),
    Parameter(
        "angular_velocity_stddev",
        0.00087,
        "rad/s",
        "Standard deviation of one gyro sample, for the covariance. The default is 0.05 °/s.",
        low=1e-6,
        high=100.0,
        calibrated=True,
    ),
    Parameter(
        "odom_wheel_drift",
        0.0035,
        "m/√m",
        "Standard deviation of the error of a wheel's distance after 1 m. This deviation grows"
        " with the square root of the distance.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "odom_wheel_scale",
        0.01,
        "m/m",
        "Standard deviation of a wheel's relative size error. The error is constant, so its"
        " effect grows in proportion to the distance driven.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_wheel_slip",
        0.02,
        "m/m",
        "Mean slip of the wheels, as a fraction of the distance driven. All wheels slip by this"
        " fraction, all the time.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_gap_acceleration",
        1.0,
        "m/s²",
        "Largest linear acceleration that the driver assumes while odometry frames are missing."
        " It limits no motion: it sets how uncertain the odometry is after a gap.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "odom_gap_angular_acceleration",
        5.0,
        "rad/s²",
        "Largest angular acceleration that the driver assumes while odometry frames are missing."
        " It limits no motion: it sets how uncertain the odometry is after a gap.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "twist_linear_stddev",
        0.02,
        "m/s",
        "Standard deviation of the measured linear velocity, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "twist_angular_stddev",
        0.025,
        "rad/s",
        "Standard deviation of the measured yaw rate, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
)
