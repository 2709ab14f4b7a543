# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Dead reckoning: each displacement moves the robot in the odometry frame and the board's frame.

The robot's pose is stored twice: in the board's frame (BoardFrame), and in the odometry frame (in
the CorrectionSmoother). Each displacement moves both poses by the same tangent (twist x time).
This module does not know which poses of the board are right.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, Signs, roll
from omnibot_driver.core.odometry.board_frame import BoardFrame
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.odometry.gap_interpolation import LONGEST_BRIDGE_S, GapInterpolation
from omnibot_driver.core.odometry.pending_displacements import advanced
from omnibot_driver.core.odometry.pose_tracker import PoseTracker
from omnibot_driver.core.readings import DisplacementReading

UNKNOWN_S: Final = 0.5
"""Assumed duration, in s, of unreported motion in a gap of unknown length: a robot rolls to a halt
in this time."""


class DeadReckoning:
    """Moves the robot by its displacements, and by an assumed motion where displacements are lost.

    * ``track``: the robot in the odometry frame.
    * ``frame``: the robot in the board's frame.
    * ``bridge``: the motion that is assumed for lost displacements.
    * ``last_stamp_s``: stamp of the last displacement in s; None before the first one.
    """

    def __init__(self, axis_signs: Signs) -> None:
        self.track = PoseTracker(axis_signs)
        self.frame = BoardFrame()
        self.bridge = GapInterpolation()
        self.last_stamp_s: float | None = None

    def integrate(self, reading: DisplacementReading, stamp_s: float) -> OdometryEstimate:
        """Move the robot by an assumed motion for lost displacements, then by this displacement."""
        frame, track = self.frame, self.track
        last_stamp_s, self.last_stamp_s = self.last_stamp_s, stamp_s
        heading_rad = None if frame.pose is None else frame.pose.yaw_rad
        missing, last = self.bridge.missing, self.bridge.last
        bridge, tangent = self.bridge.tangents(reading, heading_rad)
        seconds = reading.duration_s
        if seconds is None:
            seconds = 0.0
            if last_stamp_s is not None:  # otherwise the odometry begins here, without a gap
                track.miss(UNKNOWN_S)
                if reading.restarted and last is not None:
                    # the longest time for which the robot may have driven before the restart
                    drove_s = stamp_s - last_stamp_s - reading.up_s
                    halt = max(UNKNOWN_S, drove_s) / 2 / last[1]
                    track.halt(last[0].times(halt, halt, halt))
                seconds = max(0.0, stamp_s - last_stamp_s)
        elif reading.lost:
            counted = missing + 1 if missing else 0
            track.miss((missing + reading.lost + 1) * seconds, counted * seconds)
        if reading.lost:
            stamped_s = math.inf if last_stamp_s is None else stamp_s - last_stamp_s - seconds
            self._cross(bridge, reading.lost * seconds, stamped_s)
        if frame.pose is not None:
            frame.pose = advanced(frame.pose, reading)
        self.move(tangent, seconds, seconds)
        follower = track.follower
        follower.follow((reading.lost + 1) * seconds)
        twist = rolling = None
        if reading.duration_s:
            twist, rolling = track.rates(tangent, seconds)
        covariance = track.uncertainty.total(follower.wrong)
        return OdometryEstimate(stamp_s, follower.pose, twist, covariance, track.rolled, rolling)

    def bridge_until_pose(self, lost: int) -> None:
        """Assume a motion for displacements that were lost just before a pose of the board.

        ``lost``: number of the lost displacements. The robot is assumed to have continued its last
        motion, but at most for ``LONGEST_BRIDGE_S``.
        """
        if lost and self.bridge.last is not None:
            tangent, period_s = self.bridge.last
            missing = self.bridge.missing
            counted = missing + 1 if missing else 0
            self.track.miss((missing + lost + 1) * period_s, counted * period_s)
            most = min(lost, max(0, round(LONGEST_BRIDGE_S / period_s) - missing))
            self._cross(tangent.times(most, most, most), lost * period_s)
            self.bridge.missing += lost

    def move(self, tangent: Pose, seconds: float, stamped_s: float) -> None:
        """Add a motion (``tangent``, twist x time), in the board's body axes, to the odometry.

        ``seconds``: duration of the motion in s, by the board's clock. ``stamped_s``: duration in s
        by the stamps.
        """
        self.track.move(tangent, seconds, stamped_s)
        self.frame.gate.passed(seconds)

    def _cross(self, tangent: Pose, seconds: float, stamped_s: float = math.inf) -> None:
        """Add an assumed motion (``tangent``) for a gap in the displacements.

        ``seconds``: duration of the gap in s, by the number of lost displacements. ``stamped_s``:
        duration in s by the stamps. The shorter duration limits the published motion.
        """
        frame = self.frame
        if frame.pose is not None:
            frame.pose = frame.pose.moved(roll(tangent))
        frame.gate.bridged(roll(tangent))
        self.move(tangent, seconds, min(seconds, max(0.0, stamped_s)))
