# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judges the odometry of a drive: distance, speed, and whether pose and twist agree."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from omnibot_driver.tools.report.findings import Finding, Level, counted, span
from omnibot_driver.tools.report.log import Array, Log, Mask, Series

MOVING: Final = (0.005, 0.005, 0.01)
"""Speeds in x, y and yaw above which the robot is regarded as moving, in m/s, m/s and rad/s."""
LEAP_M: Final = 0.1
LEAP_RAD: Final = 0.35
"""``LEAP_M``, ``LEAP_RAD``: limits in m and rad above which a pose's change is a jump (a leap).

The motion by the twist is subtracted from this change. The driver's own corrections are smaller.
"""
RESET_M: Final = 0.02
RESET_RAD: Final = 0.05
SHORT_GAP_S: Final = 0.1
"""Smallest time in s between two odometry messages that is regarded as a gap.

A change of the pose over a gap is regarded as a jump only if the pose after the gap is zero.
"""


def moving(odom: Series) -> Mask:
    """Return for each odometry message whether its twist shows motion."""
    return np.asarray((np.abs(odom.values[:, 3:]) > MOVING).any(axis=1))


@dataclass(frozen=True, slots=True)
class Steps:
    """The steps from each message of odom to the next.

    * ``way_m``, ``turned_rad``: distance and turn of the step; 0 for a leap.
    * ``off_m``, ``off_rad``: difference between the change of the pose and the motion by the twist.
    * ``leap``: whether this difference is too large. Over a gap, only steps to the zero pose are
      leaps.
    * ``reset``: whether the step is a leap to the zero pose.
    """

    way_m: Array
    turned_rad: Array
    off_m: Array
    off_rad: Array
    leap: Mask
    reset: Mask


def steps(odom: Series) -> Steps:
    """Return the steps between successive odometry messages.

    ``odom`` must have at least two messages, and all must be finite.
    """
    steps_s = np.diff(odom.stamp_s)
    x, y, yaw = odom.values[:, :3].T
    turned = np.remainder(np.diff(yaw) + np.pi, 2 * np.pi) - np.pi
    vx, vy, rate = odom.values[1:, 3:].T
    heading = yaw[:-1] + turned / 2
    off_x = np.diff(x) - (vx * np.cos(heading) - vy * np.sin(heading)) * steps_s
    off_y = np.diff(y) - (vx * np.sin(heading) + vy * np.cos(heading)) * steps_s
    off_m, off_rad = np.hypot(off_x, off_y), np.abs(turned - rate * steps_s)
    zero = (np.hypot(x[1:], y[1:]) < RESET_M) & (np.abs(yaw[1:]) < RESET_RAD)
    far = (off_m > LEAP_M) | (off_rad > LEAP_RAD)
    leap = far & ((steps_s < SHORT_GAP_S) | zero)
    return Steps(
        way_m=np.where(leap, 0.0, np.hypot(np.diff(x), np.diff(y))),
        turned_rad=np.where(leap, 0.0, turned),
        off_m=off_m,
        off_rad=off_rad,
        leap=leap,
        reset=leap & zero,
    )


def judge(log: Log) -> Iterator[Finding]:
    """Judge the odometry: invalid numbers, the distance driven, and leaps of the pose."""
    broken = int((~log.odom.finite).sum())
    odom = log.odom.only(log.odom.finite)
    if broken:
        yield Finding(
            Level.BAD,
            "Odometry",
            f"{counted(broken, 'message')} of odom with NaN or infinity.",
            "This driver never publishes such values: find the other publisher"
            " (ros2 topic info --verbose odom).",
        )
    if len(odom) < 2:
        return
    found = steps(odom)
    speed = np.hypot(odom.values[:, 3], odom.values[:, 4])
    moved_s = float(moving(odom).mean()) * log.duration_s
    yield Finding(
        Level.NOTE,
        "Odometry",
        f"The robot drove {found.way_m.sum():.2f} m and turned by"
        f" {np.degrees(np.abs(found.turned_rad).sum()):.0f}° in all. It was in motion for"
        f" {span(moved_s)} of {span(log.duration_s)}. Its highest speeds were {speed.max():.2f} m/s"
        f" and {np.abs(odom.values[:, 5]).max():.2f} rad/s.",
    )
    yield from _leaps(odom, found)


def _leaps(odom: Series, found: Steps) -> Iterator[Finding]:
    at_s = odom.stamp_s[1:]
    if found.reset.any():
        yield Finding(
            Level.NOTE,
            "Odometry",
            f"The pose was set back to zero {counted(int(found.reset.sum()), 'time')}, first at"
            f" {at_s[found.reset][0]:.1f} s: ~/reset_odometry was called, or"
            " another driver was started.",
        )
    leap = found.leap & ~found.reset
    if not leap.any():
        yield Finding(Level.GOOD, "Odometry", "Pose and twist agree; the pose does not jump.")
        return
    worst = int(np.where(leap, found.off_m / LEAP_M + found.off_rad / LEAP_RAD, 0.0).argmax())
    yield Finding(
        Level.BAD,
        "Odometry",
        f"The pose jumps {counted(int(leap.sum()), 'time')} although the twist shows no such"
        f" motion. The largest jump, at {at_s[worst]:.1f} s, was by {found.off_m[worst]:.2f} m and"
        f" {np.degrees(found.off_rad[worst]):.0f}°.",
        "Do two nodes publish odom? If not, look at the gaps in this report, and check"
        " fastest_linear_speed.",
    )
