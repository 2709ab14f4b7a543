# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The OmniBot's own parameters, in addition to those of every board.

This module does not use ROS.
"""

from collections.abc import Mapping
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.imu.scale import ACCEL_COUNTS_PER_G, GYRO_COUNTS_PER_DPS
from omnibot_driver.core.omnibot.schedule import DELTA_PERIODS_S
from omnibot_driver.parameters import Parameter

OMNIBOT: Final = (
    Parameter(
        "control_method",
        "velocity",
        "",
        "Setting of the control switch on the board: velocity (for cmd_vel and wheel_cmd) or"
        " position (for cmd_pose).",
        choices=("velocity", "position"),
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "linear_scale",
        70.0,
        "LSB/(m/s)",
        "Command value, in units of the board (LSB), for 1 m/s. In cmd_vel, this is the speed of"
        " the robot. In wheel_cmd, it is the speed of a wheel's rim.",
        low=1.0,
        high=10_000.0,
        calibrated=True,
    ),
    Parameter(
        "angular_scale",
        500.0,
        "LSB/(rad/s)",
        "Command value, in units of the board (LSB), for a yaw rate of 1 rad/s.",
        low=1.0,
        high=100_000.0,
        calibrated=True,
    ),
    Parameter(
        "position_scale",
        1000.0,
        "LSB/m",
        "Command value, in units of the board (LSB), for a position of 1 m.",
        low=1.0,
        high=100_000.0,
    ),
    Parameter(
        "heading_scale",
        1000.0,
        "LSB/rad",
        "Command value, in units of the board (LSB), for a heading of 1 rad.",
        low=1.0,
        high=100_000.0,
    ),
    Parameter(
        "delta_frame",
        "earth",
        "",
        "Meaning of the board's odometry deltas: earth (differences of two positions in the"
        " board's earth frame), body (motion along the board's own axes) or wheel_counts (encoder"
        " counts of its wheels, in older firmware).",
        choices=("earth", "body", "wheel_counts"),
        fixed=True,
        calibrated=True,
    ),
    Parameter(
        "delta_period",
        0.04,
        "s",
        "Period of the board's odometry deltas. The manual says 25 Hz in one place and 10 Hz in"
        " another. The driver warns if the board uses another period.",
        choices=DELTA_PERIODS_S,
        fixed=True,
    ),
    Parameter(
        "use_board_pose",
        True,
        "",
        "Correct the odometry with the board's own pose. If false, the driver uses that pose only"
        " for the first heading of odom, and to detect a restart of the board.",
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
        calibrated=True,
    ),
    Parameter(
        "base_radius",
        0.143,
        "m",
        "Distance from the centre of the robot to a wheel, for odometry from wheel counts and"
        " for the covariance.",
        low=0.01,
        high=10.0,
        calibrated=True,
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
        "accel_range",
        2,
        "g",
        "Full scale of the accelerometer.",
        choices=tuple(ACCEL_COUNTS_PER_G),
        fixed=True,
    ),
    Parameter(
        "gyro_range",
        250,
        "°/s",
        "Full scale of the gyro.",
        choices=tuple(GYRO_COUNTS_PER_DPS),
        fixed=True,
    ),
)


def require_a_frame_for_goals(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if goal poses are used, but the axis signs do not permit them.

    With such signs, the board's axes are a mirror image of the robot's axes.
    """
    x, y, yaw = values["axis_signs"]
    if values["control_method"] == "position" and x * y != yaw:
        raise ParameterError(
            f"parameter 'axis_signs' must not be {values['axis_signs']} with control_method"
            " 'position': the sign of yaw must be the product of the signs of x and y"
        )
