"""From displacements to pose, twist and covariance, from where the driver attached on.

Displacements come either in the body's axes or as differences of two positions in the board's own
earth frame. The latter need the board's heading, which its poses tell: displacements wait for the
first pose, so a board that has driven before does not rotate the odometry. This module knows SE(2);
it knows no bytes, no clock and no ROS.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.board import DisplacementReading, PoseReading
from omnibot_driver.core.kinematics import BodyTwist

Signs = tuple[int, int, int]

LONGEST_WAIT_S: Final = 1.0
"""Board time without any pose after which heading 0 is assumed."""
BELIEVED_TURN_RAD: Final = 0.1
"""A pose whose heading is further off than this must be confirmed by the next."""
INITIAL_VARIANCE: Final = 1e-6
"""(1 mm)² and (1 mrad)²: about the resolution of the board's own poses."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Position in m and unwrapped yaw in rad, in the odometry frame."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def turned(self, angle_rad: float) -> "Pose":
        """The same displacement seen from axes turned by ``-angle_rad``; yaw stays."""
        cos, sin = math.cos(angle_rad), math.sin(angle_rad)
        return Pose(cos * self.x_m - sin * self.y_m, sin * self.x_m + cos * self.y_m, self.yaw_rad)

    def moved(self, displacement: "Pose") -> "Pose":
        """The pose after a displacement given in this pose's own axes."""
        way = displacement.turned(self.yaw_rad)
        return Pose(self.x_m + way.x_m, self.y_m + way.y_m, self.yaw_rad + way.yaw_rad)

    def over(self, duration_s: float) -> BodyTwist:
        """The constant twist that makes this tangent in this time."""
        return BodyTwist(self.x_m / duration_s, self.y_m / duration_s, self.yaw_rad / duration_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryNoise:
    """How uncertainty grows: it is a random walk over the way travelled.

    Standard deviations after 1 m in m, after 1 m in rad (a wheel's slip turns the body), and after
    turning 1 rad in rad.
    """

    m_per_sqrt_m: float = 0.02
    rad_per_sqrt_m: float = 0.02
    rad_per_sqrt_rad: float = 0.02


@dataclass(frozen=True, slots=True)
class Covariance:
    """Of (x, y, yaw) in the odometry frame: m², m·rad, rad²; symmetric."""

    xx: float = INITIAL_VARIANCE
    xy: float = 0.0
    x_yaw: float = 0.0
    yy: float = INITIAL_VARIANCE
    y_yaw: float = 0.0
    yaw_yaw: float = INITIAL_VARIANCE

    def moved(
        self, dx_m: float, dy_m: float, dyaw_rad: float, noise: OdometryNoise
    ) -> "Covariance":
        """After a displacement given in the odometry frame: a wrong yaw makes a wrong way."""
        way = math.hypot(dx_m, dy_m)
        along = noise.m_per_sqrt_m**2 * way
        turning = noise.rad_per_sqrt_m**2 * way + noise.rad_per_sqrt_rad**2 * abs(dyaw_rad)
        return Covariance(
            xx=self.xx - 2 * dy_m * self.x_yaw + dy_m**2 * self.yaw_yaw + along,
            xy=self.xy + dx_m * self.x_yaw - dy_m * self.y_yaw - dx_m * dy_m * self.yaw_yaw,
            x_yaw=self.x_yaw - dy_m * self.yaw_yaw,
            yy=self.yy + 2 * dx_m * self.y_yaw + dx_m**2 * self.yaw_yaw + along,
            y_yaw=self.y_yaw + dx_m * self.yaw_yaw,
            yaw_yaw=self.yaw_yaw + turning,
        )


@dataclass(frozen=True, slots=True)
class OdometryEstimate:
    """At ``stamp_s``: pose and covariance in the odometry frame, twist in the body's.

    ``twist`` is None where the time that the displacement took is not known.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist | None
    covariance: Covariance


def unroll(chord: Pose) -> Pose:
    """The constant twist times duration (the SE(2) logarithm) whose result is this displacement."""
    half = chord.yaw_rad / 2
    stretch = half / math.sin(half) if half else 1.0
    along = chord.turned(-half)
    return Pose(stretch * along.x_m, stretch * along.y_m, chord.yaw_rad)


def roll(tangent: Pose) -> Pose:
    """The displacement that a constant twist times duration makes (the SE(2) exponential)."""
    half = tangent.yaw_rad / 2
    shrink = math.sin(half) / half if half else 1.0
    along = tangent.turned(half)
    return Pose(shrink * along.x_m, shrink * along.y_m, tangent.yaw_rad)


class Odometry:
    """Adds displacements up.

    ``noise`` may be replaced at any time. ``axis_signs`` turn x, y and yaw of the board's body axes
    into REP-103's; the board's earth frame and heading are its own affair and keep its signs.
    """

    def __init__(self, noise: OdometryNoise, axis_signs: Signs = (1, 1, 1)) -> None:
        self.noise = noise
        self.heading_assumed = False
        """True once a board sent no pose and its heading had to be taken for 0."""
        self._axis_signs = axis_signs
        self.reset()
        self.attach()

    def reset(self) -> None:
        """The odometry frame begins where the robot stands."""
        self._pose = Pose()
        self._covariance = Covariance()
        self._waiting: list[tuple[DisplacementReading, float]] = []

    def attach(self) -> None:
        """The board's earth frame may be another one from now on; our pose goes on from here."""
        self._board_yaw_rad: float | None = None
        self._doubted_rad: float | None = None
        self._waiting = []

    def displace(self, reading: DisplacementReading, stamp_s: float) -> list[OdometryEstimate]:
        """The estimates that this displacement completes: none while the heading is unknown."""
        self._waiting.append((reading, stamp_s))
        if reading.frame == "earth" and self._board_yaw_rad is None:
            if sum(waiting.duration_s or 0.0 for waiting, _ in self._waiting) < LONGEST_WAIT_S:
                return []
            self.heading_assumed = True
            self._board_yaw_rad = 0.0
        return self._release()

    def learn_heading(self, pose: PoseReading) -> list[OdometryEstimate]:
        """Take the board's heading from its pose; releases the displacements that waited for it."""
        if not math.isfinite(pose.yaw_rad):
            return []
        if self._board_yaw_rad is None:
            self._board_yaw_rad = pose.yaw_rad - sum(item.dyaw_rad for item, _ in self._waiting)
            return self._release()
        surprise = math.remainder(pose.yaw_rad - self._board_yaw_rad, math.tau)
        confirmed = self._doubted_rad is not None and _near(surprise, self._doubted_rad)
        if _near(surprise, 0.0) or confirmed:
            self._board_yaw_rad, self._doubted_rad = pose.yaw_rad, None
        else:
            self._doubted_rad = surprise
        return []

    def _release(self) -> list[OdometryEstimate]:
        waiting, self._waiting = self._waiting, []
        return [self._integrate(reading, stamp_s) for reading, stamp_s in waiting]

    def _integrate(self, reading: DisplacementReading, stamp_s: float) -> OdometryEstimate:
        tangent = Pose(reading.dx_m, reading.dy_m, reading.dyaw_rad)
        if reading.frame == "earth":
            board_yaw_rad = self._board_yaw_rad or 0.0
            tangent = unroll(tangent.turned(-board_yaw_rad))
            self._board_yaw_rad = board_yaw_rad + reading.dyaw_rad
        x, y, yaw = self._axis_signs
        tangent = Pose(x * tangent.x_m, y * tangent.y_m, yaw * tangent.yaw_rad)
        before, self._pose = self._pose, self._pose.moved(roll(tangent))
        self._covariance = self._covariance.moved(
            self._pose.x_m - before.x_m, self._pose.y_m - before.y_m, tangent.yaw_rad, self.noise
        )
        twist = tangent.over(reading.duration_s) if reading.duration_s else None
        return OdometryEstimate(stamp_s, self._pose, twist, self._covariance)


def _near(a_rad: float, b_rad: float) -> bool:
    return abs(math.remainder(a_rad - b_rad, math.tau)) <= BELIEVED_TURN_RAD
