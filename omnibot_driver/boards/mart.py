# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Profile of the MART motion controller: its parameters, and the objects made from their values."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from omnibot_driver.boards.mart_parameters import DRIVING, SENSORS, WHEELS
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.mart.board import TRAITS, MartBoard
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.parameters import table
from omnibot_driver.recording import is_recording
from omnibot_driver.transports.udp import UdpPorts, check_address

SIMULATOR: Final = "omnibot_driver.simulator.mart"


def refuse_recordings(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if the port is a recording.

    The odometry depends on the requests, and a recorded reply does not show which request it
    answers.
    """
    if is_recording(values["port"]):
        raise ParameterError(
            f"port '{values['port']}' is not valid: a MART controller's recording cannot be"
            " replayed, because odom depends on what the driver sent; play the recorded odom with"
            " `ros2 bag play`, or run `ros2 run omnibot_driver report` on the bag; if another board"
            " made the bag, set the parameter `board`"
        )


PARAMETERS: Final = table(
    "mart",
    TRAITS,
    own={
        "The robot's wheels": WHEELS,
        "The MART controller": DRIVING,
        "Sonars and files": SENSORS,
    },
    without=(
        "axis_signs",
        "odom_wheel_drift",
        "odom_wheel_slip",
        "odom_gap_acceleration",
        "odom_gap_angular_acceleration",
        "twist_linear_stddev",
        "twist_angular_stddev",
    ),
    changed={
        "command_rate": {
            "description": "Not used by this board: a motion continues without repeated commands."
        },
        "odom_linear_scale": {
            "description": "Ratio of the true distance to the distance in odom, measured with this"
            " parameter at 1. The driver multiplies measured distances by this ratio. Usually"
            " leave it at 1, because `calibrate scale` corrects distances with metres_per_count."
        },
        "odom_angular_scale": {
            "description": "Correction of the controller's gyro: the driver multiplies its angles"
            " by this ratio. To find the ratio, set it to 1, stop after a turn, and divide the true"
            " angle by the angle in odom. While the robot turns on the spot, odom uses the right"
            " wheel instead, which the parameter track corrects."
        },
        "port": {
            "default": "udp://192.168.1.50:5000",
            "description": "Address of the controller, udp://host:port; the stop port has the next"
            " higher number. sim:// is a simulated board inside the driver.",
        },
        "publish_raw": {
            "description": "Publish the bytes of every datagram: received ones on ~/raw_rx/command"
            " and ~/raw_rx/stop, sent ones on ~/raw_tx/command and ~/raw_tx/stop."
        },
    },
    checks=(refuse_recordings,),
)


def make(values: Mapping[str, Any]) -> MartBoard:
    """Return a new board object, made from checked parameter values."""
    return MartBoard(settings(values))


def settings(values: Mapping[str, Any]) -> MartSettings:
    """Return the settings of the board, made from checked parameter values."""
    wheels = kinematics(values)
    sign = -1 if values["encoder_inverted"] else 1
    return MartSettings(
        track_m=wheels.track_m,
        metres_per_count=sign * values["odom_linear_scale"] * values["metres_per_count"],
        speed_per_unit=1.0 / values["linear_scale"],
        motor_balance=values["motor_balance"],
        nominal_volts=values["nominal_voltage"],
        heading_scale=values["odom_angular_scale"] * (-1 if values["heading_inverted"] else 1),
        network_delay_s=values["network_delay"],
        odom_rate_hz=values["odom_rate"],
        spin_speed=values["spin_speed"],
        allow_reverse_goals=values["allow_reverse_goals"],
        max_speed_mps=values["max_linear_speed"],
        max_yaw_rate_radps=values["max_angular_speed"],
        wheel_scale=values["odom_wheel_scale"],
        gyro_drift_radps=values["gyro_drift"],
    )


def opener(values: Mapping[str, Any]) -> Callable[[], UdpPorts]:
    """Return a function that opens the command port and the stop port.

    The stop port has the next higher number.
    """
    check_address(values["port"], len(TRAITS.channels))
    return partial(UdpPorts, values["port"], len(TRAITS.channels))


def kinematics(values: Mapping[str, Any]) -> DifferentialKinematics:
    """Return the kinematics of a left and a right wheel, with the calibrated sizes."""
    linear = values["odom_linear_scale"]
    return DifferentialKinematics(
        wheel_radius_m=linear * values["wheel_radius"], track_m=linear * values["track"]
    )


def extras(node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Any]:
    """Create this board's topics and services.

    Return a mapping: for each type of reading, the function that publishes readings of this type.
    """
    from omnibot_driver.boards.mart_topics import MartTopics  # needs ROS

    publish: Mapping[type, Any] = MartTopics(node, link, values).publish
    return publish
