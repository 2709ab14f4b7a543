# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of a LOIS ECU and its robot.

The user must give them, because the board does not report them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from omnibot_driver.core.lois_ecu.messages import Setting, Stream, TerminalMode

DriveMode = Literal["rpm", "duty"]

BOOT_PERIOD_MS: Final = 400
"""Period in ms with which the board sends ticks after a boot. The driver assumes this period if the
user does not set one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoisEcuSettings:
    """Settings of a LOIS ECU and its robot.

    * ``inverted``: whether the board's left wheel is the robot's right wheel.
    * ``max_duty``: largest duty of a motor, in percent.
    * ``duty_scale``: duty, in percent, for each m/s of a wheel's rim.
    * ``low_pass``: 0..1, the part of a new set-point that the controller applies in each step. At
      0, the value after a boot, the wheels do not turn in RPM mode.
    * ``written``: further settings that the user wants on the board.
    * ``periods_ms``: periods of the board's messages that the user wants; no others are written.
    * ``declination_rad``: angle from true to magnetic north, east positive.
    """

    wheel_radius_m: float = 0.13
    track_m: float = 0.47
    ticks_per_revolution: int = 60
    inverted: bool = False
    drive_mode: DriveMode = "rpm"
    max_duty: int = 100
    duty_scale: float = 130.0
    low_pass: float = 1.0
    written: Mapping[Setting, float] = field(default_factory=dict)
    periods_ms: Mapping[Stream, int] = field(default_factory=dict)
    with_sum: bool = True
    terminal_mode: TerminalMode = TerminalMode.HOST
    declination_rad: float = 0.0
    odom_rate_hz: float = 20.0

    @property
    def rim_mps_per_rpm(self) -> float:
        """Speed of a rim in m/s at one revolution per minute."""
        return 0.10471975511965977 * self.wheel_radius_m

    @property
    def tick_m(self) -> float:
        """Distance in m that a wheel rolls per encoder tick."""
        return 6.283185307179586 * self.wheel_radius_m / self.ticks_per_revolution
