# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART controller's own parameters, in addition to those of every board.

This module does not use ROS.
"""

from typing import Final

from omnibot_driver.parameters import RANGE_TYPES, Parameter

WHEELS: Final = (
    Parameter(
        "wheel_radius",
        0.0625,
        "m",
        "Radius of a wheel, for joint_states.",
        low=0.001,
        high=1.0,
        calibrated=True,
    ),
    Parameter(
        "track",
        0.40,
        "m",
        "Distance between the wheels.",
        low=0.01,
        high=10.0,
        calibrated=True,
    ),
    Parameter(
        "metres_per_count",
        0.0004,
        "m",
        "Distance that the right wheel rolls for one count of its encoder.",
        low=1e-6,
        high=1.0,
        calibrated=True,
    ),
    Parameter(
        "encoder_inverted",
        False,
        "",
        "Whether the encoder counts down while the robot drives forward.",
        fixed=True,
        calibrated=True,
    ),
)

DRIVING: Final = (
    Parameter(
        "linear_scale",
        128.0,
        "unit/(m/s)",
        "Motor speed, in units of the command RM, at which the robot drives at 1 m/s at"
        " nominal_voltage. The value need not be exact: the driver controls the speed by the"
        " encoder.",
        low=10.0,
        high=10_000.0,
        calibrated=True,
    ),
    Parameter(
        "motor_balance",
        1.0,
        "",
        "Speed of the left motor divided by the speed of the right motor when both receive the"
        " same command. The first drive forward measures this ratio. From then on, the driver"
        " uses the measured ratio and shows it in /diagnostics.",
        low=0.8,
        high=1.25,
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "nominal_voltage",
        24.0,
        "V",
        "Battery voltage at which linear_scale is right; the driver adapts its motor speeds to the"
        " measured voltage.",
        low=6.0,
        high=40.0,
    ),
    Parameter(
        "heading_inverted",
        False,
        "",
        "Whether the controller's relative angle increases when the robot turns right.",
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "network_delay",
        0.3,
        "s",
        "Longest time that a datagram takes in either direction. The network can deliver a second,"
        " late copy of a command. If this copy could disturb the next command, the driver first"
        " waits for this time.",
        low=0.01,
        high=0.3,
    ),
    Parameter(
        "spin_speed",
        "custom",
        "",
        "Speed of turns on the spot. custom: the commanded speed, set with the undocumented"
        " commands SSP and R CUSTOM; fixed: the controller's own speed SLOW (faster than most"
        " commanded speeds). Set fixed for a server without SSP.",
        choices=("custom", "fixed"),
        fixed=True,
    ),
    Parameter(
        "allow_reverse_goals",
        False,
        "",
        "Let cmd_pose drive backward to a goal behind the robot instead of turning to it.",
    ),
    Parameter(
        "dock_distance",
        0.5,
        "m",
        "Largest distance that ~/dock drives.",
        low=0.05,
        high=5.0,
    ),
    Parameter(
        "odom_rate",
        20.0,
        "Hz",
        "How often odom and its transform are published. Between two polls of the"
        " controller, the driver predicts them.",
        low=1.0,
        high=50.0,
    ),
    Parameter(
        "set_host_time",
        True,
        "",
        "Set the controller's clock to this computer's time (UTC) once, at standstill.",
        fixed=True,
    ),
    Parameter(
        "gyro_drift",
        0.001,
        "rad/s",
        "Bias of the controller's gyro that remains after a calibration, for the covariance of"
        " odom.",
        low=0.0,
        high=0.1,
    ),
)

SENSORS: Final = (
    Parameter(
        "range_type",
        "ultrasound",
        "",
        "Sensor type of both sonars, reported in range/front and range/rear.",
        choices=RANGE_TYPES,
    ),
    Parameter(
        "range_field_of_view",
        0.5,
        "rad",
        "Field of view of both sonars.",
        low=0.01,
        high=3.0,
    ),
    Parameter(
        "range_minimum", 0.15, "m", "Smallest distance that a sonar measures.", low=0.0, high=5.0
    ),
    Parameter(
        "range_maximum",
        6.45,
        "m",
        "Largest distance that a sonar measures (254 inches).",
        low=0.1,
        high=20.0,
    ),
    Parameter(
        "record_directory",
        "~/.ros/mart_records",
        "",
        "Folder in which the driver saves downloads.",
        fixed=True,
    ),
)
