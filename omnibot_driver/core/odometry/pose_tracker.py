# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot's way in the odometry frame: where it is, what is given out, how far that may be off.

Composes the follower and the uncertainty. Its input are tangents in the board's body axes, of the
size that the board takes them for; what it tells is in REP-103's axes and of true size. Knows
times; not which of the board's words to believe.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, Signs, log_of, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.correction_smoother import CorrectionSmoother
from omnibot_driver.core.odometry.covariance import NOTHING, OdometryNoise, Uncertainty

Factors = tuple[float, float, float]
"""Of x, y and yaw."""
AS_TOLD: Final[tuple[float, ...]] = (1.0, 1.0, 1.0)


class PoseTracker:
    """``axis_signs`` turn x, y and yaw of the board's body axes into REP-103's."""

    def __init__(self, axis_signs: Signs) -> None:
        self.rolled = Pose()
        """All motion since the driver began, as one tangent in the board's axes, of true size."""
        self._axis_signs = axis_signs
        self.follower, self.uncertainty = CorrectionSmoother(), Uncertainty(OdometryNoise())

    def configure(
        self, noise: OdometryNoise, *, scale: tuple[float, float], fastest: tuple[float, float]
    ) -> None:
        """``scale``: true way and turn over those that the board tells; ``fastest``: m/s, rad/s."""
        x, y, yaw = self._axis_signs
        linear, angular = scale
        self._size = linear, linear, angular
        self._signed_size = x * linear, y * linear, yaw * angular
        self._fastest_mps, self._fastest_radps = fastest
        self.uncertainty.noise = noise

    def begin(self) -> None:
        """Begin the odometry frame at the robot's present pose."""
        self.follower, self.uncertainty = CorrectionSmoother(), Uncertainty(self.uncertainty.noise)

    def rates(self, tangent: Pose, seconds: float) -> tuple[BodyTwist, BodyTwist]:
        """The twist of this motion in this time: in REP-103's axes, and in the board's."""
        rolling = _times(tangent, self._size).over(seconds)
        if self._signed_size == self._size:
            return rolling, rolling
        return _times(tangent, self._signed_size).over(seconds), rolling

    def way_to(self, place: Pose) -> Pose:
        """The tangent that leads there from where the robot is, by the shorter turn."""
        x, y, yaw = self._signed_size
        return log_of(self.follower.target.way_to(place)).times(1 / x, 1 / y, 1 / yaw)

    def move(self, tangent: Pose, seconds: float, stamped_s: float) -> None:
        """Along a tangent, and no further than by the stamps it can be."""
        follower, chord = self.follower, roll(self._part(tangent))
        move = follower.move if stamped_s >= seconds else follower.trail
        move(chord, self._fastest_mps * stamped_s, self._fastest_radps * stamped_s)

    def miss(self, duration_s: float) -> None:
        """Add a time without reports."""
        self.uncertainty.miss(duration_s, self._fastest_mps, self._fastest_radps)

    def resume(self, tangent: Pose) -> None:
        """Add the motion of a gap, before the gap has any other effect."""
        self.follower.correct(roll(self._part(tangent)), 0.0)

    def correct(self, tangent: Pose) -> None:
        """Correct the pose; the motion of all gaps is known."""
        if self.uncertainty.gap != NOTHING:  # more than rounding
            self.rolled += _times(tangent, self._size)
        self.follower.correct(roll(_times(tangent, self._signed_size)))
        self.uncertainty.settle()

    def _part(self, tangent: Pose) -> Pose:
        """Add to the rolled motion and its uncertainty; returns the motion in REP-103's axes."""
        self.rolled += _times(tangent, self._size)
        signed = _times(tangent, self._signed_size)
        self.uncertainty.move(self.follower.target.yaw_rad, signed)
        return signed


def _times(tangent: Pose, factors: Factors) -> Pose:
    return tangent if factors == AS_TOLD else tangent.times(*factors)
