# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot's motion in the odometry frame: best pose, published pose and uncertainty.

The inputs are the motions that the board reports, as twist x time (tangents). They are in the
board's axes, and based on assumed wheel sizes. The outputs are in REP-103's axes, with true
distances and turns. This module does not know which of the board's reports are right.
"""

from typing import Final

from omnibot_driver.core.geometry.se2 import Pose, Signs, log_of, roll
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.correction_smoother import CorrectionSmoother
from omnibot_driver.core.odometry.covariance import NOTHING, OdometryNoise, Uncertainty

Factors = tuple[float, float, float]
"""Factors for x, y and yaw of a motion that the board reports: scales, and signs of the axes."""
AS_TOLD: Final[tuple[float, ...]] = (1.0, 1.0, 1.0)


class PoseTracker:
    """The tracked pose of one robot.

    ``axis_signs`` convert x, y and yaw of the board's body axes to REP-103.
    """

    def __init__(self, axis_signs: Signs) -> None:
        self.rolled = Pose()
        """Sum of the tangents (twist x time) of all motions since the driver began.

        It has the board's axes, but true distances and turns: the board's distances and turns are
        multiplied by the scales of the settings.
        """
        self._axis_signs = axis_signs
        self.follower, self.uncertainty = CorrectionSmoother(), Uncertainty(OdometryNoise())

    def configure(
        self, noise: OdometryNoise, *, scale: tuple[float, float], fastest: tuple[float, float]
    ) -> None:
        """Use new settings from the next motion on.

        ``scale``: true distance and turn, divided by the reported ones. ``fastest``: the robot's
        largest speed in m/s and yaw rate in rad/s.
        """
        x, y, yaw = self._axis_signs
        linear, angular = scale
        self._size = linear, linear, angular
        self._signed_size = x * linear, y * linear, yaw * angular
        self._fastest_mps, self._fastest_radps = fastest
        self.uncertainty.noise = noise

    def begin(self) -> None:
        """Begin the odometry frame at the robot's current pose."""
        self.follower, self.uncertainty = CorrectionSmoother(), Uncertainty(self.uncertainty.noise)

    def rates(self, tangent: Pose, seconds: float) -> tuple[BodyTwist, BodyTwist]:
        """Return the twist of a motion that took ``seconds``, in two systems of axes.

        The first result is in REP-103's axes. The second is the same twist in the board's axes.
        """
        rolling = _times(tangent, self._size).over(seconds)
        if self._signed_size == self._size:
            return rolling, rolling
        return _times(tangent, self._signed_size).over(seconds), rolling

    def way_to(self, place: Pose) -> Pose:
        """Return the tangent (twist x time) from the best known pose to ``place``.

        Like the board's reports, the tangent is in the board's body axes, and not corrected by
        ``scale``. It turns the shorter way.
        """
        x, y, yaw = self._signed_size
        return log_of(self.follower.target.way_to(place)).times(1 / x, 1 / y, 1 / yaw)

    def move(self, tangent: Pose, seconds: float, stamped_s: float) -> None:
        """Move along a tangent (twist x time).

        ``seconds``, ``stamped_s``: its duration in s, by the board's clock and by the stamps. The
        published pose moves only as far as the robot can drive in ``stamped_s``.
        """
        follower, chord = self.follower, roll(self._part(tangent))
        move = follower.move if stamped_s >= seconds else follower.trail
        move(chord, self._fastest_mps * stamped_s, self._fastest_radps * stamped_s)

    def miss(self, duration_s: float, counted_s: float = 0.0) -> None:
        """Add the uncertainty of a gap of ``duration_s`` in the board's reports.

        ``counted_s``: duration of the gap's first part, if its uncertainty was added earlier.
        """
        self.uncertainty.miss(duration_s, self._fastest_mps, self._fastest_radps, counted_s)

    def halt(self, tangent: Pose) -> None:
        """Add the uncertainty that arises because the robot came to rest when its board restarted.

        ``tangent``: half of the longest possible motion until the robot was at rest.
        """
        way = _times(tangent, self._size)
        self.uncertainty.halt(way.way_m, way.yaw_rad)

    def resume(self, tangent: Pose) -> None:
        """Add the motion during a gap, which a pose of the board has shown.

        The published pose takes up this motion no faster than the robot can drive. ``tangent``: the
        motion during the gap (twist x time).
        """
        self.follower.correct(roll(self._part(tangent)), 0.0)

    def correct(self, tangent: Pose) -> None:
        """Correct the pose. The published pose takes up this correction gradually.

        The uncertainty of all gaps until now is removed.

        ``tangent``: the correction, as a motion (twist x time) from the best known pose so far.
        """
        if self.uncertainty.gap != NOTHING:  # else the tangent is only rounding
            self.rolled += _times(tangent, self._size)
        self.follower.correct(roll(_times(tangent, self._signed_size)))
        self.uncertainty.settle()

    def bound(self, tangent: Pose) -> None:
        """Set the uncertainty of all gaps to the error that the board's pose has shown.

        ``tangent``: this error (twist x time). It stays uncorrected, because ``use_board_pose`` is
        False.
        """
        error = _times(tangent, self._size)
        self.uncertainty.bound(error.way_m, error.yaw_rad)

    def _part(self, tangent: Pose) -> Pose:
        """Record a reported motion; return it in REP-103's axes, with true distances and turns.

        The motion is added to ``rolled``, and its errors to the uncertainty. ``tangent``: the
        motion (twist x time), as the board reports it.
        """
        self.rolled += _times(tangent, self._size)
        signed = _times(tangent, self._signed_size)
        self.uncertainty.move(self.follower.target.yaw_rad, signed)
        return signed


def _times(tangent: Pose, factors: Factors) -> Pose:
    return tangent if factors == AS_TOLD else tangent.times(*factors)
