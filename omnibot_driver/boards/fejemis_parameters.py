# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The parameters that only a Fejemis has. This module must not use ROS.

A parameter whose value the boards store is unset by default; the driver then writes no value.
"""

import math
from typing import Final

from omnibot_driver.parameters import RANGE_TYPES, Parameter

MOST_GAINS: Final = 17
"""Largest number of values in ``steering_gains``: the board's answer ``cpsteer`` has 17 values."""

FRONT_PORT: Final = (
    Parameter(
        "front_port",
        "/dev/ttyACM1",
        "",
        "Serial device of the front board; port is the device of the drive board. If the two"
        " devices are swapped, the driver detects this from the heartbeats. Not used if port is"
        " sim:// or replay://.",
        fixed=True,
    ),
)

WHEELS: Final = (
    Parameter(
        "wheel_radii",
        [0.0775, 0.0775],
        "m",
        "Radius of the left and the right driving wheel. The driver writes the radii,"
        " `gear`, encoder_ticks and `track` to the drive board, with the command `confw`. Unset:"
        " the board keeps its own values.",
        low=0.001,
        high=1.0,
        unset=True,
    ),
    Parameter(
        "gear",
        19.0,
        "",
        "Turns of the motor for one turn of a driving wheel. The driver writes the value with"
        " the command `confw`. Unset: the board keeps its own value.",
        low=1.0,
        high=1000.0,
        unset=True,
    ),
    Parameter(
        "encoder_ticks",
        68,
        "ticks",
        "Encoder ticks of one turn of the motor. The driver writes the value with the command"
        " `confw`. Unset: the board keeps its own value.",
        low=1,
        high=100_000,
        unset=True,
    ),
    Parameter(
        "track",
        0.4,
        "m",
        "Distance between the driving wheels. The manual calls it B. The driver writes it with"
        " the commands `confw` and `confs`. Unset: the boards keep their own values.",
        low=0.01,
        high=10.0,
        unset=True,
    ),
    Parameter(
        "steering_distance",
        0.42,
        "m",
        "Distance from the axle of the driving wheels to the steered wheel. The manual calls it"
        " F or S. The driver writes it and `track` to both boards, with the command `confs`."
        " Unset: the boards keep their own values.",
        low=0.01,
        high=10.0,
        unset=True,
    ),
    Parameter(
        "front_wheel_offset",
        0.0,
        "rad",
        "Reading of the angle sensor when the front wheel is straight. The driver writes it and"
        " front_wheel_inverted to the front board, with the command `fwoffset`. Unset: the board"
        " keeps its own value.",
        low=-math.pi,
        high=math.pi,
        unset=True,
    ),
    Parameter(
        "front_wheel_inverted",
        False,
        "",
        "True if the angle sensor gives a positive reading when the front wheel is turned to the"
        " right. The driver writes the value with the command `fwoffset`. Unset: the board keeps"
        " its own value.",
        unset=True,
    ),
    Parameter(
        "steering_gains",
        [1.0],
        "",
        "Values of the steering controller, in the order of the board's command `cssteer`."
        " Proportional part: use, Kp. Integral part: useI, taui, ilimit, then always 1. Lead"
        " filter: useLeadf, tz, tp. Second lead filter: useLeadb, tz, tp. Prefilter: usePre, tz,"
        " tp. Output limit: useULim, Ulim. Unset: the board keeps its own values.",
        length=(1, MOST_GAINS),
        low=-1e6,
        high=1e6,
        unset=True,
    ),
)

DRIVING: Final = (
    Parameter(
        "allow_reverse",
        False,
        "",
        "Send negative speeds to the board. The manual does not say how the board steers at a"
        " negative speed. So test it first with the wheels off the ground"
        " (docs/boards/fejemis.md).",
    ),
    Parameter(
        "line_sums",
        "auto",
        "",
        "Whether each line to and from the boards begins with a checksum (;NN). auto: if the"
        " board's heartbeats begin with one; on: always; off: never.",
        choices=("auto", "on", "off"),
        fixed=True,
    ),
    Parameter(
        "power_off_delay",
        10.0,
        "s",
        "Time from ~/power_off until the board cuts the power. This computer loses power too if"
        " the board supplies it. The driver sends whole seconds. It increases some times (131 s"
        " instead of 120 s), because otherwise a command that lost two digits on the line could"
        " set another time. The answer of ~/power_off states the time in use.",
        low=1.0,
        high=3600.0,
    ),
    Parameter(
        "low_cell_voltage",
        3.5,
        "V",
        "Voltage of a battery cell below which the driver warns.",
        low=1.0,
        high=5.0,
    ),
)

SENSORS: Final = (
    Parameter(
        "acceleration_unit",
        "m/s^2",
        "",
        "Unit of the accelerations that the board sends (`acc`). Some firmware sends g.",
        choices=("m/s^2", "g"),
        fixed=True,
    ),
    Parameter(
        "ir_calibration",
        [46000.0, 14000.0, 46000.0, 14000.0],
        "",
        "Raw readings of infrared sensor 1 at 13 cm and at 50 cm, then those of sensor 2. The"
        " driver writes them with the command `irc`. Unset: the board keeps its own values.",
        low=0.0,
        high=1e6,
        unset=True,
    ),
    Parameter(
        "mag_calibration",
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "µT",
        "Offsets of the magnetometer's three axes, then the rows of its 3 x 3 matrix of rotation"
        " and scale. The driver writes them with the command `magcal`. Unset: the board keeps"
        " its own values.",
        low=-1e4,
        high=1e4,
        unset=True,
    ),
    Parameter(
        "accel_calibration",
        [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        "m/s²",
        "Offsets of the accelerometer's three axes, then their scales. The driver writes them"
        " with the command `acccal`. Unset: the board keeps its own values.",
        low=-100.0,
        high=100.0,
        unset=True,
    ),
    Parameter(
        "orientation_stddev",
        [0.02, 0.02, 0.2],
        "rad",
        "Standard deviation of roll, pitch and yaw in imu/data. The yaw needs a larger value: a"
        " gyro bias makes it drift.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "magnetic_field_stddev",
        1e-6,
        "T",
        "Standard deviation of the magnetometer's noise, for the covariance of imu/mag.",
        low=1e-12,
        high=1.0,
    ),
    Parameter(
        "tof_type",
        "infrared",
        "",
        "Type of the time-of-flight sensor in range/tof.",
        choices=RANGE_TYPES,
    ),
    Parameter(
        "tof_field_of_view",
        0.44,
        "rad",
        "Field of view of the time-of-flight sensor.",
        low=0.01,
        high=3.0,
    ),
    Parameter(
        "tof_minimum",
        0.03,
        "m",
        "Smallest distance that the time-of-flight sensor measures.",
        low=0.0,
        high=20.0,
    ),
    Parameter(
        "tof_maximum",
        2.0,
        "m",
        "Largest distance that the time-of-flight sensor measures.",
        low=0.1,
        high=20.0,
    ),
    Parameter(
        "sonar_type",
        "ultrasound",
        "",
        "Type of the sonar in range/sonar.",
        choices=RANGE_TYPES,
    ),
    Parameter("sonar_field_of_view", 0.5, "rad", "Field of view of the sonar.", low=0.01, high=3.0),
    Parameter(
        "sonar_minimum", 0.02, "m", "Smallest distance that the sonar measures.", low=0.0, high=20.0
    ),
    Parameter(
        "sonar_maximum", 4.0, "m", "Largest distance that the sonar measures.", low=0.1, high=20.0
    ),
    Parameter(
        "ir_type",
        "infrared",
        "",
        "Type of both infrared sensors in range/ir1 and range/ir2.",
        choices=RANGE_TYPES,
    ),
    Parameter(
        "ir_field_of_view",
        0.1,
        "rad",
        "Field of view of both infrared sensors.",
        low=0.01,
        high=3.0,
    ),
    Parameter(
        "ir_minimum",
        0.1,
        "m",
        "Smallest distance that the infrared sensors measure.",
        low=0.0,
        high=20.0,
    ),
    Parameter(
        "ir_maximum",
        0.8,
        "m",
        "Largest distance that the infrared sensors measure.",
        low=0.1,
        high=20.0,
    ),
)
