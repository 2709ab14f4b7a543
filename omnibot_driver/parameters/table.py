# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Every parameter of the driver, and the check of all values together. Knows no ROS."""

import difflib
from collections.abc import Iterable, Mapping
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.parameters import operating, robot
from omnibot_driver.parameters.parameter import Value

SECTIONS: Final = {
    "The line": operating.LINE,
    "Commands": operating.COMMANDS,
    "Frames": operating.FRAMES,
    "The robot and its board": robot.ROBOT,
    "The IMU": robot.IMU,
    "How sure the measurements are": robot.NOISE,
}
PARAMETERS: Final = tuple(parameter for rows in SECTIONS.values() for parameter in rows)
BY_NAME: Final = {parameter.name: parameter for parameter in PARAMETERS}


def nearest(name: str, names: Iterable[str]) -> str:
    """The one of these names that is most like it, however little."""
    return difflib.get_close_matches(name, list(names), n=1, cutoff=0.0)[0]


def check_all(given: Mapping[str, object]) -> dict[str, Value]:
    """Every parameter's value, from those given and the defaults. Raises ParameterError."""
    for name in given:
        if name not in BY_NAME:
            raise ParameterError(
                f"there is no parameter '{name}'; the nearest is '{nearest(name, BY_NAME)}'"
                " (config/driver.yaml has them all)"
            )
    values = {
        parameter.name: parameter.check(given.get(parameter.name, parameter.default))
        for parameter in PARAMETERS
    }
    _require_two_frames(values)
    _require_a_frame_for_goals(values)
    _require_possible_speeds(values)
    return values


def _require_two_frames(values: Mapping[str, Any]) -> None:
    if values["odom_frame"] == values["base_frame"]:
        raise ParameterError(
            f"parameter 'odom_frame' must not be '{values['odom_frame']}', which is 'base_frame':"
            " a frame cannot move within itself"
        )


def _require_a_frame_for_goals(values: Mapping[str, Any]) -> None:
    """A mirror turns the other way; signs that say otherwise leave positions without meaning."""
    x, y, yaw = values["axis_signs"]
    if values["control_method"] == "position" and x * y != yaw:
        raise ParameterError(
            f"parameter 'axis_signs' must not be {values['axis_signs']} with control_method"
            " 'position': the sign of yaw must be that of x times that of y"
        )


def _require_possible_speeds(values: Mapping[str, Any]) -> None:
    """A displacement above the fastest speed is rejected, so odometry would stop at full speed."""
    for kind, unit in (("linear", "m/s"), ("angular", "rad/s")):
        commanded, possible = f"max_{kind}_speed", f"fastest_{kind}_speed"
        if values[commanded] > values[possible]:
            raise ParameterError(
                f"parameter '{commanded}' ({values[commanded]:g} {unit}) must not be above"
                f" '{possible}' ({values[possible]:g} {unit}): odometry rejects what is faster than"
                f" that as impossible. Lower '{commanded}', or raise '{possible}' first"
            )
