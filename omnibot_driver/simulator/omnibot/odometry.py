# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The firmware's odometry from its encoders (manual, Odometry equation).

The displacements of the 25 Hz messages are rounded, so their sum has rounding errors. This module
must not know modes, time, or the true pose.
"""

from omnibot_driver.simulator.omnibot.chassis import PlanarPose, body_from_rims
from omnibot_driver.simulator.omnibot.settings import BoardPose, BoardSettings
from omnibot_driver.simulator.omnibot.wire import Triple


class Odometry:
    """The board's own pose in its earth frame, and the motion that the board has not sent yet."""

    _body_unsent: tuple[float, float, float]
    _counts_unsent: Triple

    def __init__(self, settings: BoardSettings, pose: BoardPose) -> None:
        self.pose = PlanarPose(pose.x_mm / 1000, pose.y_mm / 1000, pose.theta_mrad / 1000)
        self._settings = settings
        self._rim_m_per_count = settings.rim_m_per_count
        self._begin_difference()

    @property
    def reported(self) -> BoardPose:
        """The board's own pose in mm and mrad, as the board sends it at 5 Hz."""
        return BoardPose(*(1000 * value for value in self.pose))

    def integrate(self, counts: Triple) -> None:
        """Add the encoder counts of wheels A, B, C in one control tick."""
        (a, b, c), rim_m = counts, self._rim_m_per_count
        moved = body_from_rims((a * rim_m, b * rim_m, c * rim_m), self._settings.base_radius_m)
        (dx, dy, dyaw), (x_sign, y_sign, yaw_sign) = moved, self._settings.axis_signs
        dx, dy, dyaw = x_sign * dx, y_sign * dy, yaw_sign * dyaw
        self.pose = self.pose.moved(dx, dy, dyaw)
        x, y, yaw = self._body_unsent
        self._body_unsent = (x + dx, y + dy, yaw + dyaw)
        a_unsent, b_unsent, c_unsent = self._counts_unsent
        self._counts_unsent = (a_unsent + a, b_unsent + b, c_unsent + c)

    def difference(self) -> Triple:
        """Return the motion since the last call, in the units of the 25 Hz message."""
        words = self._counts_unsent
        if self._settings.frame == "body":
            words = _tenths(self._body_unsent)
        elif self._settings.frame == "earth":
            x, y, yaw = self.pose
            sent_x, sent_y, sent_yaw = self._pose_sent
            words = _tenths((x - sent_x, y - sent_y, yaw - sent_yaw))
        self._begin_difference()
        return words

    def _begin_difference(self) -> None:
        self._pose_sent = self.pose
        self._body_unsent = (0.0, 0.0, 0.0)
        self._counts_unsent = (0, 0, 0)


def _tenths(moved: tuple[float, float, float]) -> Triple:
    """Convert m and rad to 0.1 mm and 0.1 mrad, limited to int16."""
    x, y, yaw = (max(-32768, min(32767, round(value * 10_000))) for value in moved)
    return x, y, yaw
