# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings that a MART controller does not report: sizes, scales, network.

This module has only values. It does not know how they are used.
"""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class MartSettings:
    """The settings of one robot with a MART controller.

    ``metres_per_count``: distance per count of the right wheel; negative if the count falls in a
    forward drive.

    ``speed_per_unit``: speed of a wheel in m/s for one motor unit at ``nominal_volts``.

    ``motor_balance``: speed of the left motor divided by the speed of the right motor, at equal
    units.

    ``heading_scale``: true angle divided by the server's angle, which comes from its gyro; negative
    if the server's relative angle increases to the right.

    ``network_delay_s``: longest time in s from the sending of a datagram to its arrival.

    ``spin_speed``: speed of turns on the spot: "custom" (as commanded) or "fixed" (the server's
    speed SLOW).

    ``max_speed_mps``, ``max_yaw_rate_radps``: limits for moves to a goal. If normal moves exceed
    them, the server's speed SLOW is used.

    ``wheel_scale``: standard deviation of the wheel's size, as a fraction.

    ``gyro_drift_radps``: standard deviation of the gyro's drift, in rad/s.
    """

    track_m: float = 0.40
    metres_per_count: float = 0.0004
    speed_per_unit: float = 0.0085
    motor_balance: float = 1.0
    nominal_volts: float = 24.0
    heading_scale: float = 1.0
    network_delay_s: float = 0.3
    odom_rate_hz: float = 20.0
    spin_speed: Literal["custom", "fixed"] = "custom"
    allow_reverse_goals: bool = False
    max_speed_mps: float = 0.5
    max_yaw_rate_radps: float = 0.5
    wheel_scale: float = 0.01
    gyro_drift_radps: float = 0.001
