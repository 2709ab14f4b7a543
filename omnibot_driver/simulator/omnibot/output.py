# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's output other than IMU frames: odometry frames, and the text of a paused board.

This module knows periods and counters. It must not know the board's modes.
"""

from omnibot_driver.simulator.omnibot.motors import TICK_S
from omnibot_driver.simulator.omnibot.odometry import Odometry
from omnibot_driver.simulator.omnibot.settings import BoardSettings
from omnibot_driver.simulator.omnibot.wire import delta_frame, paused_text, pose_frame

TICKS_PER_POSE = 20
TICKS_PER_TEXT = 100


class Output:
    """The output of a board since its boot. At the boot, all sequence numbers are zero."""

    def __init__(self, settings: BoardSettings) -> None:
        self._byte_order = settings.pose_byte_order
        self._ticks_per_delta = round(settings.delta_period_s / TICK_S)
        self._delta_seq = self._pose_seq = 0
        self.pause()

    def pause(self) -> None:
        """Begin a pause of the board. Its first text, with the number 0, is due at once."""
        self._ticks_to_text = self._number = 0

    def text(self) -> list[bytes]:
        """Return the texts to send in this tick of a pause: one text, or none."""
        due = self._ticks_to_text == 0
        self._ticks_to_text = (self._ticks_to_text or TICKS_PER_TEXT) - 1
        if not due:
            return []
        number = self._number
        self._number = (number + 1) % 256
        return [paused_text(number)]

    def odometry_frames(self, tick: int, odometry: Odometry) -> list[bytes]:
        """Return the frames that are due ``tick`` ticks after the boot."""
        frames = []
        if tick % self._ticks_per_delta == 0:
            frames.append(delta_frame(odometry.difference(), self._delta_seq))
            self._delta_seq = (self._delta_seq + 1) % 256
        if tick % TICKS_PER_POSE == 0:
            pose = odometry.reported
            frame = pose_frame(
                pose.x_mm, pose.y_mm, pose.theta_mrad, self._pose_seq, self._byte_order
            )
            frames.append(frame)
            self._pose_seq = (self._pose_seq + 1) % 256
        return frames
