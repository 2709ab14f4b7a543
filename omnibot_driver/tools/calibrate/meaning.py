# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Find the meaning of the board's commands and deltas from its own odometry. Pure calculation.

Neither a person nor a measured floor is needed: the odometry is enough, whatever its signs and
scales.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from omnibot_driver.tools.calibrate.log import Column, Odometry
from omnibot_driver.tools.needs import ToolError

ControlMethod = Literal["velocity", "position"]

STANDS_PART: Final = 0.1
"""Fraction of the commanded speed below which the robot is regarded as standing still."""
STEADY_PART: Final = 0.25
STOPS_PART: Final = 0.5
"""Fraction of its earlier speed below which the robot is regarded as stopping."""
DOUBLED, UNCHANGED = (1.6, 2.5), 1.25
"""Range of the ratio of speeds when the command is doubled, with friction and rounding, and the
largest ratio of equal speeds."""
PURE_TURN: Final = 0.5
"""Largest ratio of sideways motion to rim speed in a turn on the spot.

The ratio is 0 if the deltas are interpreted correctly, else 2 or more.
"""
ALIKE: Final = 0.35
"""Fraction of the turned angle by which two directions may differ and still be the same."""


LEAST_M: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Drift:
    """Mean velocity by the driver's odometry over some time: in the body's axes, m/s and rad/s.

    ``early_mps`` and ``late_mps`` are the speeds of the two halves of the time.
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
    """Return the mean velocity between two timestamps. Raises ToolError for too little data."""
    within = (odometry.stamp_s >= begin_s) & (odometry.stamp_s < end_s)
    twist = odometry.twist[within]
    if len(twist) < 4:
        raise ToolError("odometry was lost while the robot moved; see /diagnostics, and try again")
    early, late = (_speed(half) for half in np.array_split(twist, 2))
    vx, vy, yaw_rate = (float(value) for value in twist.mean(axis=0))
    return Drift(vx, vy, yaw_rate, early, late)


def require_motion(odometry: Odometry) -> None:
    """Raise ToolError if the robot has not moved at all."""
    if not len(odometry.pose) or np.ptp(odometry.pose[:, :2], axis=0).max() < LEAST_M:
        raise ToolError(
            "the robot does not move when commanded: check the motors' power, and what the driver"
            " logs"
        )


def control_method(slow: Drift, fast: Drift, slow_mps: float) -> ControlMethod | None:
    """Return whether the board controls velocity or position, from the motion at two commands.

    ``slow``: the motion with the command for ``slow_mps``; ``fast``: with twice that command. A
    velocity is held, and doubles. In positional control the same command is a place a few
    millimetres from the origin of the board's frame: the robot drives to that place and stops, or
    is still on its way at the same speed. Returns None if the motion fits neither, as on a busy
    computer on which commands arrive late.
    """
    both = slow, fast
    if any(one.late_mps <= max(STANDS_PART * slow_mps, STOPS_PART * one.early_mps) for one in both):
        return "position"
    if any(abs(one.late_mps - one.early_mps) >= STEADY_PART * one.early_mps for one in both):
        return None
    ratio = fast.speed_mps / slow.speed_mps
    if DOUBLED[0] < ratio < DOUBLED[1]:
        return "velocity"
    return "position" if ratio < UNCHANGED else None


def deltas_are_understood(turning: Drift, base_radius_m: float) -> bool:
    """Return whether the odometry shows a turn on the spot as such, not as a sideways motion."""
    return turning.speed_mps < PURE_TURN * base_radius_m * abs(turning.yaw_rate)


def frame_is_right(before: Drift, after: Drift, turned_rad: float) -> bool:
    """Return whether a command moves the body in the same direction before and after this turn.

    With the wrong choice between the frames "earth" and "body", the direction turns as well. Raises
    ToolError if neither is the case.
    """
    change_rad = abs(math.remainder(after.direction_rad - before.direction_rad, math.tau))
    if change_rad < ALIKE * abs(turned_rad):
        return True
    if abs(change_rad - abs(math.remainder(turned_rad, math.tau))) < ALIKE * abs(turned_rad):
        return False
    raise ToolError(
        f"the odometry contradicts itself: after a turn of {math.degrees(turned_rad):.0f}° the"
        f" same command leads in a direction that differs by {math.degrees(change_rad):.0f}°; see"
        " /diagnostics, and docs/internals/omnibot_protocol.md"
    )


def _speed(twist: Column) -> float:
    vx, vy, _ = twist.mean(axis=0)
    return math.hypot(vx, vy)
