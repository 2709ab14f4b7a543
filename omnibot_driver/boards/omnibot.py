# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Profile of the Neuron OmniBot: its parameters, and the objects made from their values."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from omnibot_driver.boards.omnibot_parameters import OMNIBOT, require_a_frame_for_goals
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.parameters import table
from omnibot_driver.transports.serial_address import check_address
from omnibot_driver.transports.serial_port import SerialPort

SIMULATOR: Final = "omnibot_driver.simulator.omnibot"
PARAMETERS: Final = table(
    "omnibot",
    OmniBot.traits,
    own={"The OmniBot": OMNIBOT},
    checks=(require_a_frame_for_goals,),
)


def make(values: Mapping[str, Any]) -> OmniBot:
    """Return a new board object, made from checked parameter values."""
    return OmniBot(settings(values))


def settings(values: Mapping[str, Any]) -> OmniBotSettings:
    """Return the settings of the board, made from checked parameter values."""
    return OmniBotSettings(
        baudrate=values["baudrate"],
        linear_scale=values["linear_scale"],
        angular_scale=values["angular_scale"],
        position_scale=values["position_scale"],
        heading_scale=values["heading_scale"],
        wheel_radius_m=values["wheel_radius"],
        base_radius_m=values["base_radius"],
        counts_per_revolution=values["counts_per_revolution"],
        delta_frame=values["delta_frame"],
        delta_period_s=values["delta_period"],
        pose_byte_order=values["pose_byte_order"],
        imu=ImuScale(accel_range_g=values["accel_range"], gyro_range_dps=values["gyro_range"]),
    )


def opener(values: Mapping[str, Any]) -> Callable[[], SerialPort]:
    """Return a function that opens the port: a device, or a URL that pyserial supports."""
    check_address(values["port"])
    return partial(SerialPort, values["port"], values["baudrate"])


def kinematics(values: Mapping[str, Any]) -> OmniKinematics:
    """Return the kinematics of wheels A, B and C."""
    return OmniKinematics(values["wheel_radius"], values["base_radius"])


def extras(_node: Any, _link: Any, _values: Mapping[str, Any]) -> Mapping[type, Any]:
    """Return an empty mapping, because this board has no topics or services of its own."""
    return {}
