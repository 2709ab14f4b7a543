# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parameters of what is driven: the robot, its board, its IMU, and how sure they measure."""

from typing import Final

from omnibot_driver.core.imu.scale import ACCEL_COUNTS_PER_G, GYRO_COUNTS_PER_DPS
from omnibot_driver.core.omnibot.schedule import DELTA_PERIODS_S
from omnibot_driver.parameters.parameter import Parameter

ROBOT: Final = (
    Parameter(
        "axis_signs",
        [1, 1, 1],
        "",
        "1 or -1 for x, y and yaw, applied to commands and to odometry.",
        fixed=True,
    ),
    Parameter(
        "delta_frame",
        "earth",
        "",
        "What the board's odometry deltas are: differences of two positions in its earth frame,"
        " motion along its own axes, or (older firmware) counts of its wheels.",
        choices=("earth", "body", "wheel_counts"),
        fixed=True,
    ),
    Parameter(
        "delta_period",
        0.04,
        "s",
        "Time from one of the board's odometry deltas to the next. The manual has 25 Hz in one"
        " place, 10 Hz in another; the driver says so if the board keeps to another.",
        choices=DELTA_PERIODS_S,
        fixed=True,
    ),
    Parameter(
        "use_board_pose",
        True,
        "",
        "Let the board's own pose settle lost motion and rounding; otherwise only its first"
        " heading is taken.",
    ),
    Parameter(
        "pose_byte_order",
        "big",
        "",
        "Byte order of the floats in the board's pose.",
        choices=("big", "little"),
        fixed=True,
    ),
    Parameter(
        "wheel_radius",
        0.029,
        "m",
        "Radius of a wheel, for wheel_cmd and for odometry from wheel counts.",
        low=0.001,
        high=1.0,
    ),
    Parameter(
        "base_radius",
        0.143,
        "m",
        "From the centre of the robot to a wheel, for odometry from wheel counts and covariance.",
        low=0.01,
        high=10.0,
    ),
    Parameter(
        "counts_per_revolution",
        1560,
        "counts",
        "Encoder counts of one turn of a wheel, for odometry from wheel counts.",
        low=1,
        high=1_000_000,
    ),
    Parameter(
        "odom_linear_scale",
        1.0,
        "m/m",
        "True distance divided by the distance that the board reports (it assumes nominal wheels);"
        " calibrate geometry finds it.",
        low=0.5,
        high=2.0,
    ),
    Parameter(
        "odom_angular_scale",
        1.0,
        "rad/rad",
        "Likewise, for turning.",
        low=0.5,
        high=2.0,
    ),
    Parameter(
        "fastest_linear_speed",
        2.0,
        "m/s",
        "What the robot can never exceed, pushed by hand too: no faster displacement and no pose"
        " further away is believed, no correction of odom is faster. It must not be below"
        " max_linear_speed.",
        low=0.1,
        high=10.0,
    ),
    Parameter(
        "fastest_angular_speed",
        8.0,
        "rad/s",
        "Likewise, for turning. It must not be below max_angular_speed.",
        low=0.1,
        high=100.0,
    ),
    Parameter(
        "fastest_linear_acceleration",
        15.0,
        "m/s²",
        "What the robot can never exceed, bumped too: a displacement that leaps further and is back"
        " with the next is refused.",
        low=0.1,
        high=1000.0,
    ),
    Parameter(
        "fastest_angular_acceleration",
        50.0,
        "rad/s²",
        "Likewise, for turning; for single leaps of the gyro too.",
        low=1.0,
        high=10_000.0,
    ),
    Parameter(
        "largest_force_step",
        4.0,
        "m/s²",
        "A single leap of one axis of the accelerometer that is larger, of the size of a changed"
        " bit, and back with the next reading, is refused.",
        low=0.1,
        high=1000.0,
    ),
)

IMU: Final = (
    Parameter(
        "accel_range",
        2,
        "g",
        "Full scale that the accelerometer is set to.",
        choices=tuple(ACCEL_COUNTS_PER_G),
        fixed=True,
    ),
    Parameter(
        "gyro_range",
        250,
        "°/s",
        "Full scale that the gyro is set to.",
        choices=tuple(GYRO_COUNTS_PER_DPS),
        fixed=True,
    ),
    Parameter(
        "gyro_bias",
        [0.0, 0.0, 0.0],
        "rad/s",
        "What the gyro reads at rest, in its own axes; taken off. The service ~/calibrate_gyro"
        " finds it.",
        low=-1.0,
        high=1.0,
    ),
    Parameter(
        "accel_bias",
        [0.0, 0.0, 0.0],
        "m/s²",
        "What the accelerometer reads too much, in its own axes; taken off.",
        low=-5.0,
        high=5.0,
    ),
    Parameter(
        "auto_gyro_bias",
        False,
        "",
        "Refine the gyro's bias slowly whenever the robot stands still. Do not use it on what turns"
        " itself (ship, turntable).",
    ),
    Parameter(
        "calibration_file",
        "",
        "",
        "YAML file that ~/calibrate_gyro and the tool calibrate write; what they found replaces"
        " what is given here (docs/calibrate.md).",
        fixed=True,
    ),
)

NOISE: Final = (
    Parameter(
        "linear_acceleration_stddev",
        0.028,
        "m/s²",
        "Noise of one accelerometer sample (400 µg/√Hz over 50 Hz), for the covariance.",
        low=1e-6,
        high=100.0,
    ),
    Parameter(
        "angular_velocity_stddev",
        0.00087,
        "rad/s",
        "Noise of one gyro sample (0.05 °/s rms), for the covariance.",
        low=1e-6,
        high=100.0,
    ),
    Parameter(
        "odom_wheel_drift",
        0.0035,
        "m/√m",
        "Standard deviation of a wheel's way after 1 m; it grows with the root of the way.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "odom_wheel_scale",
        0.01,
        "m/m",
        "Standard deviation of a wheel's relative size error; it counts for the whole way.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_wheel_slip",
        0.02,
        "m/m",
        "Mean part of the way that slip takes from all wheels alike; it counts for the whole way.",
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "odom_gap_acceleration",
        1.0,
        "m/s²",
        "How hard the robot may speed up and brake while its odometry frames are lost.",
        low=0.0,
        high=100.0,
    ),
    Parameter(
        "odom_gap_angular_acceleration",
        5.0,
        "rad/s²",
        "Likewise, for turning.",
        low=0.0,
        high=1000.0,
    ),
    Parameter(
        "twist_linear_stddev",
        0.02,
        "m/s",
        "Noise of the measured linear velocity, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "twist_angular_stddev",
        0.025,
        "rad/s",
        "Noise of the measured yaw rate, for the covariance.",
        low=1e-6,
        high=10.0,
    ),
)
