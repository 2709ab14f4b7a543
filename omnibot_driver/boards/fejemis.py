# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Profile of the Fejemis sweeping robot: its parameters, and the objects made from their values."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from omnibot_driver.boards.fejemis_parameters import DRIVING, FRONT_PORT, SENSORS, WHEELS
from omnibot_driver.boards.fejemis_values import (
    require_two_ports,
    require_whole_settings,
    written,
)
from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.traits import TRAITS
from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.parameters import table
from omnibot_driver.transports.serial_address import check_address
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Several

SIMULATOR: Final = "omnibot_driver.simulator.fejemis"
USB_BAUDRATE: Final = 115200
"""Baud rate that is set for the USB ports, whose real speed does not depend on this setting."""
WHEEL_RADIUS_M, TRACK_M, WHEELBASE_M = 0.0775, 0.4, 0.42
"""Wheel radius, track and wheelbase in m that are used if the user does not set them.

Only the track is in the manual.
"""
PARAMETERS: Final = table(
    "fejemis",
    TRAITS,
    own={
        "The line": FRONT_PORT,
        "The robot's wheels": WHEELS,
        "The Fejemis": DRIVING,
        "Sensors": SENSORS,
    },
    without=("axis_signs",),
    changed={
        "port": {
            "default": "/dev/ttyACM0",
            "description": "Serial device of the drive board. sim:// is a simulated pair of boards"
            " inside the driver, and replay://bag plays a recorded bag.",
        },
        "gyro_bias": {
            "description": "Reading of the gyro at rest, in its own axes. The driver subtracts it."
            " The tool `calibrate imu` measures it. The service ~/calibrate_gyro lets the board"
            " calibrate its gyro instead, and then sets this parameter to 0."
        },
        "accel_bias": {
            "description": "Offset of the accelerometer, in its own axes. The driver subtracts it."
            " The service ~/calibrate_accelerometer lets the board calibrate its accelerometer,"
            " and then sets this parameter to 0."
        },
        "linear_acceleration_stddev": {
            "description": "Standard deviation of one accelerometer sample, for the covariance."
        },
        "angular_velocity_stddev": {
            "description": "Standard deviation of one gyro sample, for the covariance."
        },
    },
    checks=(require_two_ports, require_whole_settings),
)


def make(values: Mapping[str, Any]) -> FejemisBoard:
    """Return a new board object for both Teensys, made from checked parameter values."""
    return FejemisBoard(settings(values))


def settings(values: Mapping[str, Any]) -> FejemisSettings:
    """Return the settings of the board, made from checked parameter values."""
    wheels = kinematics(values)
    return FejemisSettings(
        track_m=wheels.track_m,
        wheelbase_m=wheels.wheelbase_m,
        line_sums=values["line_sums"],
        allow_reverse=values["allow_reverse"],
        acceleration_unit=values["acceleration_unit"],
        command_timeout_s=values["cmd_vel_timeout"],
        power_off_delay_s=values["power_off_delay"],
        low_cell_v=values["low_cell_voltage"],
        written=written(values),
    )


def opener(values: Mapping[str, Any]) -> Callable[[], Several]:
    """Return a function that opens both serial devices, or only one if the other is missing."""
    names = ("port", "front_port")
    for name in names:
        check_address(values[name], name, pollable=True)
    ports = [(values[n], partial(SerialPort, values[n], USB_BAUDRATE, n)) for n in names]
    return partial(Several, ports)


def kinematics(values: Mapping[str, Any]) -> SteeredKinematics:
    """Return the kinematics of the robot's wheels, with default sizes for unset parameters."""
    radii_m = values["wheel_radii"] or [WHEEL_RADIUS_M]
    return SteeredKinematics(
        wheel_radius_m=sum(radii_m) / len(radii_m),
        track_m=values["track"] or TRACK_M,
        wheelbase_m=values["steering_distance"] or WHEELBASE_M,
    )


def extras(node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Any]:
    """Create this board's topics and services.

    Return, for each type of reading, the function that publishes it.
    """
    from omnibot_driver.boards.fejemis_topics import FejemisTopics  # needs ROS

    publish: Mapping[type, Any] = FejemisTopics(node, link, values).publish
    return publish
