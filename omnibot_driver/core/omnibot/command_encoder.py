# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The encoder that turns orders into the board's frames.

The vendor found the velocity scales by trial: 70 LSB per m/s, and 500 LSB per rad/s. Commanded
poses are assumed to be in mm and mrad.

This module knows orders and frames; it knows neither modes nor send times.
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.commands.limits import slow
from omnibot_driver.core.commands.orders import Drive, EmergencyStop, GoTo, Order, TurnWheels
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.omnibot import frames
from omnibot_driver.core.omnibot.outbound import (
    MAX_WORD,
    ZEROS_BEFORE_MOTION,
    begins_with_a_letter,
    harmless,
    nearest,
    transmission,
)
from omnibot_driver.core.omnibot.settings import OmniBotSettings
from omnibot_driver.core.packets import Packets, packed
from omnibot_driver.core.readings import Vector3

STOP: Final = transmission(frames.encode(frames.STOP))
EMERGENCY_STOP: Final = transmission(frames.encode(frames.EMERGENCY_STOP))
STOP_PACKETS: Final = packed(STOP)
EMERGENCY_STOP_PACKETS: Final = packed(EMERGENCY_STOP)


class CommandEncoder:
    """Encodes orders as packets, with the scales of ``settings``.

    * ``settings``: may be replaced at any time.
    * ``saturated``: number of commands that were slowed down, because a value exceeded 16 bits.
    """

    def __init__(self, settings: OmniBotSettings) -> None:
        self.saturated = 0
        self.settings = settings

    @property
    def settings(self) -> OmniBotSettings:
        """The board's settings; the encoder uses their scales and radii."""
        return self._settings

    @settings.setter
    def settings(self, settings: OmniBotSettings) -> None:
        self._settings = settings
        self._last: tuple[Order, Packets] | None = None

    def encode(self, order: Order) -> Packets:
        """Return the packets of an order that is within the speed limits.

        Raises CommandRefused if the order is a goal pose that cannot be sent.
        """
        if self._last is not None and self._last[0] is order:
            return self._last[1]
        if isinstance(order, Drive):
            data = self.velocity(order.twist)
        elif isinstance(order, TurnWheels):
            data = self.wheels(order.rates_radps)
        elif isinstance(order, GoTo):
            data = self.drive_to(order.place)
        else:
            data = EMERGENCY_STOP if isinstance(order, EmergencyStop) else STOP
        packets = ((0, data),)
        self._last = order, packets
        return packets

    def stop(self) -> Packets:
        """Return the manual's Stop, which works in both positions of the board's control switch."""
        return STOP_PACKETS

    def emergency_stop(self) -> Packets:
        """Return the packets of the emergency stop, as the board's manual defines it."""
        return EMERGENCY_STOP_PACKETS

    def velocity(self, twist: BodyTwist) -> bytes:
        """Encode a twist for base vector control; return Stop if it rounds to zero."""
        settings = self._settings
        linear, angular = settings.linear_scale, settings.angular_scale
        counts = (twist.vx_mps * linear, twist.vy_mps * linear, twist.yaw_rate_radps * angular)
        return self._drive(frames.VELOCITY_MODE, counts)

    def wheels(self, rates_radps: Sequence[float]) -> bytes:
        """Encode wheel rates in rad/s for independent wheel drive.

        The frame contains rim speeds, with ``linear_scale`` LSB per m/s.
        """
        unit = self._settings.linear_scale * self._settings.wheel_radius_m
        a, b, c = rates_radps
        return self._drive(frames.WHEEL_MODE, (a * unit, b * unit, c * unit))

    def meaning(self, packets: Packets) -> BodyTwist:
        """Return the twist that the last command frame in ``packets`` commands.

        The twist is zero for Stop, the emergency stop, and data without a command frame. For a
        goal, the twist has no meaning.
        """
        settings = self._settings
        mode, a, b, c = frames.last_command(packets[-1][1])
        linear = settings.linear_scale
        if mode == frames.VELOCITY_MODE:
            return BodyTwist(a / linear, b / linear, c / settings.angular_scale)
        if mode == frames.WHEEL_MODE:
            rims = OmniKinematics(wheel_radius_m=1.0, base_radius_m=settings.base_radius_m)
            return rims.body_twist((a / linear, b / linear, c / linear))
        return BodyTwist(0.0, 0.0, 0.0)

    def drive_to(self, pose: Pose) -> bytes:
        """Encode a goal in the board's own frame, for positional control.

        A goal at the origin is not encoded as Stop. Raises CommandRefused if a value exceeds 16
        bits, or if a high byte is a letter (S, P, R).
        """
        position, heading = self._settings.position_scale, self._settings.heading_scale
        counts = (pose.x_m * position, pose.y_m * position, pose.yaw_rad * heading)
        if not all(abs(count) < MAX_WORD + 0.5 for count in counts):
            raise CommandRefused(
                f"cmd_pose rejected: in the board's own frame the goal is x {pose.x_m:.2f} m, y"
                f" {pose.y_m:.2f} m, yaw {pose.yaw_rad:.2f} rad, but the limits are"
                f" {MAX_WORD / position:.2f} m and {MAX_WORD / heading:.2f} rad; call ~/reset to"
                " move the origin of this frame to the robot"
            )
        if any(map(begins_with_a_letter, nearest(*counts))):
            raise CommandRefused(
                f"cmd_pose rejected: in the board's own frame the goal is x {pose.x_m:.2f} m, y"
                f" {pose.y_m:.2f} m, yaw {pose.yaw_rad:.2f} rad. The goal contains a byte that the"
                " board could mistake for a start, pause or reset if the line loses bytes; choose"
                " another goal, or call ~/reset to move the origin of this frame to the robot"
            )
        return ZEROS_BEFORE_MOTION + frames.command(frames.VELOCITY_MODE, *harmless(counts))

    def _drive(self, mode: int, counts: Vector3) -> bytes:
        a, b, c = counts
        if abs(a) > MAX_WORD or abs(b) > MAX_WORD or abs(c) > MAX_WORD:
            self.saturated += 1
            a, b, c = slow(counts, MAX_WORD)
        words = harmless((a, b, c))
        return ZEROS_BEFORE_MOTION + frames.command(mode, *words) if any(words) else STOP
