# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Profile of the LOIS ECU: its parameters, and the objects that are made from their values."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from omnibot_driver.boards.lois_ecu_parameters import (
    DRIVING,
    PERIODS,
    SENT,
    SETTINGS,
    WHEELS,
    WRITTEN,
    require_checksum_in_terminal_mode,
    require_possible_periods,
    require_slow_commands_in_terminal_mode,
)
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.lois_ecu import PERIOD_OFF, TerminalMode
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.parameters import table
from omnibot_driver.transports.serial_address import check_address
from omnibot_driver.transports.serial_port import SerialPort

SIMULATOR: Final = "omnibot_driver.simulator.lois_ecu"
PARAMETERS: Final = table(
    "lois_ecu",
    LoisEcuBoard.traits,
    own={
        "The robot's wheels": WHEELS,
        "The LOIS ECU": DRIVING,
        "What the board keeps": WRITTEN,
        "What the board sends": SENT,
    },
    without=(
        "axis_signs",
        "odom_wheel_drift",
        "odom_wheel_scale",
        "odom_wheel_slip",
        "odom_gap_acceleration",
        "odom_gap_angular_acceleration",
        "twist_linear_stddev",
        "twist_angular_stddev",
    ),
    changed={
        "max_wheel_speed": {
            "description": "Largest wheel rate that the driver commands for wheel_cmd. If one"
            " wheel exceeds this limit, both wheels are slowed down in the same ratio. In"
            " drive_mode duty, the limit also applies to duty_cmd: the driver converts each duty to"
            " a wheel rate with duty_scale."
        }
    },
    checks=(
        require_possible_periods,
        require_checksum_in_terminal_mode,
        require_slow_commands_in_terminal_mode,
    ),
)


def make(values: Mapping[str, Any]) -> LoisEcuBoard:
    """Return a new board object, made from checked parameter values."""
    return LoisEcuBoard(settings(values))


def settings(values: Mapping[str, Any]) -> LoisEcuSettings:
    """Return the settings of the board and its robot, made from checked parameter values."""
    wheels = kinematics(values)
    return LoisEcuSettings(
        wheel_radius_m=wheels.wheel_radius_m,
        track_m=wheels.track_m,
        ticks_per_revolution=values["ticks_per_revolution"],
        inverted=values["inverted"],
        drive_mode=values["drive_mode"],
        max_duty=values["max_duty"],
        duty_scale=values["duty_scale"],
        low_pass=values["low_pass"],
        written={
            setting: values[name] for name, setting in SETTINGS.items() if values[name] is not None
        },
        periods_ms={
            stream: round(1e3 * values[name]) or PERIOD_OFF
            for name, stream in PERIODS.items()
            if values[name] is not None
        },
        with_sum=values["checksum"],
        terminal_mode=TerminalMode[values["terminal_mode"].upper()],
        declination_rad=values["magnetic_declination"],
        odom_rate_hz=values["odom_rate"],
    )


def opener(values: Mapping[str, Any]) -> Callable[[], SerialPort]:
    """Return a function that opens the port: a device, or a URL that pyserial supports."""
    check_address(values["port"])
    return partial(SerialPort, values["port"], values["baudrate"])


def kinematics(values: Mapping[str, Any]) -> DifferentialKinematics:
    """Return the kinematics of both wheels, from the calibrated wheel sizes and track."""
    linear, angular = values["odom_linear_scale"], values["odom_angular_scale"]
    return DifferentialKinematics(
        wheel_radius_m=linear * values["wheel_radius"], track_m=linear / angular * values["track"]
    )


def extras(node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Any]:
    """Create this board's topics and services; return a publishing function per reading type."""
    from omnibot_driver.boards.lois_ecu_topics import LoisEcuTopics  # needs ROS

    publish: Mapping[type, Any] = LoisEcuTopics(node, link, values).publish
    return publish
