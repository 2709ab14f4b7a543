# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot's way in the odometry frame: where it is, what is given out, how far that may be off.

Composes the follower and the uncertainty. It is told tangents in the board's body axes, of the size
that the board takes them for; what it tells is in REP-103's axes and of true size. Knows times; not
which of the board's words to believe.
"""

from typing import Final

from omnibot_driver.core.follower import Follower
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.se2 import Pose, Signs, roll, unroll
from omnibot_driver.core.uncertainty import NOTHING, Covariance, OdometryNoise, Uncertainty

Factors = tuple[float, float, float]
"""Of x, y and yaw."""
AS_TOLD: Final[Factors] = (1.0, 1.0, 1.0)


class Track:
    """``axis_signs`` turn x, y and yaw of the board's body axes into REP-103's."""

    def __init__(self, axis_signs: Signs) -> None:
        self.rolled = Pose()
        """All motion since the driver began, as one tangent in the board's axes, of true size."""
        self._axis_signs = axis_signs
        self._follower, self._uncertainty = Follower(), Uncertainty(OdometryNoise())

    def configure(
        self,
        noise: OdometryNoise,
        *,
        linear_scale: float,
        angular_scale: float,
        fastest_mps: float,
        fastest_radps: float,
    ) -> None:
        """The scales are true way and turn over those that the board tells."""
        x, y, yaw = self._axis_signs
        self._size = linear_scale, linear_scale, angular_scale
        self._signed_size = x * linear_scale, y * linear_scale, yaw * angular_scale
        self._fastest_mps, self._fastest_radps = fastest_mps, fastest_radps
        self._uncertainty.noise = noise

    def begin(self) -> None:
        """The odometry frame begins where the robot stands."""
        self._follower, self._uncertainty = Follower(), Uncertainty(self._uncertainty.noise)

    @property
    def pose(self) -> Pose:
        """What is given out."""
        return self._follower.pose

    @property
    def covariance(self) -> Covariance:
        """Of ``pose``."""
        return self._uncertainty.total(self._follower.wrong)

    @property
    def gap(self) -> Covariance:
        """Of the motion that nobody reported."""
        return self._uncertainty.gap

    def rates(self, tangent: Pose, seconds: float) -> tuple[BodyTwist, BodyTwist]:
        """Of this motion in this time: in REP-103's axes, and in the board's."""
        rolling = _times(tangent, self._size).over(seconds)
        if self._signed_size == self._size:
            return rolling, rolling
        return _times(tangent, self._signed_size).over(seconds), rolling

    def way_to(self, place: Pose) -> Pose:
        """The tangent that leads there from where the robot is, by the shorter turn."""
        x, y, yaw = self._signed_size
        return unroll(self._follower.target.way_to(place)).times(1 / x, 1 / y, 1 / yaw)

    def move(self, tangent: Pose, seconds: float, stamped_s: float) -> None:
        """Along a tangent, and no further than by the stamps it can be."""
        self.rolled += _times(tangent, self._size)
        part = _times(tangent, self._signed_size)
        self._uncertainty.move(self._follower.target.yaw_rad, part)
        move = self._follower.move if stamped_s >= seconds else self._follower.trail
        move(roll(part), self._fastest_mps * stamped_s, self._fastest_radps * stamped_s)

    def follow(self, seconds: float) -> None:
        """What is given out nears the truth by the share of this time."""
        self._follower.follow(seconds)

    def miss(self, duration_s: float) -> None:
        """Nobody reported the motion of this time."""
        self._uncertainty.miss(duration_s, self._fastest_mps, self._fastest_radps)

    def resume(self, tangent: Pose) -> None:
        """The motion in a gap, told before anything else is made of the gap."""
        self.rolled += _times(tangent, self._size)
        part = _times(tangent, self._signed_size)
        self._uncertainty.move(self._follower.target.yaw_rad, part)
        self._follower.correct(roll(part), 0.0)

    def correct(self, tangent: Pose) -> None:
        """The robot is elsewhere, and all motion in gaps is known."""
        if self._uncertainty.gap != NOTHING:  # more than rounding
            self.rolled += _times(tangent, self._size)
        self._follower.correct(roll(_times(tangent, self._signed_size)))
        self._uncertainty.settle()

    def settle(self) -> None:
        """The motion in all gaps is known now."""
        self._uncertainty.settle()

    def give_up(self) -> None:
        """The motion in all gaps will never be known."""
        self._uncertainty.give_up()


def _times(tangent: Pose, factors: Factors) -> Pose:
    return tangent if factors == AS_TOLD else tangent.times(*factors)
