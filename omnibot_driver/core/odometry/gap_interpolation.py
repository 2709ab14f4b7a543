# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Interpolation of the motion in a gap, from the motion before and after the gap.

This module does not know where the robot is, nor how the result is used.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, log_of, roll
from omnibot_driver.core.odometry.pending_displacements import (
    PendingDisplacements,
    advanced,
    chord,
)
from omnibot_driver.core.readings import DisplacementReading

LONGEST_BRIDGE_S: Final = 2.0
"""Longest time, in s of the board's clock, over which motion is interpolated.

Without data, the driver stops the robot earlier, so the robot is unlikely to move for longer.
"""
NO_WAY: Final = Pose()


class GapInterpolation:
    """Estimates the motion of lost displacements from the displacements before and after the loss.

    * ``last``: newest tangent (twist x time) in body axes, and its duration in s; None if unknown.
    * ``missing``: number of displacements lost since the last displacement or accepted pose, as
      shown by poses.
    """

    def __init__(self) -> None:
        self.last: tuple[Pose, float] | None = None
        self.missing = 0
        self._only_poses = False
        """Whether no displacement has arrived since the last accepted pose."""

    def tangents(
        self, reading: DisplacementReading, heading_rad: float | None
    ) -> tuple[Pose, Pose]:
        """Return two tangents (twist x time): of all lost displacements, and of ``reading``.

        Both are in body axes. ``heading_rad``: heading before the losses. None if no pose has
        arrived; then ``reading`` is assumed to be in body axes.
        """
        last, self.last = self.last, None
        self.missing, self._only_poses = 0, False
        if reading.duration_s is None:
            return NO_WAY, _tangent(reading, heading_rad)
        half = min(reading.lost, round(LONGEST_BRIDGE_S / reading.duration_s)) / 2
        if half and heading_rad is not None:
            last_turn_rad = last[0].yaw_rad if last else reading.dyaw_rad
            heading_rad += half * (last_turn_rad + reading.dyaw_rad)
        tangent = _tangent(reading, heading_rad)
        self.last = tangent, reading.duration_s
        if not half:
            return NO_WAY, tangent
        before = last[0] if last else tangent
        return (before + tangent).times(half, half, half), tangent

    def before(self, told: Pose, waiting: PendingDisplacements) -> Pose:
        """Return the pose before the waiting displacements, if ``told`` is the pose after them.

        The displacements wait for a pose. Motion that was lost among them is estimated.
        """
        start, readings = waiting.before(told), waiting.readings
        if not any(reading.lost for reading in readings):
            return start
        for _ in range(2):  # the first pass finds the heading, and the second the place
            gaps, end = GapInterpolation(), start
            gaps.last = self.last
            for reading in readings:
                lost_way, _ = gaps.tangents(reading, end.yaw_rad)
                end = advanced(end.moved(roll(lost_way)), reading)
            start += told - end
        return start

    def prove(self, way: Pose = NO_WAY) -> None:
        """Record that a pose was accepted.

        ``way``: how the pose corrects the motion assumed since the previous accepted pose; a
        tangent in body axes. If all displacements since then were lost, this method also corrects
        ``last``, the newest tangent.
        """
        if self._only_poses and self.missing and self.last is not None:
            tangent, period_s = self.last
            # if only poses arrive, ``last`` is the mean motion of the displacements between two
            # poses
            part = 1 / self.missing
            self.last = tangent + way.times(part, part, part), period_s
        self.missing, self._only_poses = 0, True


def _tangent(reading: DisplacementReading, heading_rad: float | None) -> Pose:
    if reading.frame == "body" or heading_rad is None:
        return chord(reading)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    dx_m, dy_m = reading.dx_m, reading.dy_m
    return log_of(Pose(cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m, reading.dyaw_rad))
