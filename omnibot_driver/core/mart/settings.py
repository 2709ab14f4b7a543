# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the wire of a MART controller does not tell: sizes, scales and the network. Values only."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class MartSettings:
    """``metres_per_count``: of the right wheel's encoder, negative where forward counts down;
    ``speed_per_unit``: of a wheel, in m/s for one unit of RM at ``nominal_volts``;
    ``heading_sign``: 1 where a positive relative angle is to the left; ``network_delay_s``: how
    long a datagram may be on its way; ``spin_speed``: how R and L are given a speed.
    """

    wheel_radius_m: float = 0.0625
    track_m: float = 0.40
    metres_per_count: float = 0.0004
    speed_per_unit: float = 0.0085
    nominal_volts: float = 24.0
    heading_sign: int = 1
    network_delay_s: float = 0.3
    odom_rate_hz: float = 20.0
    spin_speed: Literal["custom", "fixed"] = "custom"
    allow_reverse_goals: bool = False
    dock_distance_m: float = 0.5
    wheel_scale: float = 0.01
    gyro_drift_radps: float = 0.001
