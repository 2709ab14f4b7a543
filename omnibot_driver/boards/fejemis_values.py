# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Selects the values to write to a Fejemis' boards, and checks that they fit together.

This module does not know ROS, or what a parameter means to the boards.
"""

import math
import os
from collections.abc import Mapping
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.fejemis import Written


def written(values: Mapping[str, Any]) -> dict[Written, tuple[float, ...]]:
    """Return the settings that the driver must write to the boards, in the boards' units."""
    found: dict[Written, tuple[float, ...]] = {}
    radii_m, track_m = values["wheel_radii"], values["track"]
    if radii_m is not None:
        gear, ticks = values["gear"], values["encoder_ticks"]
        found[Written.WHEELS] = (*radii_m, gear, float(ticks), track_m)
    if values["steering_distance"] is not None:
        found[Written.STEERING] = (track_m, values["steering_distance"])
    if values["front_wheel_offset"] is not None:
        found[Written.FRONT_WHEEL] = (
            math.degrees(values["front_wheel_offset"]),
            float(values["front_wheel_inverted"]),
        )
    for name, setting in _LISTS.items():
        if values[name] is not None:
            found[setting] = tuple(values[name])
    return found


_LISTS: Final[Mapping[str, Written]] = {
    "ir_calibration": Written.INFRARED,
    "mag_calibration": Written.MAGNETOMETER,
    "accel_calibration": Written.ACCELEROMETER,
    "steering_gains": Written.STEERING_GAINS,
}
_WHEELS: Final = ("wheel_radii", "gear", "encoder_ticks")


def require_two_ports(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if both Teensys have the same device, because each has its own port."""
    port, front = (str(values[name]) for name in ("port", "front_port"))
    if port == front or (port.startswith("/") and _same(port, front)):
        raise ParameterError(
            f"parameter 'front_port' must differ from 'port', but both lead to '{front}': the"
            " drive board and the front board each have their own port;"
            " `ls /dev/serial/by-id/` shows the ports"
        )


def require_whole_settings(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if only some of the parameters of one board command are set.

    The driver writes all parameters of a command together.
    """
    _require_together(values, (*_WHEELS, "track"), _WHEELS, "confw")
    _require_together(values, ("steering_distance", "track"), ("steering_distance",), "confs")
    offset = ("front_wheel_offset", "front_wheel_inverted")
    _require_together(values, offset, offset, "fwoffset")
    if values["track"] is not None and not any(
        values[name] is not None for name in (*_WHEELS, "steering_distance")
    ):
        raise ParameterError(
            "parameter 'track' cannot be set alone: also set 'steering_distance', or also set"
            " 'wheel_radii', 'gear' and 'encoder_ticks', or leave 'track' unset"
        )


def _require_together(
    values: Mapping[str, Any], names: tuple[str, ...], deciding: tuple[str, ...], command: str
) -> None:
    if not any(values[name] is not None for name in deciding):
        return
    if lacking := [name for name in names if values[name] is None]:
        raise ParameterError(
            f"parameter '{lacking[0]}' must be set too: the board takes {', '.join(names)} with"
            f" one command ({command}); set all of them or none"
        )


def _same(one: str, other: str) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)
