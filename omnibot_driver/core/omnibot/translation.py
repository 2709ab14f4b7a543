# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The translation of frames into readings in SI units, with the number of lost frames.

Source: the manual ver. 0.3. Deltas are in 0.1 mm and 0.1 mrad; poses in mm and mrad.
"""

import math
from typing import Final

from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.omnibot.frame_schedule import LENGTH, FrameSchedule
from omnibot_driver.core.omnibot.frames import (
    DeltaFrame,
    Frame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    Words,
)
from omnibot_driver.core.omnibot.misconfiguration import MisconfigurationChecks
from omnibot_driver.core.omnibot.modes import Happening, ModeTracker
from omnibot_driver.core.omnibot.schedule import Schedule
from omnibot_driver.core.omnibot.sequence import Sequence
from omnibot_driver.core.omnibot.settings import OmniBotSettings
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    PausedReading,
    PoseReading,
    Reading,
    Vector3,
)

DELTA_LSB: Final = 1e-4
"""Size of one count of a delta, in m or rad: 0.1 mm or 0.1 mrad."""
# The board sends one text a second, and the driver waits less than 10 s for the result of a reset.
MOST_TEXTS_LOST: Final = 9
"""Largest number of "Paused" texts that can have been lost since the last received one.

If the counter in the texts shows more, the counter has begun again, because the board has
restarted.
"""
FULL: Final = 4000
"""If a read has at least this number of bytes, the kernel's buffer of 4 KiB was probably full. The
number is below 4096, because bytes that the decoder keeps for later are not counted."""
BEHIND_S: Final = 0.5
"""Delay of a read, in s, above which the driver checks whether the next read is late as well.
``BURST_S``: tolerance of this check, in s."""
BURST_S: Final = 0.05
LEAST_S: Final = 0.2
"""Shortest delay of a read, in s, for which the driver corrects arrival times. A shorter delay may
only be an error of the board's clock."""
POSE_LSB_M: Final = 1e-3
POSE_LSB_RAD: Final = 1e-3


class Translation:
    """Translates the frames of one line. Infers the board's mode and wrong settings from them.

    * ``settings``: may be replaced, except ``delta_period_s``.
    * ``singles_to_come``: how many more IMU frames the fast path ``single_imu`` may decode.
    * ``heard_s``: arrival time in s of the last decoded bytes.
    """

    def __init__(self, settings: OmniBotSettings) -> None:
        self.settings = settings
        self._schedule = Schedule(settings.delta_period_s)
        self.suspicion = MisconfigurationChecks(self._schedule)
        self._sequence = Sequence(self._schedule)
        self.connect()

    def connect(self) -> None:
        """Begin a new connection.

        From the last connection, keep only the board's counters and the checks of the settings.
        """
        self.modes = ModeTracker(self._schedule)
        self._rhythm = FrameSchedule(self._schedule)
        self._sequence.reconnect()
        self._paused_count: int | None = None
        self._imus = 0
        self.singles_to_come = self._most_singles = 0
        """Number of IMU frames that ``single_imu``, the fast path, may still decode. Each frame
        reduces it by 1. ``_most_singles``: this number at the beginning."""
        self.heard_s = -math.inf
        self._behind_s = 0.0
        """Delay of the last read in s: the time from the sending of its last byte to the read."""

    def readings(self, found: list[Frame], skipped: list[int], now: float) -> list[Reading]:
        """Return the readings of the frames ``found``, which one read at ``now`` completed.

        ``skipped``: number of discarded bytes before each frame.
        """
        self._catch_up()
        lengths = [LENGTH.get(type(frame), 0) for frame in found]
        left = sum(skipped) + sum(lengths)
        before_s = self.heard_s - self._behind_s
        may_wait = left >= FULL or self._behind_s > BEHIND_S
        sent_s = self._sent_s(left, now) if may_wait else now
        self.heard_s, self._behind_s = now, now - sent_s
        readings = []
        for frame, length, before in zip(found, lengths, skipped, strict=True):
            left -= before + length
            came_s = max(before_s, sent_s - left / self._schedule.bytes_per_s)
            readings.append(self._read(frame, came_s, before))
        usual = self._paused_count is None and not any(skipped)
        self.singles_to_come = self._most_singles = self.modes.imus_to_come - 1 if usual else 0
        return readings

    def _sent_s(self, count: int, now: float) -> float:
        """Return when the board sent the last of the ``count`` bytes that were read at ``now``.

        If the read was late, the board sent them directly after those of the previous read.
        Otherwise, the result is ``now``.
        """
        duration_s, elapsed_s = count / self._schedule.bytes_per_s, now - self.heard_s
        # A full buffer keeps its bytes and loses only later ones, so ``count`` is right then, too.
        waited = count >= FULL or duration_s > 2 * elapsed_s + BURST_S
        sent_s = self.heard_s - self._behind_s + duration_s
        return sent_s if waited and -math.inf < sent_s < now - LEAST_S else now

    def apply(self, happening: Happening) -> None:
        """Change the mode as the mode table says for this event.

        Raises RequestRefused if the event is not allowed in the present mode.
        """
        self._catch_up()
        self.modes.apply(happening)

    def _catch_up(self) -> None:
        """Count the IMU frames that ``single_imu`` decoded, and update mode and schedule."""
        singles = self._most_singles - self.singles_to_come
        self.singles_to_come = self._most_singles = 0
        if singles:
            self.modes.hear_imus(singles)
            self._rhythm.hear_imus(singles)
            self._imus += singles

    def _read(self, frame: Frame, now: float, skipped: int) -> Reading:
        self.modes.hear(frame)
        paused_count, self._paused_count = self._paused_count, None
        match frame:
            case ImuFrame():
                self._imus += 1
                scale = self.settings.imu
                return ImuReading(
                    scale.specific_force(frame.accel),
                    scale.angular_velocity(frame.gyro),
                    self._rhythm.hear(ImuFrame, skipped),
                )
            case DeltaFrame():
                self._rhythm.hear(DeltaFrame, skipped)
                return self._displacement(frame, now)
            case PoseFrame(x, y, theta, seq):
                self._rhythm.hear(PoseFrame, skipped)
                step = self._sequence.pose(seq, now)
                pose = PoseReading(
                    x * POSE_LSB_M,
                    y * POSE_LSB_M,
                    theta * POSE_LSB_RAD,
                    lost=step.lost,
                    restarted=step.restarted,
                    ambiguous=self._sequence.ambiguous,
                )
                self.suspicion.posed(frame, pose, self.settings.pose_byte_order)
                return pose
            case PausedFrame(count):
                self._paused_count = count
                self._sequence.pause()
                self._rhythm = FrameSchedule(self._schedule)
                if paused_count is None:
                    return PausedReading()
                lost = (count - paused_count - 1) % 256
                return PausedReading(continues=lost <= MOST_TEXTS_LOST)

    def _displacement(self, frame: DeltaFrame, now: float) -> DisplacementReading:
        imus, self._imus = self._imus, 0
        step = self._sequence.delta(frame.seq, now, imus=imus)
        dx, dy, dyaw = frame.dx * DELTA_LSB, frame.dy * DELTA_LSB, frame.dtheta * DELTA_LSB
        if self.settings.delta_frame == "wheel_counts":
            dx, dy, dyaw = self._rolled((frame.dx, frame.dy, frame.dtheta))
        displacement = DisplacementReading(
            dx,
            dy,
            dyaw,
            frame="earth" if self.settings.delta_frame == "earth" else "body",
            duration_s=step.duration_s,
            lost=step.lost,
            restarted=step.restarted,
            doubtful=step.doubtful,
        )
        self.suspicion.displaced(displacement)
        self.suspicion.spaced(displacement, imus, now)
        return displacement

    def _rolled(self, counts: Words) -> Vector3:
        """Return the displacement (m, m, rad) from wheel counts (manual, "Odometry equation")."""
        settings = self.settings
        a, b, c = (count * math.tau / settings.counts_per_revolution for count in counts)
        wheels = OmniKinematics(settings.wheel_radius_m, settings.base_radius_m)
        rolled = wheels.body_twist((a, b, c))
        return rolled.vx_mps, rolled.vy_mps, rolled.yaw_rate_radps
