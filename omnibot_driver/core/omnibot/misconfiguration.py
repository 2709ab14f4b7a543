# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Checks for settings that the board's data contradicts, with advice to change these settings.

This module knows what the data means under each setting; it does not know how the user is informed.
"""

import math
import struct
from typing import Final, Literal

from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.odometry.pending_displacements import chord
from omnibot_driver.core.omnibot.frames import ByteOrder, PoseFrame
from omnibot_driver.core.omnibot.schedule import DELTA_PERIODS_S, TICK_S, USUAL, Schedule
from omnibot_driver.core.readings import DisplacementReading, PoseReading

SURE: Final = 10
"""Number of poses that prove a setting wrong if they contradict it, and if no pose between them
confirms it. The board sends this number of poses in 2 s."""
SMALLEST: Final = 1e-6
LARGEST: Final = 1e7
"""``SMALLEST``, ``LARGEST``: limits of the magnitude of a pose's coordinate, in mm or mrad.

A coordinate outside these limits was read in the wrong byte order, except a coordinate of 0.
"""
POSE_PERIODS: Final = 2
"""Longest time between two poses that are compared with each other, in periods of the poses. With
the value 2, the pose between them may be lost."""
CLEARLY_M: Final = 0.01
TIMES: Final = 4.0
"""``CLEARLY_M`` (in m), ``TIMES``: limits for the check of ``delta_frame``.

A pose contradicts this setting if the summed deltas miss the pose by more than ``CLEARLY_M``, and
by more than ``TIMES`` times the error in the other frame.
"""

FEWEST_DELTAS: Final = 10
FOR_S: Final = 1.0
"""``FEWEST_DELTAS``, ``FOR_S`` (in s): limits for the advice to change ``delta_period``.

At least ``FEWEST_DELTAS`` deltas in a row must show the same period, other than the configured one,
for at least ``FOR_S``.
"""
RATE_TOLERANCE: Final = 0.1

_OTHER_ORDER: Final[dict[ByteOrder, ByteOrder]] = {"big": "little", "little": "big"}
_OTHER_FRAME: Final[dict[str, Literal["earth", "body"]]] = {"earth": "body", "body": "earth"}


class MisconfigurationChecks:
    """Checks whether readings contradict the settings with which they were decoded.

    ``advice``: a sentence for the user; None until a setting is contradicted.
    """

    def __init__(self, schedule: Schedule = USUAL) -> None:
        self.advice: str | None = None
        self._period_s, self._imus_per_delta = schedule.delta_period_s, schedule.imus_per_delta
        self._most_deltas = POSE_PERIODS * schedule.deltas_per_pose
        self._seen_period_s: float | None = None
        self._seen_since_s, self._seen_deltas = 0.0, 0
        self._against_order = self._against_frame = 0
        self._from: Pose | None = None
        self._moved: list[DisplacementReading] = []

    def displaced(self, reading: DisplacementReading) -> None:
        """Store a delta for the check of ``delta_frame``, which compares deltas with a pose.

        ``reading``: the delta, interpreted with the present settings.
        """
        self._moved.append(reading)
        unbroken = not (reading.lost or reading.restarted or reading.duration_s is None)
        if not unbroken or len(self._moved) > self._most_deltas:
            self._from = None
        if self._from is None:
            self._moved.clear()

    def spaced(self, reading: DisplacementReading, imus: int, now: float) -> None:
        """Check the configured period of the deltas with a new delta.

        ``imus``: number of IMU frames since the previous delta; this number shows the period.
        ``now``: arrival time of the new delta in s.
        """
        broken = reading.lost or reading.restarted or reading.duration_s is None
        if imus == self._imus_per_delta or not imus or broken:
            self._seen_period_s = None
            return
        period_s = _nearest_period_s(imus * TICK_S)
        if period_s != self._seen_period_s:
            self._seen_period_s, self._seen_since_s, self._seen_deltas = period_s, now, 0
            return
        self._seen_deltas += 1
        passed_s, deltas = now - self._seen_since_s, self._seen_deltas
        if period_s == self._period_s or passed_s < FOR_S or deltas < FEWEST_DELTAS:
            return
        self._seen_period_s = None
        if abs(passed_s / deltas - period_s) <= RATE_TOLERANCE * period_s:
            self.advice = (
                f"the board sends a delta every {period_s:g} s, not every {self._period_s:g} s, so"
                f" velocities are wrong: set the parameter `delta_period` to {period_s:g}"
            )

    def posed(self, frame: PoseFrame, reading: PoseReading, order: ByteOrder) -> None:
        """Check two settings with a new pose: ``pose_byte_order`` and ``delta_frame``.

        ``reading``: the pose as the settings interpret it. ``order``: configured byte order.
        """
        values = (frame.x, frame.y, frame.theta)
        makes_sense, swapped = _makes_sense(values), _makes_sense(_swapped(values))
        if makes_sense != swapped:
            self._against_order = 0 if makes_sense else self._against_order + 1
        if self._against_order == SURE:
            self.advice = (
                "the board's poses are plausible only in the other byte order: set the parameter"
                f" `pose_byte_order` to {_OTHER_ORDER[order]}"
            )
        if makes_sense:
            self._compare(Pose(reading.x_m, reading.y_m, reading.yaw_rad))

    def _compare(self, told: Pose) -> None:
        before, self._from = self._from, told
        moved, self._moved = self._moved, []
        if before is None or not moved:
            return
        frame = moved[0].frame
        said = _distance(before, moved, frame, told)
        other = _distance(before, moved, _OTHER_FRAME[frame], told)
        if said > max(CLEARLY_M, TIMES * other):
            self._against_frame += 1
        elif other > max(CLEARLY_M, TIMES * said):
            self._against_frame = 0
        if self._against_frame == SURE:
            self.advice = (
                "the board's deltas agree with its poses only in the other frame: set the"
                f" parameter `delta_frame` to {_OTHER_FRAME[frame]}"
            )


def _nearest_period_s(seconds: float) -> float:
    return min(DELTA_PERIODS_S, key=lambda period_s: abs(math.log(seconds / period_s)))


def _makes_sense(values: tuple[float, ...]) -> bool:
    return all(value == 0.0 or SMALLEST < abs(value) < LARGEST for value in values)


def _swapped(values: tuple[float, ...]) -> tuple[float, ...]:
    return struct.unpack("<3f", struct.pack(">3f", *values))


def _distance(start: Pose, moved: list[DisplacementReading], frame: str, told: Pose) -> float:
    for reading in moved:
        way = chord(reading)
        start = start + way if frame == "earth" else start.moved(roll(way))
    return math.hypot(told.x_m - start.x_m, told.y_m - start.y_m)
