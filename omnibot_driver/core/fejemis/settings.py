# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The user's settings of a Fejemis: what the driver uses, and what it writes to the boards."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

LineSums = Literal["auto", "on", "off"]
AccelerationUnit = Literal["m/s^2", "g"]


class Written(Enum):
    """Settings that the driver can write to a board.

    The value of each member is the board's command that writes this setting.
    """

    WHEELS = "confw"
    """Radii of the left and right wheel in m, gear, encoder ticks per revolution, track in m."""
    STEERING = "confs"
    """Two lengths in m, for both boards: the track, and the distance from the axle to the steered
    wheel."""
    FRONT_WHEEL = "fwoffset"
    """Offset of the front wheel's angle in degrees, then 1 if the angle is inverted, else 0."""
    INFRARED = "irc"
    """Raw values of infrared sensor 1 at 13 cm and at 50 cm, then those of sensor 2."""
    MAGNETOMETER = "magcal"
    """Three offsets of the magnetometer, then a 3 × 3 matrix, row by row."""
    ACCELEROMETER = "acccal"
    """Three offsets of the accelerometer, then three scales."""
    STEERING_GAINS = "cssteer"
    """Parameters of the steering controller, as in ucontrolbase.cpp. Their count is not fixed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FejemisSettings:
    """The user's settings of the robot.

    * ``track_m``, ``wheelbase_m``: used until the boards report their own sizes.
    * ``line_sums``: whether text lines carry a checksum; with ``auto``, the heartbeats show this.
    * ``allow_reverse``: whether to send negative speeds (docs/boards/fejemis.md).
    * ``command_timeout_s``: longest time that the lift runs after one command.
    * ``low_cell_v``: voltage per cell below which the battery is low.
    * ``written``: values that the driver writes to the boards.
    """

    track_m: float = 0.4
    wheelbase_m: float = 0.5
    line_sums: LineSums = "auto"
    allow_reverse: bool = False
    acceleration_unit: AccelerationUnit = "m/s^2"
    command_timeout_s: float = 0.5
    power_off_delay_s: float = 10.0
    low_cell_v: float = 3.5
    written: Mapping[Written, tuple[float, ...]] = field(default_factory=dict)
