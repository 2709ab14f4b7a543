# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The odometry estimator: from displacements and the board's own poses to pose, twist, covariance.

The robot's pose is stored twice: in the board's frame (``_board``), and in the odometry frame (in
the CorrectionSmoother). Each displacement moves both poses by the same tangent (twist x time). If
displacements are lost, the board's next pose differs from ``_board``. The difference is the lost
motion. This module knows SE(2); it does not know bytes, clocks or ROS.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, Signs, log_of, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import NOTHING, Covariance, OdometryNoise
from omnibot_driver.core.odometry.gap_interpolation import LONGEST_BRIDGE_S, GapInterpolation
from omnibot_driver.core.odometry.pending_displacements import (
    PendingDisplacements,
    advanced,
    chord,
)
from omnibot_driver.core.odometry.pose_gate import PoseGate, expected
from omnibot_driver.core.odometry.pose_tracker import PoseTracker
from omnibot_driver.core.readings import DisplacementReading, PoseReading
from omnibot_driver.core.values import value

LONGEST_WAIT_S: Final = 1.0
"""Longest time, in s of the board's clock, to wait for a pose that gives the heading.

After this time, the driver assumes the heading of the last pose, although no other pose has
confirmed it. If no pose has arrived, the driver assumes heading 0.
"""
LONG_GAP_S: Final = 1.0
"""If displacements are lost for more than this time, in s, the next displacements wait for a pose
of the board. The pose shows the lost motion."""
POSE_DUE_S: Final = 0.24
"""Longest time, in s of the board's clock, until the next pose arrives. A pose that has not arrived
by then is regarded as lost."""
WELL_KNOWN_RAD: Final = 0.15
"""Largest standard deviation, in rad, with which the board's heading counts as known.

Only lost displacements make the heading uncertain: the standard deviation is that of the turn in
them. When a pose of the board has shown the lost motion, the heading is known again.
"""
UNKNOWN_S: Final = 0.5
"""Assumed duration, in s, of unreported motion in a gap of unknown length: a robot rolls to a halt
in this time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """The settings of the odometry.

    * ``use_board_pose``: whether the board's poses correct the odometry. If not, only the heading
      comes from them: once at the beginning, and once after each reset that follows a gap.
    * ``fastest_mps``, ``fastest_radps``: speeds that even a pushed robot does not exceed.
    * ``linear_scale``, ``angular_scale``: true distance and turn, divided by the reported ones.
    """

    noise: OdometryNoise = field(default_factory=OdometryNoise)
    use_board_pose: bool = True
    fastest_mps: float = 2.0
    fastest_radps: float = 8.0
    linear_scale: float = 1.0
    angular_scale: float = 1.0


@value(frozen=True, slots=True)
class OdometryEstimate:
    """The odometry at ``stamp_s``: pose and covariance in the odometry frame, twist in body axes.

    * ``twist``: None if the duration of the displacement is unknown.
    * ``rolled``: sum of the tangents (twist x time) of all motion so far, in the board's axes.
    * ``rolling``: present rate of change of ``rolled``, a twist in the board's axes; None if
      unknown.
    * ``twist_variances``: linear in m²/s², angular in rad²/s². If None, the values of the
      parameters are published.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist | None
    covariance: Covariance
    rolled: Pose = field(default_factory=Pose)
    rolling: BodyTwist | None = None
    twist_variances: tuple[float, float] | None = None


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
        self._track = PoseTracker(axis_signs)
        self.configure(settings)
        self._board: Pose | None = None
        self._belief = PoseGate()
        self._restarted: Pose | None = None
        self._backlog = PendingDisplacements()
        self._told_lost = 0
        """Number of lost displacements that an unconfirmed pose has shown, and that no displacement
        in ``_backlog`` counts yet."""
        self._bridge = GapInterpolation()
        self._last_stamp_s: float | None = None
        self.reset()
        self._reset_s: float | None = None
        """Time in s of the last reset; None if a displacement has arrived since then."""

    @property
    def refused_poses(self) -> int:
        """Number of poses of the board that the odometry has refused.

        It refuses impossible poses. It also refuses an unexpected pose if the next pose does not
        confirm it.
        """
        return self._belief.refused

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
        """Move the origin of the odometry frame to the robot's current pose.

        Return the estimates of displacements that were still waiting for a pose. Displacements that
        waited for the board's first pose are discarded. If the next displacement ends a gap, and
        most of this gap is older than the reset, its motion is discarded too.

        If motion was lost before the reset, the board's heading is uncertain. So the board's next
        poses show it again, as they showed the initial heading.

        ``now``: time of the reset in s, by the clock of the stamps. By default, the reset is at the
        end of the present gap.
        """
        self.alignments += 1
        due = []
        if self._board is not None:
            due = self._release()
            if self._track.uncertainty.gap != NOTHING and self._belief.proved is not None:
                self._board = self._belief.proved = None
        self._backlog, self._told_lost = PendingDisplacements(), 0
        self._track.begin()
        self._reset_s = now
        return due

    def displace(self, reading: DisplacementReading, stamp_s: float) -> list[OdometryEstimate]:
        """Add a displacement; return its estimates, or none while it waits for a pose."""
        estimates = []
        reset_s, self._reset_s = self._reset_s, None
        if reset_s is not None:
            gap_s = self._gap_s(reading, stamp_s)
            if gap_s and stamp_s - reset_s < gap_s / 2:
                self.displace(reading, stamp_s)
                self.reset(stamp_s)
                return []
        if reading.restarted:
            estimates = self._release() if self._board is not None else []
            self._backlog, self._told_lost = PendingDisplacements(), 0
            self._restarted, self._belief.doubted = Pose(), None
        if self._restarted is not None:
            self._restarted = advanced(self._restarted, reading)
        is_nowhere = self._board is None or self._restarted is not None
        means_nothing = is_nowhere and reading.frame == "earth"
        self._belief.displaced(reading, bridges=means_nothing)
        lost_s = reading.lost * (reading.duration_s or 0.0)
        if not (means_nothing or self._backlog or lost_s > LONG_GAP_S):
            return [*estimates, self._integrate(reading, stamp_s)]
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
        """Use a pose of the board; return the estimates of the displacements that waited for it."""
        told = Pose(reading.x_m, reading.y_m, reading.yaw_rad)
        if not self._belief.possible(told):
            return []
        confirmed = self._belief.confirmed(told, self._track.uncertainty.gap)
        restarted = reading.restarted and not self._continues(told)
        if restarted or self._is_new_frame(told, confirmed):
            return self._attach(told, reading.lost)
        if self._board is None or self._restarted is not None:
            if self._backlog:
                self._told_lost += reading.lost
            else:
                self._bridge_until_pose(reading.lost)
            self._belief.doubted = told
            return []
        lost, self._told_lost = reading.lost + self._told_lost, 0
        lost_s = lost * self._bridge.last[1] if self._bridge.last else 0.0
        is_long = bool(self._backlog) or lost_s > LONG_GAP_S
        if is_long and self._settings.use_board_pose and self._reachable(told, lost_s):
            return self._resume(told, lost_s)
        estimates = self._release()
        if lost:
            self._bridge_until_pose(lost)
        if self._settings.use_board_pose:
            self._judge(told, confirmed)
        return estimates

    def in_board_frame(self, place: Pose) -> Pose | None:
        """Convert ``place`` from the odometry frame into the board's frame.

        The board's heading is unwrapped: it can be larger than one turn. Of all headings that mean
        the same direction, the result has the one that is nearest to the robot's current heading.

        Return None if ``use_board_pose`` is False. Also return None while the relation of the two
        frames is unknown, because no pose of the board has shown it.
        """
        if self._board is None or self._restarted is not None or not self._settles:
            return None
        return self._board.moved(roll(self._track.way_to(place)))

    @property
    def heading_known(self) -> bool:
        """Whether the board's heading is known well enough to distinguish forward from sideways."""
        gap_rad2 = self._track.uncertainty.gap.yaw_yaw
        proved = self._belief.proved is not None and self._restarted is None
        return proved and gap_rad2 < WELL_KNOWN_RAD * WELL_KNOWN_RAD

    @property
    def _settles(self) -> bool:
        """Whether the board's poses can reveal lost motion.

        They can if the settings use them (``use_board_pose``), and if one pose has been accepted.
        """
        return self._settings.use_board_pose and self._belief.proved is not None

    # The board's frame

    def _continues(self, told: Pose) -> bool:
        """Return whether a pose is so near to the expected place that a restart changes nothing.

        The counter of a pose seems to begin anew also if the pose before it was damaged.

        A restart takes longer than a period. So the board did not restart if no displacement was
        lost since the last accepted pose. If displacements were lost, the result is False.
        """
        if self._board is None or self._restarted is not None or self._backlog:
            return False
        gap = self._track.uncertainty.gap
        return gap == NOTHING and expected(self._board.way_to(told), gap)

    def _is_new_frame(self, told: Pose, confirmed: bool) -> bool:
        """Return whether the odometry must adopt the board's frame in which this pose is given.

        A pose is *confirmed* (``confirmed``) if it agrees with the last doubted pose.

        While no frame was adopted or assumed, the result is True if the pose is confirmed.
        Afterwards, the odometry adopts another frame only after a suspected restart of the board.
        The *old frame* is the frame from before the suspected restart. The first rule that applies
        gives the result:

        * There is no suspected restart: False.
        * The pose fits the motion since the restart, and fits it better than the old frame: True.
        * The pose fits the old frame: False, and the suspicion ends.
        * The pose is confirmed, and the robot can have reached it in the old frame: False, and the
          suspicion ends.
        * In all other cases: True if the pose is confirmed.
        """
        if self._board is None:
            return confirmed
        if self._restarted is None:
            return False
        gap = self._track.uncertainty.gap
        anew = self._restarted.way_to(told)
        went_on = self._board.way_to(self._before_waiting(told))
        if expected(anew, gap) and _size(anew) < _size(went_on):
            return True
        if expected(went_on, gap) or (confirmed and self._reachable(told)):
            self._restarted = None
        return confirmed and self._restarted is not None

    def _attach(self, told: Pose, lost: int) -> list[OdometryEstimate]:
        """Adopt a new frame of the board. The odometry continues from its current pose.

        ``lost``: number of displacements lost just before the pose ``told``.
        """
        lost += self._told_lost
        end, readings = told, self._backlog.readings
        if readings and readings[-1].frame == "earth":
            end = told - chord(readings[-1]).times(lost, lost, lost)
        self._begin_at(self._before_waiting(end))
        estimates = self._release()
        self._bridge_until_pose(lost)
        self._board, self._told_lost = told, 0
        self._belief.believe(told)
        self._bridge.prove()
        self._track.uncertainty.give_up()
        return estimates

    def _resume(self, told: Pose, lost_s: float) -> list[OdometryEstimate]:
        """Use a pose of the board to compute the motion of lost displacements.

        The displacements that arrived after the loss have waited for this pose. They are published
        now, too.

        ``lost_s``: duration of the gap in s. It is used only if no displacement is waiting.
        """
        assert self._board is not None
        seconds = self._backlog.unstamped_s(self._last_stamp_s) if self._backlog else lost_s
        self._backlog.forget_losses()
        way = log_of(self._board.way_to(self._before_waiting(told)))
        self._board = self._board.moved(roll(way))
        self._track.resume(way)
        self._move(Pose(), seconds, seconds)
        estimates = self._release()
        self._track.uncertainty.settle()
        self._belief.believe(told)
        self._bridge.prove()
        return estimates

    def _assume(self) -> None:
        """Assume that the last, unconfirmed pose is right. Without any pose, assume heading 0."""
        if self._belief.doubted is not None:
            self._begin_at(self._before_waiting(self._belief.doubted))
        else:
            self.heading_assumed = True
            self._begin_at(Pose())
        self._belief.proved = None

    def _before_waiting(self, told: Pose) -> Pose:
        """Return the pose before all displacements that wait for a pose.

        From this pose, ``_release`` moves ``_board`` exactly to ``told``. It adds the waiting
        displacements, and an interpolated motion for each displacement lost between them.
        """
        start = self._backlog.before(told)
        readings = self._backlog.readings
        if not any(reading.lost for reading in readings):
            return start
        for _ in range(2):  # the first pass finds the heading, and the second the place
            gaps, end = GapInterpolation(), start
            gaps.last = self._bridge.last
            for reading in readings:
                lost_way, _ = gaps.tangents(reading, end.yaw_rad)
                end = advanced(end.moved(roll(lost_way)), reading)
            start += told - end
        return start

    def _begin_at(self, board: Pose) -> None:
        self.alignments += 1
        self._board, self._restarted, self._belief.doubted = board, None, None

    def _judge(self, told: Pose, confirmed: bool) -> None:
        """Accept a pose of the board, or keep it as ``doubted`` until the next pose.

        A pose is accepted if it is reachable and expected, or if it confirms the last doubted pose.
        If the robot cannot have reached a confirmed pose, the board's frame has moved, and not the
        robot.
        """
        assert self._board is not None
        way = self._board.way_to(told)
        reachable = self._reachable(told)
        if not confirmed and not (reachable and expected(way, self._track.uncertainty.gap)):
            self._belief.doubted = told
            return
        if reachable:
            tangent = log_of(way)
            self._track.correct(tangent)
            self._bridge.prove(tangent)
        else:
            self._bridge.prove()
            self.alignments += 1
            self._track.uncertainty.give_up()
        self._board = told
        self._belief.believe(told)

    def _gap_s(self, reading: DisplacementReading, stamp_s: float) -> float:
        """Return the duration in s of a gap that ends with this displacement; 0 without a gap."""
        if reading.duration_s is None:
            return math.inf if self._last_stamp_s is None else stamp_s - self._last_stamp_s
        return (reading.lost + 1) * reading.duration_s if reading.lost else 0.0

    def _reachable(self, told: Pose, lost_s: float = 0.0) -> bool:
        waited_s = self._backlog.unheard_s(self._last_stamp_s) + self._backlog.duration_s + lost_s
        settings = self._settings
        return self._belief.reachable(told, waited_s, settings.fastest_mps, settings.fastest_radps)

    # Integration

    def _release(self) -> list[OdometryEstimate]:
        return [self._integrate(reading, stamp_s) for reading, stamp_s in self._backlog.take()]

    def _integrate(self, reading: DisplacementReading, stamp_s: float) -> OdometryEstimate:
        last_stamp_s, self._last_stamp_s = self._last_stamp_s, stamp_s
        heading_rad = None if self._board is None else self._board.yaw_rad
        missing, last = self._bridge.missing, self._bridge.last
        bridge, tangent = self._bridge.tangents(reading, heading_rad)
        seconds = reading.duration_s
        if seconds is None:
            seconds = 0.0
            if last_stamp_s is not None:  # otherwise the odometry begins here, without a gap
                self._track.miss(UNKNOWN_S)
                if reading.restarted and last is not None:
                    halt = UNKNOWN_S / 2 / last[1]
                    self._track.halt(last[0].times(halt, halt, halt))
                seconds = max(0.0, stamp_s - last_stamp_s)
        elif reading.lost:
            counted = missing + 1 if missing else 0
            self._track.miss((missing + reading.lost + 1) * seconds, counted * seconds)
        if reading.lost:
            stamped_s = math.inf if last_stamp_s is None else stamp_s - last_stamp_s - seconds
            self._cross(bridge, reading.lost * seconds, stamped_s)
        if self._board is not None:
            self._board = advanced(self._board, reading)
        self._move(tangent, seconds, seconds)
        track, follower = self._track, self._track.follower
        follower.follow((reading.lost + 1) * seconds)
        twist = rolling = None
        if reading.duration_s:
            twist, rolling = track.rates(tangent, seconds)
        covariance = track.uncertainty.total(follower.wrong)
        return OdometryEstimate(stamp_s, follower.pose, twist, covariance, track.rolled, rolling)

    def _cross(self, tangent: Pose, seconds: float, stamped_s: float = math.inf) -> None:
        """Add an assumed motion (``tangent``) for a gap in the displacements.

        ``seconds``: duration of the gap, computed from the number of lost displacements.

        ``stamped_s``: duration of the gap in s, computed from the stamps before and after it.
        """
        if self._board is not None:
            self._board = self._board.moved(roll(tangent))
        self._belief.bridged(roll(tangent))
        self._move(tangent, seconds, min(seconds, max(0.0, stamped_s)))

    def _bridge_until_pose(self, lost: int) -> None:
        """Assume a motion for displacements that were lost just before a pose of the board.

        ``lost``: number of the lost displacements. The robot is assumed to have continued its last
        motion, but at most for ``LONGEST_BRIDGE_S``.
        """
        if lost and self._bridge.last is not None:
            tangent, period_s = self._bridge.last
            missing = self._bridge.missing
            counted = missing + 1 if missing else 0
            self._track.miss((missing + lost + 1) * period_s, counted * period_s)
            most = min(lost, max(0, round(LONGEST_BRIDGE_S / period_s) - missing))
            self._cross(tangent.times(most, most, most), lost * period_s)
            self._bridge.missing += lost

    def _move(self, tangent: Pose, seconds: float, stamped_s: float) -> None:
        """Add a motion (``tangent``, twist x time) in the board's body axes.

        ``seconds``: duration of the motion, in s.

        ``stamped_s``: time between the stamps before and after the motion, in s.
        """
        self._track.move(tangent, seconds, stamped_s)
        self._belief.passed(seconds)


def _size(way: Pose) -> float:
    return way.way_m + abs(way.yaw_rad)
