# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parameters of what is driven, whatever its board: the robot, its IMU, how sure they measure.

Which of them a board has is in ``table``. Knows no ROS.
"""

from typing import Final

from omnibot_driver.parameters.parameter import Parameter

ROBOT: Final = (
    Parameter(
        "axis_signs",
        [1, 1, 1],
        "",
        "For x, y and yaw: -1 turns the board's axis round, in commands and in odometry.",
        choices=(1, -1),
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "odom_linear_scale",
        1.0,
        "m/m",
        "True distance divided by the distance that the board reports (it assumes nominal wheels);"
        " calibrate geometry finds it.",
        low=0.5,
        high=2.0,
        calibrated=True,
    ),
    Parameter(
        "odom_angular_scale",
        1.0,
        "rad/rad",
        "The same for turning.",
        low=0.5,
        high=2.0,
        calibrated=True,
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
        "The same for turning. It must not be below max_angular_speed.",
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
        "The same for turning, and for single spikes of the gyro.",
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
    Parameter(
        "calibration_file",
        "",
        "",
        "YAML file that calibrations write; what they found replaces what is given here"
        " (docs/tools/calibrate.md).",
        fixed=True,
    ),
)

IMU: Final = (
    Parameter(
        "gyro_bias",
        [0.0, 0.0, 0.0],
        "rad/s",
        "What the gyro reads at rest, in its own axes; taken off. The service ~/calibrate_gyro"
        " finds it.",
        low=-1.0,
        high=1.0,
        calibrated=True,
    ),
    Parameter(
        "accel_bias",
        [0.0, 0.0, 0.0],
        "m/s²",
        "What the accelerometer reads too much, in its own axes; taken off.",
        low=-5.0,
        high=5.0,
        calibrated=True,
    ),
    Parameter(
        "auto_gyro_bias",
        False,
        "",
        "Refine the gyro's bias slowly whenever the robot stands still. Do not use it on what turns"
        " itself (ship, turntable).",
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
        calibrated=True,
    ),
    Parameter(
        "angular_velocity_stddev",
        0.00087,
        "rad/s",
        "Noise of one gyro sample (0.05 °/s rms), for the covariance.",
        low=1e-6,
        high=100.0,
        calibrated=True,
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
        "The same for turning.",
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
