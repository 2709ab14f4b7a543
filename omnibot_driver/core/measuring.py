# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From readings to measurements: stamped, checked, integrated, corrected, counted.

Composes the board's clock, plausibility, odometry and the IMU. Knows no commands and no modes.
"""

from collections.abc import Sequence

from omnibot_driver.core.board import (
    Board,
    DisplacementReading,
    ImuReading,
    PausedReading,
    PoseReading,
    Reading,
)
from omnibot_driver.core.device_clock import DeviceClock
from omnibot_driver.core.inertial import ImuCorrection, ImuEstimate, Inertial
from omnibot_driver.core.odometry import Odometry, OdometryEstimate, OdometrySettings
from omnibot_driver.core.plausibility import MotionLimits, Plausibility, Refused
from omnibot_driver.core.se2 import Signs
from omnibot_driver.core.tally import Tally

Estimate = ImuEstimate | OdometryEstimate
Measured = tuple[Reading, Sequence[Estimate]]
"""A reading that is sure, and what came of it."""
_SAMPLES = (ImuReading, DisplacementReading)
"""What has a stamp of its own."""


class Measuring:
    """Everything between what a board says and what is told of it."""

    def __init__(
        self,
        board: Board,
        odometry: OdometrySettings,
        motion: MotionLimits,
        imu: ImuCorrection,
        axis_signs: Signs,
    ) -> None:
        self.odometry = Odometry(odometry, axis_signs)
        self.inertial = Inertial(board, imu)
        self.tally = Tally()
        self._board = board
        self._clock = DeviceClock(board.tick_s)
        self._plausibility = Plausibility(motion, board.tick_s)

    def configure(
        self, odometry: OdometrySettings, motion: MotionLimits, imu: ImuCorrection
    ) -> None:
        """New settings, from the next reading on."""
        self.odometry.settings = odometry
        self._plausibility.limits = motion
        self.inertial.configure(imu)

    @property
    def refused(self) -> Refused:
        """What the wire said and nobody was told."""
        checked = self._plausibility
        return Refused(
            checked.refused_imu, checked.refused_displacements, self.odometry.refused_poses
        )

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock runs than ours."""
        return self._clock.skew_ppm

    def restart(self) -> None:
        """What the board does from here on has nothing to do with what it did before."""
        self._clock.restart()

    def take_in(self, readings: Sequence[Reading], now: float) -> list[Measured]:
        """What is sure of these, which came in at ``now``, and of those before that waited."""
        stamps_s = self._clock.stamps(readings, now, self._board.edge)
        if readings and isinstance(readings[-1], _SAMPLES):
            self.tally.read(now - stamps_s[-1])
        measured: list[Measured] = []
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            self.tally.hear(reading)
            for sure, at_s in self._plausibility.admit(reading, stamp_s):
                measured.append((sure, self._estimates(sure, at_s)))
        return measured

    def release(self) -> list[Measured]:
        """What waited for readings that will not come."""
        released = self._plausibility.release()
        return [(reading, self._estimates(reading, stamp_s)) for reading, stamp_s in released]

    def _estimates(self, reading: Reading, stamp_s: float) -> Sequence[Estimate]:
        match reading:
            case ImuReading():
                return [self.inertial.estimate(reading, stamp_s)]
            case DisplacementReading():
                self.inertial.displaced(reading)
                return self.odometry.displace(reading, stamp_s)
            case PoseReading():
                return self.odometry.settle(reading)
            case PausedReading():
                self._clock.restart()
                return []
