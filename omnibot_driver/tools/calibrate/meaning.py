# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Find how the board interprets commands, and in which frame it reports odometry deltas.

Signs and scales of the odometry may be wrong. This module does not know how the robot is moved.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from omnibot_driver.tools.calibrate.log import Column, Odometry
from omnibot_driver.tools.needs import ToolError

ControlMethod = Literal["velocity", "position"]

STANDS_PART: Final = 0.1
"""Largest fraction of the commanded speed at which the robot is regarded as standing still."""
STEADY_PART: Final = 0.25
STOPS_PART: Final = 0.5
"""Limit for the speed in the second half of a drive, divided by the speed in the first half. Up to
this limit, the robot is regarded as stopping."""
DOUBLED, UNCHANGED = (1.6, 2.5), 1.25
"""Limits for the speed of a drive with twice the command, divided by the speed of the first drive.

The speed is regarded as doubled within ``DOUBLED``, and as unchanged below ``UNCHANGED``.
"""
PURE_TURN: Final = 0.5
"""Largest accepted ratio of sideways speed to rim speed in a turn on the spot.

The ratio is 0 for correctly interpreted deltas, otherwise 2 or more.
"""
ALIKE: Final = 0.35
"""Tolerance for the comparison of two angles, as a fraction of the angle by which the robot turned
between two drives. Angles that differ by less are regarded as equal."""


LEAST_M: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Drift:
    """Mean velocity of the robot over a time span, measured by the odometry, in the body's axes.

    ``early_mps``, ``late_mps``: speeds in the first and the second half of the span.
    """

    vx_mps: float
    vy_mps: float
    yaw_rate: float
    early_mps: float
    late_mps: float

    @property
    def speed_mps(self) -> float:
        """The speed regardless of direction, in m/s."""
        return math.hypot(self.vx_mps, self.vy_mps)

    @property
    def direction_rad(self) -> float:
        """Direction of the motion in the body's plane, in rad."""
        return math.atan2(self.vy_mps, self.vx_mps)


def drift(odometry: Odometry, begin_s: float, end_s: float) -> Drift:
    """Return the mean velocity between two timestamps. Raises ToolError if data are missing."""
    within = (odometry.stamp_s >= begin_s) & (odometry.stamp_s < end_s)
    twist = odometry.twist[within]
    if len(twist) < 4:
        raise ToolError("odometry was lost while the robot moved; see /diagnostics, and try again")
    early, late = (_speed(half) for half in np.array_split(twist, 2))
    vx, vy, yaw_rate = (float(value) for value in twist.mean(axis=0))
    return Drift(vx, vy, yaw_rate, early, late)


def require_motion(odometry: Odometry) -> None:
    """Raise ToolError if the robot's x and y have each changed by less than 1 mm."""
    if not len(odometry.pose) or np.ptp(odometry.pose[:, :2], axis=0).max() < LEAST_M:
        raise ToolError(
            "the robot does not move when commanded: check the motors' power, and what the driver"
            " logs"
        )


def control_method(slow: Drift, fast: Drift, slow_mps: float) -> ControlMethod | None:
    """Return how the board interprets commands: as velocities or as positions. None if unclear.

    ``slow``, ``fast``: motions with the command ``slow_mps`` and with twice this command.
    """
    # In velocity control the speed is constant, and doubles with the command. In positional control
    # the command is a position a few mm from the origin of the board's frame. The robot has stopped
    # there, or still drives there at a speed that does not depend on the command.
    # A speed that doubled and then fell shows a lost command, not a goal.
    both = slow, fast
    moved = slow.early_mps > STANDS_PART * slow_mps
    doubled = moved and DOUBLED[0] < fast.early_mps / slow.early_mps < DOUBLED[1]
    if not doubled and any(
        one.late_mps <= max(STANDS_PART * slow_mps, STOPS_PART * one.early_mps) for one in both
    ):
        return "position"
    if any(abs(one.late_mps - one.early_mps) >= STEADY_PART * one.early_mps for one in both):
        return None
    ratio = fast.speed_mps / slow.speed_mps
    if DOUBLED[0] < ratio < DOUBLED[1]:
        return "velocity"
    return "position" if ratio < UNCHANGED else None


def deltas_are_understood(turning: Drift, base_radius_m: float) -> bool:
    """Return whether the odometry shows a turn on the spot as a turn, not as sideways motion."""
    return turning.speed_mps < PURE_TURN * base_radius_m * abs(turning.yaw_rate)


def frame_is_right(before: Drift, after: Drift, turned_rad: float) -> bool:
    """Return whether the driver uses the right frame of the odometry deltas ("earth" or "body").

    ``before``, ``after``: equal drives before and after a turn by ``turned_rad``. Raises ToolError
    if they fit neither frame.
    """
    change_rad = abs(math.remainder(after.direction_rad - before.direction_rad, math.tau))
    if change_rad < ALIKE * abs(turned_rad):
        return True
    if abs(change_rad - abs(math.remainder(turned_rad, math.tau))) < ALIKE * abs(turned_rad):
        return False
    raise ToolError(
        "the odometry contradicts itself: the robot drove forward before and after a turn of"
        f" {math.degrees(turned_rad):.0f}°. By the odometry, the directions of these two drives in"
        f" the body's axes differ by {math.degrees(change_rad):.0f}°. The difference"
        " should be 0°; with a wrong delta_frame, it would be the angle of the turn. See"
        " /diagnostics, and docs/internals/omnibot_protocol.md"
    )


def _speed(twist: Column) -> float:
    vx, vy, _ = twist.mean(axis=0)
    return math.hypot(vx, vy)
