# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The odometry estimator: from displacements and the board's own poses to pose, twist, covariance.

If displacements are lost, the board's next pose differs from the pose that the displacements lead
to. The difference is the lost motion. This module decides which displacements wait for a pose of
the board, and what each pose changes. It does not know bytes, clocks or ROS.
"""

import math
from dataclasses import replace
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, Signs, log_of, roll
from omnibot_driver.core.odometry.board_frame import is_begun
from omnibot_driver.core.odometry.covariance import NOTHING, Covariance
from omnibot_driver.core.odometry.dead_reckoning import DeadReckoning
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.pending_displacements import (
    PendingDisplacements,
    advanced,
    chord,
)
from omnibot_driver.core.odometry.pose_gate import expected
from omnibot_driver.core.readings import DisplacementReading, PoseReading

LONGEST_WAIT_S: Final = 1.0
"""Longest time, in s of the board's clock, to wait for a pose that gives the heading.

After this time, the driver assumes the heading of the last, unconfirmed pose; without a pose, 0.
"""
LONG_GAP_S: Final = 1.0
"""Longest gap, in s, after which the next displacements are used at once. After a longer gap, they
wait for a pose of the board, which shows the lost motion."""
POSE_DUE_S: Final = 0.24
"""Longest time, in s of the board's clock, until the next pose arrives. A pose that has not arrived
by then is regarded as lost."""
WELL_KNOWN_RAD: Final = 0.15
"""Largest standard deviation, in rad, with which the board's heading counts as known.

Only lost displacements make the heading uncertain, until a pose shows the lost motion.
"""


class Odometry:
    """The odometry of one robot.

    * ``axis_signs``: factors that convert the board's body axes to REP-103. They do not apply to
      the board's earth frame.
    """

    def __init__(self, settings: OdometrySettings, axis_signs: Signs = (1, 1, 1)) -> None:
        self.heading_assumed = False
        """Whether heading 0 was assumed because the board sent no pose."""
        self.alignments = 0
        """Number of times that the odometry frame was moved or scaled relative to the board's
        frame."""
        self._settings = settings
        self._reckoning = DeadReckoning(axis_signs)
        self._track, self._bridge = self._reckoning.track, self._reckoning.bridge
        self._frame, self._gate = self._reckoning.frame, self._reckoning.frame.gate
        self.configure(settings)
        self._backlog = PendingDisplacements()
        self._since_gap: Pose | None = None
        """The pose that the board would report now if it had begun a new frame in the longest gap.

        Only gaps since the last pose are considered. None without a gap, or if the gap began near
        the origin.
        """
        self._gap_lost = 0
        """Number of displacements lost in the gap of ``_since_gap``; 0 without such a gap."""
        self._told_lost = 0
        """Number of lost displacements that were shown by poses which the odometry did not accept.
        The number is added to ``lost`` of the next displacement or pose."""
        self.reset()
        self._reset_s: float | None = None
        """Time in s of the last reset; None if a displacement has arrived since then."""

    @property
    def refused_poses(self) -> int:
        """Number of poses of the board that the odometry has rejected.

        The odometry rejects an impossible pose. It also rejects an unexpected pose if the next pose
        does not confirm it.
        """
        return self._gate.refused

    def configure(self, settings: OdometrySettings) -> None:
        """Use these settings from the next displacement on."""
        before, self._settings = self._settings, settings
        self.alignments += (before.linear_scale, before.angular_scale) != (
            settings.linear_scale,
            settings.angular_scale,
        )
        self._track.configure(
            settings.noise,
            scale=(settings.linear_scale, settings.angular_scale),
            fastest=(settings.fastest_mps, settings.fastest_radps),
        )

    def reset(self, now: float = math.inf) -> list[OdometryEstimate]:
        """Move the odometry frame's origin to the robot's current pose.

        Return the estimates of displacements that waited for a pose. The motion in a gap is
        discarded if most of the gap was before ``now``, the time in s by the stamps' clock. By
        default, ``now`` is infinite: the motion in any gap is discarded.
        """
        self.alignments += 1
        due = []
        if self._frame.pose is not None:
            due = self._release()
            if self._track.uncertainty.gap != NOTHING and self._gate.proved is not None:
                # the heading is uncertain, so the board's next poses must give it
                self._frame.forget()
        # displacements that wait for the board's first pose are discarded
        self._backlog, self._told_lost = PendingDisplacements(), 0
        self._track.begin()
        self._reset_s = now
        return due

    def displace(self, reading: DisplacementReading, stamp_s: float) -> list[OdometryEstimate]:
        """Add a displacement; return all new estimates.

        A displacement that waits for a pose has no estimate yet. If displacements have waited
        before, their estimates may be returned now.
        """
        estimates = []
        reset_s, self._reset_s = self._reset_s, None
        if reset_s is not None:
            gap_s = self._gap_s(reading, stamp_s)
            # most of the gap was before the reset, so its motion belongs to the old frame
            if gap_s and stamp_s - reset_s < gap_s / 2:
                due = self.displace(reading, stamp_s) + self.reset(stamp_s)
                return [
                    replace(it, pose=Pose(), twist=None, rolling=None, covariance=Covariance())
                    for it in due
                ]
        if reading.restarted:
            estimates = self._release() if self._frame.pose is not None else []
            self._backlog, self._told_lost = PendingDisplacements(), 0
            self._frame.suspect_restart()
        if self._frame.since_restart is not None:
            self._frame.since_restart = advanced(self._frame.since_restart, reading)
        is_nowhere = self._frame.pose is None or self._frame.since_restart is not None
        means_nothing = is_nowhere and reading.frame == "earth"
        self._gate.displaced(reading, bridges=means_nothing)
        lost_s = reading.lost * (reading.duration_s or 0.0)
        if reading.lost > self._gap_lost and self._frame.is_away:
            self._since_gap, self._gap_lost = Pose(), reading.lost
        if self._since_gap is not None:
            self._since_gap = advanced(self._since_gap, reading)
        if not (means_nothing or self._backlog or lost_s > LONG_GAP_S):
            return [*estimates, self._reckoning.integrate(reading, stamp_s)]
        if reading.duration_s is not None:
            reading = replace(reading, lost=reading.lost + self._told_lost)
        self._told_lost = 0
        self._backlog.add(reading, stamp_s)
        waited_s = self._backlog.duration_s
        if means_nothing:
            if waited_s < LONGEST_WAIT_S:
                return estimates
            self._assume()
        elif self._backlog.lost_s > LONG_GAP_S and self._settles and waited_s < POSE_DUE_S:
            return estimates
        return estimates + self._release()

    def settle(self, reading: PoseReading) -> list[OdometryEstimate]:
        """Process a pose of the board; return the estimates of displacements that waited for it.

        If the settings allow it (``use_board_pose``), an accepted pose corrects the odometry.
        """
        told = Pose(reading.x_m, reading.y_m, reading.yaw_rad)
        if not self._gate.possible(told):
            return []
        since_gap, self._since_gap, self._gap_lost = self._since_gap, None, 0
        suspected = self._frame.since_restart is not None
        confirmed = self._gate.confirmed(told, self._track.uncertainty.gap)
        restarted = reading.restarted and (
            bool(self._backlog) or not self._frame.continues(told, self._track.uncertainty.gap)
        )
        if restarted:
            self._backlog.restart()
        if restarted or self._is_new_frame(told, confirmed):
            return self._attach(told, reading.lost)
        if self._frame.pose is None or self._frame.since_restart is not None:
            if self._backlog:
                self._told_lost += reading.lost
            else:
                self._reckoning.bridge_until_pose(reading.lost)
            self._gate.doubted = told
            return []
        lost, self._told_lost = reading.lost + self._told_lost, 0
        lost_s = lost * self._bridge.last[1] if self._bridge.last else 0.0
        is_long = bool(self._backlog) or lost_s > LONG_GAP_S
        if reading.ambiguous and since_gap is not None and self._began_in_gap(told, since_gap):
            self._backlog.restart()
            return self._attach(told, 0)
        if is_long and self._settings.use_board_pose and self._reachable(told, lost_s):
            return self._resume(told, lost_s)
        estimates = self._release()
        if lost:
            self._reckoning.bridge_until_pose(lost)
        if self._settings.use_board_pose:
            self._judge(told, confirmed)
        elif suspected:  # the board has not restarted
            self._track.bound(log_of(self._frame.pose.way_to(told)))
        return estimates

    def in_board_frame(self, place: Pose) -> Pose | None:
        """Convert the pose ``place`` from the odometry frame into the board's frame.

        The returned heading differs from the robot's heading by half a turn at most. The result is
        None without ``use_board_pose``, or while no pose has shown the relation of the frames.
        """
        if self._frame.pose is None or self._frame.since_restart is not None or not self._settles:
            return None
        return self._frame.pose.moved(roll(self._track.way_to(place)))

    @property
    def heading_known(self) -> bool:
        """Whether the board's heading is known well enough to distinguish forward from sideways."""
        gap_rad2 = self._track.uncertainty.gap.yaw_yaw
        proved = self._gate.proved is not None and self._frame.since_restart is None
        return proved and gap_rad2 < WELL_KNOWN_RAD * WELL_KNOWN_RAD

    @property
    def _settles(self) -> bool:
        """Whether the board's poses can reveal lost motion.

        They can if the settings use them (``use_board_pose``), and if one pose has been accepted.
        """
        return self._settings.use_board_pose and self._gate.proved is not None

    # The board's frame

    def _is_new_frame(self, told: Pose, confirmed: bool) -> bool:
        """Return whether the pose is in a new frame of the board, which the odometry must adopt.

        ``confirmed``: whether the pose agrees with the last unexpected pose. If no frame is known
        yet, the result is ``confirmed``.
        """
        frame = self._frame
        if frame.pose is None:
            return confirmed
        if frame.since_restart is None:
            return False
        return frame.was_replaced(
            told,
            self._bridge.before(told, self._backlog),
            self._track.uncertainty.gap,
            confirmed=confirmed,
            reachable=self._reachable(told),
        )

    def _began_in_gap(self, told: Pose, since_gap: Pose) -> bool:
        """Return whether the pose ``told`` shows that the board began a new frame in a recent gap.

        ``since_gap``: the pose that is expected if the board began a new frame.
        """
        assert self._frame.pose is not None
        gap = self._track.uncertainty.gap
        # the counters do not help: without a new frame, they would be the same after the gap
        went_on = not self._backlog and expected(self._frame.pose.way_to(told), gap)
        return is_begun(since_gap.way_to(told)) and not went_on

    def _attach(self, told: Pose, lost: int) -> list[OdometryEstimate]:
        """Adopt a new frame of the board. The odometry continues from its current pose.

        ``lost``: number of displacements lost just before the pose ``told``.
        """
        lost += self._told_lost
        end, readings = told, self._backlog.readings
        if readings and readings[-1].frame == "earth":
            end = told - chord(readings[-1]).times(lost, lost, lost)
        self._begin_at(self._bridge.before(end, self._backlog))
        estimates = self._release()
        self._reckoning.bridge_until_pose(lost)
        self._frame.pose, self._told_lost = told, 0
        self._gate.believe(told)
        self._bridge.prove()
        self._track.uncertainty.give_up()
        return estimates

    def _resume(self, told: Pose, lost_s: float) -> list[OdometryEstimate]:
        """Use a pose of the board to compute the motion of lost displacements.

        Return the estimates of the later displacements, which have waited for this pose.
        ``lost_s``: duration of the gap in s, used if no displacement has waited.
        """
        assert self._frame.pose is not None
        last_stamp_s = self._reckoning.last_stamp_s
        seconds = self._backlog.unstamped_s(last_stamp_s) if self._backlog else lost_s
        self._backlog.forget_losses()
        way = log_of(self._frame.pose.way_to(self._bridge.before(told, self._backlog)))
        self._frame.pose = self._frame.pose.moved(roll(way))
        self._track.resume(way)
        self._reckoning.move(Pose(), seconds, seconds)
        estimates = self._release()
        self._track.uncertainty.settle()
        self._gate.believe(told)
        self._bridge.prove()
        return estimates

    def _assume(self) -> None:
        """Assume that the last, unconfirmed pose is right. Without any pose, assume heading 0."""
        if self._gate.doubted is not None:
            self._begin_at(self._bridge.before(self._gate.doubted, self._backlog))
        else:
            self.heading_assumed = True
            self._begin_at(Pose())
        self._gate.proved = None

    def _begin_at(self, board: Pose) -> None:
        self.alignments += 1
        self._frame.begin_at(board)

    def _judge(self, told: Pose, confirmed: bool) -> None:
        """Accept a pose of the board, or keep it as ``doubted`` until the next pose.

        A pose is accepted if it is reachable and expected, or if it confirms the last doubted pose.
        """
        assert self._frame.pose is not None
        way = self._frame.pose.way_to(told)
        reachable = self._reachable(told)
        if not confirmed and not (reachable and expected(way, self._track.uncertainty.gap)):
            self._gate.doubted = told
            return
        if reachable:
            tangent = log_of(way)
            self._track.correct(tangent)
            self._bridge.prove(tangent)
        else:  # the board's frame has moved, and not the robot
            self._bridge.prove()
            self.alignments += 1
            self._track.uncertainty.give_up()
        self._frame.pose = told
        self._gate.believe(told)

    def _gap_s(self, reading: DisplacementReading, stamp_s: float) -> float:
        """Return the duration in s of a gap that ends with this displacement; 0 without a gap."""
        if reading.duration_s is None:
            last_stamp_s = self._reckoning.last_stamp_s
            return math.inf if last_stamp_s is None else stamp_s - last_stamp_s
        return (reading.lost + 1) * reading.duration_s if reading.lost else 0.0

    def _reachable(self, told: Pose, lost_s: float = 0.0) -> bool:
        waited_s = self._backlog.unheard_s(self._reckoning.last_stamp_s)
        waited_s += self._backlog.duration_s + lost_s
        settings = self._settings
        return self._gate.reachable(told, waited_s, settings.fastest_mps, settings.fastest_radps)

    def _release(self) -> list[OdometryEstimate]:
        return [
            self._reckoning.integrate(reading, stamp_s) for reading, stamp_s in self._backlog.take()
        ]
