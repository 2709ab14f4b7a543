# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Displacements that wait for a pose of the board, and their sum in the board's frame.

This module does not know why a displacement waits, or how the result is used.
"""

import math
from dataclasses import replace

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.readings import DisplacementReading


class PendingDisplacements:
    """Displacements that wait for a pose of the board, in order of arrival.

    Each has its stamp in s.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[DisplacementReading, float]] = []

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, reading: DisplacementReading, stamp_s: float) -> None:
        """Add the newest displacement."""
        self._waiting.append((reading, stamp_s))

    def take(self) -> list[tuple[DisplacementReading, float]]:
        """Return all displacements that wait, and remove them from this object."""
        waiting, self._waiting = self._waiting, []
        return waiting

    def forget_losses(self) -> None:
        """Set ``lost`` to 0, because the motion of the lost displacements is known now."""
        if self._waiting:
            reading, stamp_s = self._waiting[0]
            self._waiting[0] = replace(reading, lost=0), stamp_s

    def restart(self) -> None:
        """Record that the board restarted directly before the first displacement that waits here.

        The duration of this displacement, and the number of those lost before it, are then unknown.
        """
        if self._waiting:
            reading, stamp_s = self._waiting[0]
            self._waiting[0] = (
                replace(reading, lost=0, duration_s=None, restarted=True),
                stamp_s,
            )

    @property
    def lost(self) -> int:
        """Number of displacements lost directly before the first displacement that waits here."""
        return self._waiting[0][0].lost if self._waiting else 0

    @property
    def lost_s(self) -> float:
        """Estimated duration in s of the displacements lost before the first one that waits here.

        The value is their number times the duration of the first waiting displacement; 0 if this
        duration is unknown.
        """
        return self.lost * (self._waiting[0][0].duration_s or 0.0) if self._waiting else 0.0

    @property
    def duration_s(self) -> float:
        """Sum of the waiting displacements' durations, in s. An unknown duration counts as 0."""
        return math.fsum(reading.duration_s or 0.0 for reading, _ in self._waiting)

    def unheard_s(self, last_stamp_s: float | None) -> float:
        """Return how long, in s, the board reported nothing before the first waiting displacement.

        ``last_stamp_s``: stamp of the last report, used if the displacement's duration is unknown.
        If both are unknown, the result is 0.
        """
        if not self._waiting:
            return 0.0
        reading, stamp_s = self._waiting[0]
        if reading.duration_s is not None:
            return reading.lost * reading.duration_s
        return 0.0 if last_stamp_s is None else max(0.0, stamp_s - last_stamp_s)

    def unstamped_s(self, last_stamp_s: float | None) -> float:
        """Return the duration in s of the gap before the first waiting displacement, by the stamps.

        The gap begins at ``last_stamp_s``, and ends where this displacement begins. The result is
        at most ``unheard_s()``.
        """
        unheard_s = self.unheard_s(last_stamp_s)
        if not self._waiting or last_stamp_s is None:
            return unheard_s
        reading, stamp_s = self._waiting[0]
        if reading.duration_s is None:
            return 0.0
        return min(unheard_s, max(0.0, stamp_s - last_stamp_s - reading.duration_s))

    @property
    def readings(self) -> list[DisplacementReading]:
        """All displacements that wait, in order of arrival."""
        return [reading for reading, _ in self._waiting]

    def before(self, board: Pose) -> Pose:
        """Return the pose before all displacements that wait here.

        ``board``: the pose after all these displacements. The motion of lost displacements is
        assumed to be zero.
        """
        start = Pose(
            yaw_rad=board.yaw_rad - math.fsum(reading.dyaw_rad for reading, _ in self._waiting)
        )
        end = start
        for reading, _ in self._waiting:
            end = advanced(end, reading)
        return start + (board - end)


def chord(reading: DisplacementReading) -> Pose:
    """Return the displacement of a reading as a Pose, in the frame of the reading."""
    return Pose(reading.dx_m, reading.dy_m, reading.dyaw_rad)


def advanced(board: Pose, reading: DisplacementReading) -> Pose:
    """Return the pose that the robot reaches from the pose ``board`` by a displacement.

    Both poses are in the board's frame.
    """
    if reading.frame == "earth":
        return Pose(
            board.x_m + reading.dx_m, board.y_m + reading.dy_m, board.yaw_rad + reading.dyaw_rad
        )
    return board.moved(roll(chord(reading)))
