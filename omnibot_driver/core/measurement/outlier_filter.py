# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The outlier filter: it rejects physically impossible readings that arrive in valid frames.

A spike leaps (changes implausibly much), and the next reading leaps back. Therefore, the filter
holds a leaping reading until the next reading arrives. docs/internals/architecture.md gives the
rules.

This module knows readings and the robot's limits; it does not know bytes or a clock.
"""

from dataclasses import dataclass, replace
from math import hypot, isfinite
from typing import Final

from omnibot_driver.core.measurement.spikes import Spikes
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    OdometryReading,
    PausedReading,
    PoseReading,
    Reading,
)
from omnibot_driver.core.values import value

Stamped = tuple[Reading, float]
"""A reading and its time in s."""

STILL: Final = 0.08
"""Tolerance of the check for spikes of the IMU, as a fraction of the spike.

The reading after a spike equals the reading before the spike within this tolerance. If a spike is a
flipped bit of one value, the other values stay within this tolerance.
"""
MOST_HELD: Final = 10
"""Largest number of readings that the filter holds. The first of them is a displacement that
changed implausibly much. The others are the poses after it."""
ALIKE: Final = 1.1
"""Largest ratio between the durations of two successive displacements that the filter compares.

After a loss, for example, the durations differ so much that a steady motion would look like a
change.
"""
BACK: Final = 0.25
"""Tolerance of the check for spikes of displacements, as a fraction of the spike.

A change is a spike only if the next displacement returns to the displacement before the change,
within this tolerance.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """Limits by which the outlier filter recognises implausible readings.

    * ``fastest_…``: the robot cannot exceed them, even when it is pushed by hand.
    * ``force_step_mps2``: a smaller change of the accelerometer's reading, in m/s², is never a
      spike.
    * ``full_scale_mps2``: full scale of the accelerometer in m/s². It is infinite if the readings
      are not integers: the filter then does not look for flipped bits.
    """

    fastest_mps: float = 2.0
    fastest_radps: float = 8.0
    fastest_mps2: float = 15.0
    fastest_radps2: float = 50.0
    force_step_mps2: float = 4.0
    full_scale_mps2: float = 19.6133


@value(frozen=True, slots=True)
class Refused:
    """Numbers of readings that were rejected as implausible since the driver began."""

    imu: int
    displacements: int
    poses: int


class OutlierFilter:
    """Rejects implausible readings, and holds a possible spike until the next reading arrives.

    * ``limits``: may be replaced at any time.
    * ``tick_s``: time between two ImuReadings, in s.
    * ``corrected``: whether the board corrects its own odometry. If True, impossible but finite
      displacements pass, with ``measured`` False. If they have a duration, ``possible`` is False as
      well.
    """

    def __init__(self, limits: MotionLimits, tick_s: float, *, corrected: bool = False) -> None:
        self.limits = limits
        self.refused_imu = self.refused_displacements = 0
        self._tick_s, self._corrected = tick_s, corrected
        self._imu_leaps = Spikes(STILL, knocked=3)
        self._motion_leaps = Spikes(BACK, knocked=0)
        self._lasted_s = 0.0
        """Duration in s of the last plausible displacement; 0 if there was none."""
        self._held_imu: list[tuple[ImuReading, float]] = []
        self._held_motion: list[Stamped] = []
        """The readings that the filter holds: a displacement that changed implausibly much, and
        the poses after it."""
        self._displaced_at_s: float | None = None
        self._lost = 0
        self._restarted = self._time_unknown = False

    def admit(self, reading: Reading, stamp_s: float) -> list[Stamped]:
        """Add a reading; return all readings that the filter now passes on.

        A reading is held while it, or an earlier one, may be a spike. Readings of the same kind
        stay in order.
        """
        if isinstance(reading, ImuReading):
            return list(self.admit_imu(reading, stamp_s))
        if isinstance(reading, DisplacementReading):
            return self._admit_displacement(reading, stamp_s)
        if isinstance(reading, PausedReading):
            return [*self.release(), (reading, stamp_s)]
        if isinstance(reading, OdometryReading) and not _is_finite(reading):
            self.refused_displacements += 1
            return []
        if not isinstance(reading, PoseReading):
            return [(reading, stamp_s)]
        if self._held_motion:
            self._held_motion.append((reading, stamp_s))
            if len(self._held_motion) <= MOST_HELD:
                return []
            self._motion_leaps.forget()
            released, self._held_motion = self._held_motion, []
            return released
        return [(self._told_of_losses(reading), stamp_s)]

    def release(self) -> list[Stamped]:
        """Return the readings that the filter holds, because the stream has ended or paused.

        Only a later reading could show that a held reading is a spike, and there is no later one.
        """
        released = [*self._held_imu, *self._held_motion]
        self._held_imu, self._held_motion = [], []
        self._imu_leaps.forget()
        self._motion_leaps.forget()
        return released

    def admit_imu(self, reading: ImuReading, stamp_s: float) -> list[tuple[ImuReading, float]]:
        """Add an IMU reading; return, in order, the IMU readings that need not be held now."""
        force = self.limits.force_step_mps2
        turn = self.limits.fastest_radps2 * self._tick_s
        (x, y, z), (u, v, w) = reading.specific_force, reading.angular_velocity
        values = (x / force, y / force, z / force, u / turn, v / turn, w / turn)
        was_flip, leaps = self._imu_leaps.judge(
            values, topmost_bit=self.limits.full_scale_mps2 / force
        )
        held, self._held_imu = self._held_imu, []
        if was_flip:
            self.refused_imu += 1
            held = []
        if leaps:
            self._held_imu = [(reading, stamp_s)]
            return held
        return [*held, (reading, stamp_s)]

    def _admit_displacement(self, reading: DisplacementReading, stamp_s: float) -> list[Stamped]:
        before_s, self._displaced_at_s = self._displaced_at_s, stamp_s
        seconds = reading.duration_s or None  # 0 s: arrived with the previous one
        if seconds is None:
            self._motion_leaps.forget()
            seconds = None if before_s is None else (stamp_s - before_s) or None
        if seconds is not None and not self._possible(reading, seconds):
            # a correction of the board's odometry can look like an impossible motion
            if self._corrected and isfinite(reading.dx_m + reading.dy_m + reading.dyaw_rad):
                possible = not reading.duration_s  # after a stall, many arrive at the same time
                return [(replace(reading, measured=False, possible=possible), stamp_s)]
            self._refuse(reading)
            return []
        was_flip = leaps = False
        if reading.duration_s and not self._corrected:
            lasted_s, self._lasted_s = self._lasted_s or reading.duration_s, reading.duration_s
            if not 1 / ALIKE <= reading.duration_s / lasted_s <= ALIKE:
                self._motion_leaps.forget()  # after a gap, even a steady motion seems to leap
            square_s2 = reading.duration_s * reading.duration_s
            turn = self.limits.fastest_radps2 * square_s2
            way = self.limits.fastest_mps2 * square_s2
            values = (reading.dx_m / way, reading.dy_m / way, reading.dyaw_rad / turn)
            periods = reading.lost + self._lost + 1
            was_flip, leaps = self._motion_leaps.judge(values, periods)
        released, self._held_motion = self._held_motion, []
        if was_flip:
            refused, _ = released.pop(0)
            assert isinstance(refused, DisplacementReading)
            self._refuse(refused)
        if released:
            released = [(self._told_of_losses(held), at_s) for held, at_s in released]
        if self._lost or self._restarted or self._time_unknown:
            reading = self._made_good(reading)
        if leaps:
            self._held_motion = [(reading, stamp_s)]
            return released
        return [*released, (reading, stamp_s)]

    def _possible(self, reading: DisplacementReading, seconds: float) -> bool:
        return (
            hypot(reading.dx_m, reading.dy_m) <= self.limits.fastest_mps * seconds
            and abs(reading.dyaw_rad) <= self.limits.fastest_radps * seconds
        )

    def _refuse(self, reading: DisplacementReading) -> None:
        self.refused_displacements += 1
        self._lost += reading.lost + 1
        self._restarted |= reading.restarted
        self._time_unknown |= reading.duration_s is None

    def _told_of_losses(self, reading: Reading) -> Reading:
        """Return the reading; in a pose, add the number of rejected displacements to ``lost``.

        The pose shows the motion of rejected displacements and of those lost on the line.
        """
        if not isinstance(reading, PoseReading) or not self._lost:
            return reading
        lost, self._lost = self._lost, 0
        return replace(reading, lost=reading.lost + lost)

    def _made_good(self, reading: DisplacementReading) -> DisplacementReading:
        """Return the reading with corrected values of ``lost``, ``duration_s`` and ``restarted``.

        The corrections are necessary because displacements before this reading were rejected.
        """
        unknown = self._time_unknown or reading.duration_s is None
        made_good = replace(
            reading,
            lost=0 if unknown else reading.lost + self._lost,
            duration_s=None if unknown else reading.duration_s,
            restarted=self._restarted or reading.restarted,
        )
        self._lost, self._restarted, self._time_unknown = 0, False, False
        return made_good


def _is_finite(reading: OdometryReading) -> bool:
    twist, errors = reading.twist, reading.covariance
    spread = errors.xx + errors.yy + errors.yaw_yaw + sum(reading.twist_variances)
    speed = twist.vx_mps + twist.vy_mps + twist.yaw_rate_radps
    return reading.pose.finite and isfinite(spread) and isfinite(speed)
