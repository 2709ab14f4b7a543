# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Computes the robot's displacements from the poses and wheel speeds that the drive board sends.

Poses have coarse steps of 1 mm; sums of wheel speeds drift. So the wheel speeds are corrected
towards the newest pose. If they contradict the pose, or are missing, the pose decides.
"""

import math
from typing import Final

from omnibot_driver.core.fejemis.messages import BoardPose, WheelSpeeds
from omnibot_driver.core.geometry.se2 import Pose, log_of, roll
from omnibot_driver.core.readings import DisplacementReading, PoseReading

DRAWN: Final = 0.25
"""Fraction by which the driver corrects the wheels' motion towards a new pose.

The fraction applies if rounding of the pose can explain the difference.
"""
ROUNDINGS: Final = 1.5
"""Limit for the rounding error of a pose, along both axes together, in units of the last digit.

Rounding cannot explain a larger difference between the pose and the wheels' motion.
"""
SLACK_M: Final = 0.02
SLACK_RAD: Final = 0.06
"""``SLACK_M``, ``SLACK_RAD``: largest deviation of an accepted pose from the wheels' motion, in m
and rad. The motion that an acceleration of ``SPEED_UP_MPS2`` can cause is allowed in addition.
"""
SPEED_UP_MPS2: Final = 3.0
FASTEST_MPS: Final = 4.0
FASTEST_RADPS: Final = 12.0
FRESH_S: Final = 0.1
"""Age in s up to which wheel speeds are used.

It is measured by the board's time, because lines may wait to be read.
"""
LEAST_S: Final = 0.001
STILL_MPS: Final = 0.01
YAW_DIGIT_RAD: Final = 1e-4
SETTLE_EVERY_S: Final = 0.2
NEW_FRAME: Final = 4
"""Number of successive rejected poses that prove that the board uses a new coordinate frame.

Each of these poses must agree with the rejected pose just before it.
"""
MOVED_FRAME: Final = 2
"""Number of rejected poses in a row that prove a new coordinate frame if the wheel speeds agree.

For each of these poses, the motion since the previous rejected pose must agree with the wheel
speeds.
"""
AGAIN_M: Final = 0.004
AGAIN_RAD: Final = 0.012
"""``AGAIN_M``, ``AGAIN_RAD``: tolerances (m, rad) when poses are compared with the wheels' motion.

The comparison shows whether the board has set its pose to zero between two rejected poses.
"""
LONGEST_JUMP_S: Final = 0.2
"""Longest time after an accepted pose, in s, in which the wheel speeds overrule the poses.

In this time, another program may set the pose to zero (``enc0``) more than once.
"""


class PoseOdometry:
    """Turns poses and wheel speeds into displacements.

    ``track_m``: the track width that the board uses, in m.
    """

    def __init__(self, track_m: float) -> None:
        self.track_m = track_m
        self.refused = 0
        """Number of rejected poses."""
        self._pose: BoardPose | None = None
        self._told = Pose()
        self._restarted = False
        self._moved = False
        """Whether the last displacement ended in a new coordinate frame of the board.

        The next PoseReading must report the new frame.
        """
        self._settled_s = -math.inf
        self.begin()

    def begin(self) -> None:
        """Begin a new connection, but keep the last pose.

        The board may still use the same coordinate frame.
        """
        self._doubted: BoardPose | None = None
        self._agreed = 0
        """Number of successive rejected poses that each agree with the previous rejected pose."""
        self._driven: Pose | None = None
        """Motion from the last accepted pose to the last rejected pose; None while it is unknown.

        The motion to the first rejected pose comes from the wheel speeds, later motion from the
        poses. When the origin of the board's poses moves again, the wheel speeds are used instead.
        """
        self._speeds: WheelSpeeds | None = None
        self._before: WheelSpeeds | None = None
        self._speeds_s = self._time_s = -math.inf
        self._speeds_new = False
        """Whether wheel speeds have arrived since the last pose.

        ``_speeds_s``, ``_time_s``: board times of the last wheel speeds and the last pose, in s.
        Wheel speeds get the time of the next pose.
        """

    @property
    def moving(self) -> bool:
        """Whether a wheel turns, according to the last wheel speeds."""
        speeds = self._speeds
        return speeds is not None and max(map(abs, (speeds.left_mps, speeds.right_mps))) > STILL_MPS

    def forget(self) -> None:
        """Forget the last pose, because the board has restarted in a new coordinate frame."""
        self._restarted |= self._pose is not None
        self._moved = False
        self._settled_s = -math.inf
        self._pose = None
        self.begin()

    def speeds(self, speeds: WheelSpeeds) -> None:
        """Receive the speeds of both wheels."""
        self._before, self._speeds, self._speeds_new = self._speeds, speeds, True

    def readings(self, pose: BoardPose) -> list[DisplacementReading | PoseReading]:
        """Return a list with the displacement from the previous pose; empty without a displacement.

        Every 0.2 s, and when the board begins a coordinate frame, a PoseReading follows: the
        frame's first pose plus all displacements returned since.
        """
        displacement = self.pose(pose)
        if displacement is None:
            return []
        is_new = displacement.restarted or self._moved
        if not is_new and pose.time_s - self._settled_s < SETTLE_EVERY_S:
            return [displacement]
        self._settled_s = pose.time_s
        place, moved, self._moved = self._told, self._moved, False
        return [displacement, PoseReading(place.x_m, place.y_m, place.yaw_rad, restarted=moved)]

    def pose(self, pose: BoardPose) -> DisplacementReading | None:
        """Return the displacement from the previous pose; None if there is none.

        There is none if ``pose`` is the first one, or is rejected.

        After a restart of the board, the first displacement is 0.
        """
        before, self._time_s = self._pose, pose.time_s
        if self._speeds_new:
            self._speeds_s, self._speeds_new = pose.time_s, False
        if before is None:
            self._begin_at(pose)
            restarted, self._restarted = self._restarted, False
            nothing = DisplacementReading(
                0.0, 0.0, 0.0, "body", None, 0, restarted=True, up_s=pose.time_s
            )
            return nothing if restarted else None
        seconds = pose.time_s - before.time_s
        way = log_of(self._told.way_to(_place(pose)))
        if seconds < LEAST_S or not self._explained(way, seconds):
            return self._doubt(pose, seconds)
        self._doubted, self._agreed, self._driven = None, 0, None
        displacement = self._drawn(way, seconds, pose.decimals)
        self._pose = pose
        self._told = self._told.moved(roll(displacement))
        return _reading(displacement, seconds)

    def _begin_at(self, pose: BoardPose) -> None:
        self._pose, self._told = pose, _place(pose)
        self._doubted, self._agreed, self._driven = None, 0, None

    def _doubt(self, pose: BoardPose, since_s: float) -> DisplacementReading | None:
        before, self._doubted = self._doubted, pose
        self.refused += 1
        if before is None:
            self._driven = self._driven_to(pose, since_s)
            return None
        seconds = pose.time_s - before.time_s
        way = log_of(_place(before).way_to(_place(pose)))
        if seconds < LEAST_S or not _possible(way, seconds):
            self._agreed, self._driven = 0, self._driven_to(pose, since_s)
            return None
        # Two rejected poses agree. If the robot can have reached the second, it is accepted.
        # Otherwise, the board may have begun a new coordinate frame (command ``enc0``).
        whole = log_of(self._told.way_to(_place(pose)))
        self._agreed += 1
        rolled = self._rolled(seconds)
        if self._driven is not None and rolled is not None:
            # The board computes poses and wheel speeds from the same encoders. So the poses have a
            # new origin, even if the robot could have driven to this place.
            off = way - rolled
            # If the board set its pose to zero again, the new pose contradicts the wheels' motion,
            # and is not farther from zero than the wheels have moved.
            moved_again = not _within(off, Pose()) and _within(_place(pose), rolled)
            self._driven = self._driven.moved(roll(rolled if moved_again else way))
            if self._near(off, seconds):
                return self._in_moved_frame(pose, self._driven, since_s)
            if since_s <= LONGEST_JUMP_S:  # the origin may have moved again
                self._agreed = 0
                return None
        self._driven = None
        if since_s > 0.0 and _possible(whole, since_s):
            self._begin_at(pose)
            return _reading(whole, since_s)
        if self._agreed < NEW_FRAME:
            return None
        self._begin_at(pose)
        return DisplacementReading(
            way.x_m, way.y_m, way.yaw_rad, "body", seconds, 0, restarted=True
        )

    def _driven_to(self, pose: BoardPose, since_s: float) -> Pose | None:
        """Return the motion from the last accepted pose to ``pose``, by the wheel speeds.

        None if the wheel speeds are unknown, or if ``pose`` may have been rejected only because of
        rounding. ``since_s``: time in s since the last accepted pose.
        """
        assert self._pose is not None
        digit_m = 10.0 ** -max(pose.decimals, self._pose.decimals)
        if digit_m > SLACK_M or since_s < LEAST_S:  # rounding alone can contradict the wheels
            return None
        rolled = self._rolled(since_s)
        return None if rolled is None else roll(rolled)

    def _in_moved_frame(
        self, pose: BoardPose, driven: Pose, since_s: float
    ) -> DisplacementReading | None:
        if self._agreed < MOVED_FRAME:
            return None
        self._begin_at(pose)
        self._moved = True
        return _reading(log_of(driven), since_s)

    def _rolled(self, seconds: float) -> Pose | None:
        """Return the motion in ``seconds``, computed from the mean of each wheel's last two speeds.

        None if the last speeds are too old, or if ``seconds`` exceeds ``FRESH_S``.
        """
        speeds = self._speeds
        if speeds is None or self._time_s - self._speeds_s > FRESH_S or seconds > FRESH_S:
            return None
        before = self._before or speeds
        left = (speeds.left_mps + before.left_mps) / 2
        right = (speeds.right_mps + before.right_mps) / 2
        return Pose((left + right) / 2, 0.0, (right - left) / self.track_m).times(
            seconds, seconds, seconds
        )

    def _explained(self, way: Pose, seconds: float) -> bool:
        if not _possible(way, seconds):
            return False
        rolled = self._rolled(seconds)
        if rolled is None:  # after a gap the next pose must confirm a large step
            return seconds <= FRESH_S or (way.way_m <= SLACK_M and abs(way.yaw_rad) <= SLACK_RAD)
        return self._near(way - rolled, seconds)

    def _near(self, off: Pose, seconds: float) -> bool:
        slack_m = SLACK_M + SPEED_UP_MPS2 * seconds * seconds
        return off.way_m <= slack_m and abs(off.yaw_rad) <= SLACK_RAD + slack_m / self.track_m

    def _drawn(self, way: Pose, seconds: float, decimals: int) -> Pose:
        rolled = self._rolled(seconds)
        if rolled is None:
            return way
        off = way - rolled
        digit_m = 10.0**-decimals
        # If rounding does not explain the difference, lines were lost, or a wheel turned quickly.
        # Then the pose decides. If the excess is small, the mean of pose and wheels decides.
        if off.way_m > ROUNDINGS * digit_m or abs(off.yaw_rad) > ROUNDINGS * YAW_DIGIT_RAD:
            return (
                way if off.way_m > 3.0 * digit_m or abs(off.yaw_rad) > 0.005 else _half(rolled, way)
            )
        return rolled + off.times(DRAWN, DRAWN, DRAWN)


def _half(one: Pose, other: Pose) -> Pose:
    return (one + other).times(0.5, 0.5, 0.5)


def _place(pose: BoardPose) -> Pose:
    return Pose(pose.x_m, pose.y_m, pose.yaw_rad)


def _within(way: Pose, rolled: Pose) -> bool:
    return (
        way.way_m <= rolled.way_m + AGAIN_M and abs(way.yaw_rad) <= abs(rolled.yaw_rad) + AGAIN_RAD
    )


def _possible(way: Pose, seconds: float) -> bool:
    """Return whether a robot can make the motion ``way`` in ``seconds``."""
    return (
        way.way_m <= FASTEST_MPS * seconds + SLACK_M
        and abs(way.yaw_rad) <= FASTEST_RADPS * seconds + SLACK_RAD
    )


def _reading(tangent: Pose, seconds: float) -> DisplacementReading:
    return DisplacementReading(tangent.x_m, tangent.y_m, tangent.yaw_rad, "body", seconds, 0)
