# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The measurement pipeline: readings are stamped, checked, integrated, corrected and counted.

The method ``hear`` processes IMU readings at once; other readings wait for the method ``flush``.
This module knows readings and the parts that process them; it does not know commands or modes.
"""

from collections.abc import Sequence

from omnibot_driver.core.board import Board, ReadingClock
from omnibot_driver.core.events import Extra
from omnibot_driver.core.geometry.se2 import Signs
from omnibot_driver.core.imu.bias_correction import BiasCorrector, ImuEstimate
from omnibot_driver.core.measurement.outlier_filter import OutlierFilter, Refused, Stamped
from omnibot_driver.core.measurement.statistics import StreamStatistics
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.readings import (
    DisplacementReading,
    EStopButtonReading,
    ExtraReading,
    ImuReading,
    NoticeReading,
    OdometryReading,
    PoseReading,
    Reading,
    ResetReading,
)
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.core.timing.arrival_clock import ArrivalClock
from omnibot_driver.core.timing.device_clock import DeviceClock

Estimate = ImuEstimate | OdometryEstimate | Extra
Measured = tuple[Reading, Sequence[Estimate]]
"""A reading that the outlier filter has passed on, and the estimates that follow from it."""


class MeasurementPipeline:
    """The steps from a board's readings to the published measurements."""

    def __init__(self, board: Board, settings: SessionSettings, axis_signs: Signs) -> None:
        self.odometry = Odometry(settings.odometry, axis_signs)
        self.inertial = BiasCorrector(board, settings.imu)
        self._board = board
        period_s = board.traits.imu_period_s
        self._tally = StreamStatistics(imu_period_s=period_s if board.clock is None else None)
        self._clock: ReadingClock
        if board.clock is not None:
            self._clock = board.clock
        else:
            self._clock = DeviceClock(period_s) if period_s else ArrivalClock()
        self._outliers = OutlierFilter(
            settings.motion, period_s or 0.0, corrected=board.traits.own_odometry
        )
        self._uncounted: list[tuple[Sequence[Reading], float]] = []
        """Reads whose readings are not counted yet. Each entry has the readings of one read, and
        the age in s of the newest reading on arrival."""
        self.undigested: list[Stamped] = []
        """Stamped readings that wait for ``flush``."""

    def configure(self, settings: SessionSettings) -> None:
        """Use new settings from the next reading on."""
        self.odometry.configure(settings.odometry)
        self._outliers.limits = settings.motion
        self.inertial.configure(settings.imu)

    @property
    def refused(self) -> Refused:
        """Numbers of IMU readings, displacements and poses that were rejected as implausible."""
        checked = self._outliers
        return Refused(
            checked.refused_imu, checked.refused_displacements, self.odometry.refused_poses
        )

    @property
    def refused_displacements(self) -> int:
        """Number of displacements rejected as implausible."""
        return self._outliers.refused_displacements

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock is than the host's, in ppm."""
        return self._clock.skew_ppm

    def restart(self) -> None:
        """Forget the state of the clock, because the board begins a new stream of readings."""
        self._clock.restart()

    def hear(self, readings: Sequence[Reading], now: float) -> list[ImuEstimate]:
        """Process readings that arrived at ``now``; return the IMU estimates that result from them.

        Readings that are not from the IMU wait for ``flush``. While such a reading waits, IMU
        readings that come after it wait too.
        """
        estimates: list[ImuEstimate] = []
        edge = self._board.edge
        if len(readings) == 1 and isinstance(alone := readings[0], ImuReading):
            stamp_s = None if self.undigested else self._clock.stamp(alone, now, edge)
            if stamp_s is not None:
                self._uncounted.append((readings, now - stamp_s))
                for sure, at_s in self._outliers.admit_imu(alone, stamp_s):
                    estimates.append(self.inertial.estimate(sure, at_s))
                return estimates
        stamps_s = self._clock.stamps(readings, now, edge)
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            if self.undigested or not isinstance(reading, ImuReading):
                self.undigested.append((reading, stamp_s))
                continue
            for sure, at_s in self._outliers.admit_imu(reading, stamp_s):
                estimates.append(self.inertial.estimate(sure, at_s))
        if readings:
            self._uncounted.append((readings, now - stamps_s[-1]))
        return estimates

    @property
    def tally(self) -> StreamStatistics:
        """Statistics of all readings received so far."""
        for readings, delay_s in self._uncounted:
            self._tally.read(readings, delay_s)
        self._uncounted.clear()
        return self._tally

    def flush(self) -> list[Measured]:
        """Process the readings that ``hear`` has left waiting, and return their measurements."""
        measured: list[Measured] = []
        for reading, stamp_s in self.undigested:
            for sure, at_s in self._outliers.admit(reading, stamp_s):
                measured.append((sure, self._estimates(sure, at_s)))
        self.undigested.clear()
        return measured

    def release(self) -> list[Measured]:
        """Return all measurements that still wait, because no later readings will come."""
        measured, released = self.flush(), self._outliers.release()
        return measured + [(sure, self._estimates(sure, at_s)) for sure, at_s in released]

    def _estimates(self, reading: Reading, stamp_s: float) -> Sequence[Estimate]:
        if isinstance(reading, DisplacementReading):
            self.inertial.displaced(reading)
            if self._board.traits.own_odometry:
                return []
            return self.odometry.displace(reading, stamp_s)
        if isinstance(reading, PoseReading):
            return self.odometry.settle(reading)
        if isinstance(reading, ImuReading):
            return [self.inertial.estimate(reading, stamp_s)]
        if isinstance(reading, OdometryReading):
            return [_estimate(reading)]
        if isinstance(reading, EStopButtonReading):
            return [Extra(reading, stamp_s)]
        if isinstance(reading, ExtraReading):
            return [Extra(self.inertial.corrected(reading.content), stamp_s)]
        if isinstance(reading, ResetReading | NoticeReading):
            return []
        self._clock.restart()
        return []


def _estimate(reading: OdometryReading) -> OdometryEstimate:
    return OdometryEstimate(
        reading.stamp_s,
        reading.pose,
        reading.twist,
        reading.covariance,
        reading.rolled,
        reading.rolling,
        reading.twist_variances,
    )
