# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Speed limits for commands. They never change the direction of the linear velocity.

The limits need finite numbers, so call ``require_finite`` first. Only ``SpeedLimits.allow`` needs
no such call: for NaN and infinity, ``allow`` returns False.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimits:
    """The largest speeds and accelerations that are commanded.

    * ``linear_mps``: length of the linear velocity.
    * ``wheel_radps``: rate of the fastest wheel.
    * ``linear_mps2``, ``angular_radps2``: accelerations; 0: unlimited.
    """

    linear_mps: float = 0.5
    angular_radps: float = 0.5
    wheel_radps: float = 17.0
    linear_mps2: float = 0.0
    angular_radps2: float = 0.0

    def stricter_than(self, other: "SpeedLimits") -> bool:
        """Return whether any speed limit is lower than the same limit of ``other``."""
        return (
            self.linear_mps < other.linear_mps
            or self.angular_radps < other.angular_radps
            or self.wheel_radps < other.wheel_radps
        )

    def allow(self, twist: BodyTwist) -> bool:
        """Return whether the twist is below the speed limits. False if it has NaN or infinity."""
        return (
            twist.vx_mps * twist.vx_mps + twist.vy_mps * twist.vy_mps
            < self.linear_mps * self.linear_mps
            and abs(twist.yaw_rate_radps) < self.angular_radps
        )

    def twist(self, wanted: BodyTwist) -> BodyTwist:
        """Return the twist, reduced to the limits. The linear velocity keeps its direction."""
        vx, vy = shorten((wanted.vx_mps, wanted.vy_mps), self.linear_mps)
        yaw_rate = max(-self.angular_radps, min(self.angular_radps, wanted.yaw_rate_radps))
        return BodyTwist(vx, vy, yaw_rate)

    def approach(self, now: BodyTwist, wanted: BodyTwist, duration_s: float) -> BodyTwist:
        """Return the twist that a ramp from ``now`` to ``wanted`` reaches in ``duration_s``.

        The linear velocity changes along a straight line, independently of the yaw rate.
        """
        vx, vy = _step(
            (now.vx_mps, now.vy_mps),
            (wanted.vx_mps, wanted.vy_mps),
            self.linear_mps2 * duration_s if self.linear_mps2 else math.inf,
        )
        (yaw_rate,) = _step(
            (now.yaw_rate_radps,),
            (wanted.yaw_rate_radps,),
            self.angular_radps2 * duration_s if self.angular_radps2 else math.inf,
        )
        return BodyTwist(vx, vy, yaw_rate)

    def wheels(self, wanted_radps: Sequence[float]) -> tuple[float, ...]:
        """Return the rates, scaled by one factor so that the fastest wheel is within its limit."""
        return slow(wanted_radps, self.wheel_radps)


def require_finite(what: str, values: Sequence[float]) -> None:
    """Raise CommandRefused, naming ``what``, if a value is NaN or infinite."""
    if not all(map(math.isfinite, values)):
        numbers = ", ".join(f"{value:g}" for value in values)
        raise CommandRefused(
            f"{what} rejected: contains NaN or infinity; fix the publishing node (received"
            f" {numbers})"
        )


def require_timely(what: str, age_s: float, longest_s: float) -> None:
    """Raise CommandRefused if ``age_s``, the age of the sender's stamp, exceeds ``longest_s``.

    A negative age (a stamp in the future) has the same limit.
    """
    if abs(age_s) <= longest_s:
        return
    if age_s > 0.0:
        wrong = (
            f"it is {age_s:.2f} s old, and commands expire after {longest_s:g} s (cmd_vel_timeout)"
        )
    else:
        wrong = f"its stamp is {-age_s:.2f} s in the future"
    raise CommandRefused(
        f"{what} refused: {wrong}: check the network and that the computers' clocks agree"
        " (NTP, use_sim_time), or set the stamp to zero"
    )


def shorten(vector: Sequence[float], limit: float) -> tuple[float, ...]:
    """Return the vector, shortened to at most ``limit``. Large values cause no overflow."""
    largest = max(map(abs, vector))
    if largest == 0.0:
        return tuple(vector)
    unit_length = math.hypot(*(value / largest for value in vector))
    return _scale(vector, limit / largest / unit_length)


def slow(values: Sequence[float], limit: float) -> tuple[float, ...]:
    """Return the values, scaled by one factor so that no magnitude exceeds ``limit``."""
    largest = max(map(abs, values))
    return tuple(values) if largest <= limit else _scale(values, limit / largest)


def _step(now: Sequence[float], wanted: Sequence[float], longest: float) -> tuple[float, ...]:
    """Return the vector ``now`` moved towards ``wanted`` by at most ``longest``."""
    way = tuple(there - here for here, there in zip(now, wanted, strict=True))
    if math.hypot(*way) <= longest:
        return tuple(wanted)
    return tuple(here + part for here, part in zip(now, shorten(way, longest), strict=True))


def _scale(values: Sequence[float], factor: float) -> tuple[float, ...]:
    return tuple(value * factor for value in values) if factor < 1.0 else tuple(values)
