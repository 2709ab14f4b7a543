"""From displacements and the board's own poses to pose, twist and covariance.

One idea: ``_board`` is where the board believes to be, told by displacements at once and by its
poses for certain; the follower's target is the same place in the odometry frame. Both always move
together, by the same tangent in the body's axes, so motion that was lost on the line is found again
with the next pose. This module knows SE(2); it knows no bytes, no clock and no ROS.
"""

import math
from dataclasses import dataclass, field
from typing import Final

from omnibot_driver.core.board import DisplacementReading, PoseReading
from omnibot_driver.core.follower import Follower
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.se2 import Pose, Signs, roll, unroll
from omnibot_driver.core.uncertainty import NOTHING, Covariance, OdometryNoise, Uncertainty

LONGEST_WAIT_S: Final = 1.0
"""Board time without any pose after which heading 0 is assumed."""
LONGEST_BRIDGE: Final = 50
"""Displacements that a bridge stands for at the most; a robot that is not heard is soon stopped."""
UNKNOWN_S: Final = 0.5
"""Time in which a robot rolls out: what may be unreported where nobody knows how long it was."""
BELIEVED_M: Final = 0.02
BELIEVED_TURN_RAD: Final = 0.05
"""A pose that is off by more than this and what the gaps explain must be confirmed by the next."""
BELIEVED_SIGMAS: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """``fastest_mps``, ``fastest_radps``: what the robot can never exceed, pushed by hand too.

    Without ``use_board_pose`` a pose tells nothing but the heading to begin with, which earth
    displacements mean nothing without.
    """

    noise: OdometryNoise = field(default_factory=OdometryNoise)
    use_board_pose: bool = True
    fastest_mps: float = 2.0
    fastest_radps: float = 8.0


@dataclass(frozen=True, slots=True)
class OdometryEstimate:
    """At ``stamp_s``: pose and covariance in the odometry frame, twist in the body's.

    ``twist`` is None where the time that the displacement took is not known.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist | None
    covariance: Covariance


class Odometry:
    """``axis_signs`` turn x, y and yaw of the board's body axes into REP-103's; the board's earth
    frame and heading are its own affair and keep its signs.
    """

    def __init__(self, settings: OdometrySettings, axis_signs: Signs = (1, 1, 1)) -> None:
        self.heading_assumed = False
        """True once a board sent no pose and its heading had to be taken for 0."""
        self.alignments = 0
        """How often the odometry frame has come to lie otherwise in the board's."""
        self._axis_signs = axis_signs
        self._settings = settings
        self._uncertainty = Uncertainty(settings.noise)
        self._board: Pose | None = None
        self._proved: Pose | None = None
        self._unproved_s = 0.0
        self._doubted: Pose | None = None
        self._restarted: Pose | None = None
        self._waiting: list[tuple[DisplacementReading, float]] = []
        self._last_stamp_s: float | None = None
        self._last: tuple[Pose, float] | None = None
        self.reset()

    @property
    def settings(self) -> OdometrySettings:
        """What may change while it runs."""
        return self._settings

    @settings.setter
    def settings(self, settings: OdometrySettings) -> None:
        self._settings = settings
        self._uncertainty.noise = settings.noise

    def reset(self) -> None:
        """The odometry frame begins where the robot stands."""
        self.alignments += 1
        if self._board is not None:
            self._release()
            if self._uncertainty.gap != NOTHING:
                self._proved = None  # what the next pose corrects was before the reset
        self._waiting = []
        self._follower = Follower()
        self._uncertainty = Uncertainty(self._settings.noise)

    def displace(self, reading: DisplacementReading, stamp_s: float) -> list[OdometryEstimate]:
        """The estimates that this displacement completes: none while the heading is unknown."""
        estimates = []
        if reading.restarted:
            estimates = self._release() if self._board is not None else []
            self._waiting = []
            self._restarted = Pose()
        if self._restarted is not None:
            self._restarted = _advanced(self._restarted, reading)
        self._waiting.append((reading, stamp_s))
        if reading.frame == "earth" and (self._board is None or self._restarted is not None):
            if sum(waiting.duration_s or 0.0 for waiting, _ in self._waiting) < LONGEST_WAIT_S:
                return estimates
            self.heading_assumed = True
            self._begin_at(Pose())
            self._proved = None
        return estimates + self._release()

    def settle(self, reading: PoseReading) -> list[OdometryEstimate]:
        """Take what the board's pose tells; releases the displacements that waited for it."""
        told = Pose(reading.x_m, reading.y_m, reading.yaw_rad)
        if not told.finite:
            return []
        if self._board is None or reading.restarted or self._has_restarted(told):
            return self._attach(told)
        self._restarted = None
        estimates = self._release()
        self._bridge_until_pose(reading.lost)
        if self._settings.use_board_pose:
            self._judge(told)
        return estimates

    def in_board_frame(self, place: Pose) -> Pose | None:
        """A place in the odometry frame as the board would call it, by the shorter turn from here.

        None while it cannot be told: no pose of the board says where the frames lie.
        """
        proved = self._proved is not None and self._settings.use_board_pose
        if self._board is None or self._restarted is not None or not proved:
            return None
        way = self._follower.target.way_to(place)
        return self._board.moved(roll(self._signed(unroll(way))))

    # The board's frame

    def _has_restarted(self, told: Pose) -> bool:
        """Whether the board counts from zero again: its pose says so better than its past does."""
        if self._restarted is None or self._board is None:
            return False
        anew = self._restarted.way_to(told)
        waited = sum((_chord(reading) for reading, _ in self._waiting), Pose())
        went_on = (self._board + waited).way_to(told)
        return self._expected(anew) and anew.way_m + abs(anew.yaw_rad) < went_on.way_m + abs(
            went_on.yaw_rad
        )

    def _attach(self, told: Pose) -> list[OdometryEstimate]:
        """The board's frame is a new one; the odometry goes on from where it is."""
        self._begin_at(told - sum((_chord(reading) for reading, _ in self._waiting), Pose()))
        estimates = self._release()
        self._believe(told)
        self._uncertainty.give_up()
        return estimates

    def _begin_at(self, board: Pose) -> None:
        self.alignments += 1
        self._board, self._restarted, self._doubted = board, None, None

    def _believe(self, board: Pose) -> None:
        self._board = self._proved = board
        self._unproved_s, self._doubted = 0.0, None

    def _judge(self, told: Pose) -> None:
        """Correct by a pose that is reachable and no surprise, or confirmed by the one before."""
        assert self._board is not None
        way = self._board.way_to(told)
        reachable = self._reachable(told)
        confirmed = self._doubted is not None and self._expected(self._doubted.way_to(told))
        if not confirmed and not (reachable and self._expected(way)):
            self._doubted = told
            return
        if reachable:
            self._follower.correct(roll(self._signed(unroll(way))))
            self._uncertainty.settle()
        else:
            self.alignments += 1
            self._uncertainty.give_up()
        self._believe(told)

    def _reachable(self, told: Pose) -> bool:
        """From the last pose that was believed, in the time since then."""
        if self._proved is None:
            return False
        way, seconds = self._proved.way_to(told), self._unproved_s
        return (
            way.way_m <= BELIEVED_M + self._settings.fastest_mps * seconds
            and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + self._settings.fastest_radps * seconds
        )

    def _expected(self, way: Pose) -> bool:
        """No surprise: rounding, and what the open gaps explain."""
        gap = self._uncertainty.gap
        metres = math.sqrt(gap.xx + gap.yy) * BELIEVED_SIGMAS
        turn = math.sqrt(gap.yaw_yaw) * BELIEVED_SIGMAS
        return way.way_m <= BELIEVED_M + metres and abs(way.yaw_rad) <= BELIEVED_TURN_RAD + turn

    # Motion

    def _release(self) -> list[OdometryEstimate]:
        waiting, self._waiting = self._waiting, []
        return [self._integrate(reading, stamp_s) for reading, stamp_s in waiting]

    def _integrate(self, reading: DisplacementReading, stamp_s: float) -> OdometryEstimate:
        last_stamp_s, self._last_stamp_s = self._last_stamp_s, stamp_s
        bridge, tangent = self._tangents(reading)
        seconds = reading.duration_s
        if seconds is None:
            self._miss(UNKNOWN_S)
            seconds = max(0.0, stamp_s - (stamp_s if last_stamp_s is None else last_stamp_s))
        elif reading.lost:
            self._miss((reading.lost + 1) * seconds)
        self._bridge(bridge, reading.lost * seconds)
        if self._board is not None:
            self._board = _advanced(self._board, reading)
        if self._doubted is not None:
            self._doubted = _advanced(self._doubted, reading)
        self._move(tangent, seconds)
        self._follower.follow(
            (reading.lost + 1) * seconds, keep_room=self._uncertainty.gap != NOTHING
        )
        twist = self._signed(tangent).over(seconds) if reading.duration_s else None
        covariance = self._uncertainty.total(self._follower.wrong)
        return OdometryEstimate(stamp_s, self._follower.pose, twist, covariance)

    def _bridge(self, tangent: Pose, seconds: float) -> None:
        """Motion that was not told, taken to be this one."""
        if self._board is not None:
            self._board = self._board.moved(roll(tangent))
        if self._doubted is not None:
            self._doubted = self._doubted.moved(roll(tangent))
        self._move(tangent, seconds)

    def _bridge_until_pose(self, lost: int) -> None:
        """Displacements are missing that the pose includes; nobody knows what comes after it."""
        if lost and self._last is not None:
            tangent, period_s = self._last
            self._miss((lost + 1) * period_s)
            self._bridge(tangent.times(lost, lost, lost), lost * period_s)

    def _move(self, tangent: Pose, seconds: float) -> None:
        """Along a tangent in the board's body axes."""
        part = self._signed(tangent)
        self._uncertainty.move(self._follower.target.yaw_rad, part)
        self._follower.move(
            roll(part), self._settings.fastest_mps * seconds, self._settings.fastest_radps * seconds
        )
        self._unproved_s += seconds

    def _tangents(self, reading: DisplacementReading) -> tuple[Pose, Pose]:
        """In the board's body axes: of the lost displacements before this one, and of this one.

        What was lost is taken to have been like the motion on both sides of it.
        """
        if reading.duration_s is None:
            self._last = None
            return Pose(), self._tangent(reading, 0.0)
        half = min(reading.lost, LONGEST_BRIDGE) / 2
        last_turn_rad = self._last[0].yaw_rad if self._last else reading.dyaw_rad
        tangent = self._tangent(reading, half * (last_turn_rad + reading.dyaw_rad))
        last = self._last[0] if self._last else tangent
        self._last = (tangent, reading.duration_s)
        return (last + tangent).times(half, half, half), tangent

    def _tangent(self, reading: DisplacementReading, bridged_rad: float) -> Pose:
        if reading.frame == "body" or self._board is None:
            return _chord(reading)
        return unroll(_chord(reading).turned(-self._board.yaw_rad - bridged_rad))

    def _miss(self, duration_s: float) -> None:
        self._uncertainty.miss(duration_s, self._settings.fastest_mps, self._settings.fastest_radps)

    def _signed(self, tangent: Pose) -> Pose:
        return tangent.times(*self._axis_signs)


def _chord(reading: DisplacementReading) -> Pose:
    return Pose(reading.dx_m, reading.dy_m, reading.dyaw_rad)


def _advanced(board: Pose, reading: DisplacementReading) -> Pose:
    """A pose in the board's frame after this displacement."""
    if reading.frame == "earth":
        return board + _chord(reading)
    return board.moved(roll(_chord(reading)))
