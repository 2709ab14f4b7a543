# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The gyro's bias: measured on request, refined at standstill, never learnt from motion.

Without displacements, a steady turn looks like a bias at rest. The driver therefore always rejects
a large bias.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.requests import RequestDone

MEASURE_S: Final = 2.0
BLOCK_S: Final = 1.0
"""Length in s of one observation of the gyro while the user has not requested a measurement.

The observation for a requested measurement lasts ``MEASURE_S``.
"""
GAP_S: Final = 0.2
"""Longest allowed time between two readings of one observation, in s."""
ANSWER_WITHIN_S: Final = 4.0
"""Time in s within which a request is answered. ``~/calibrate_gyro`` may take five seconds; the
last second is for writing a file.
"""

STILL_RADPS: Final = 0.01
STILL_MPS2: Final = 0.3
"""``STILL_RADPS``, ``STILL_MPS2``: largest standard deviations of gyro and accelerometer readings
at rest, in rad/s and m/s². They are ten times the sensors' noise; a touched robot exceeds them.
"""
STILL_M: Final = 0.002
STILL_RAD: Final = 0.002
"""``STILL_M``, ``STILL_RAD``: largest displacement, in m and rad, that is accepted as rest: the
encoder of a resting wheel may change by one count and back."""
LARGEST_BIAS_RADPS: Final = math.radians(20.0)
"""Largest accepted bias in rad/s: the initial zero-rate output in the MPU-6050 product
specification, section 6.1."""
REFINEMENT: Final = 0.05
"""Fraction of the bias error that is corrected after each second at rest. Half of the error is
corrected in 14 s."""


class Look:
    """One observation of the robot: IMU readings, and displacements in the same period.

    ``began_s``, ``last_s``: stamps of the first and the last reading, in s; NaN without readings.
    """

    def __init__(self) -> None:
        self.rates: list[Vector3] = []
        self.forces: list[Vector3] = []
        self.began_s = self.last_s = math.nan
        self.displacements = 0
        self._x_m = self._y_m = self._yaw_rad = 0.0

    def hear(self, rate: Vector3, force: Vector3, stamp_s: float) -> None:
        """Add a reading of the IMU."""
        if not self.rates:
            self.began_s = stamp_s
        self.last_s = stamp_s
        self.rates.append(rate)
        self.forces.append(force)

    def displaced(self, dx_m: float, dy_m: float, dyaw_rad: float) -> None:
        """Add a displacement.

        Its axes do not matter, because the displacements only show whether the robot has moved.
        """
        self.displacements += 1
        self._x_m += dx_m
        self._y_m += dy_m
        self._yaw_rad += dyaw_rad

    @property
    def length_s(self) -> float:
        """Time from the first reading to the last, in s."""
        return self.last_s - self.began_s if self.rates else 0.0

    @property
    def rolled(self) -> bool:
        """Whether the wheels report motion."""
        return math.hypot(self._x_m, self._y_m) > STILL_M or abs(self._yaw_rad) > STILL_RAD

    @property
    def motion(self) -> str:
        """How the readings show motion, as a part of a sentence; empty if they show rest."""
        shaken_radps, shaken_mps2 = max(deviation(self.rates)), max(deviation(self.forces))
        bias_radps = max(map(abs, mean(self.rates)))
        if self.rolled:
            return "its wheels turn"
        if shaken_radps > STILL_RADPS:
            return f"its gyro varies by {shaken_radps:.3f} rad/s"
        if shaken_mps2 > STILL_MPS2:
            return f"its accelerometer varies by {shaken_mps2:.2f} m/s²"
        if bias_radps > LARGEST_BIAS_RADPS:
            return f"its gyro reads {bias_radps:.2f} rad/s, too much for a bias"
        return ""


class GyroCalibration:
    """Measures and refines the gyro's bias.

    * ``bias``: mean reading of the gyro at rest, in rad/s.
    * ``refine``: whether to correct the bias at rest, if displacements arrive.
    * ``answers``: one RequestDone for each finished measurement.
    """

    def __init__(self, bias: Vector3, *, refine: bool) -> None:
        self.bias = bias
        self.refine = refine
        self.answers: list[RequestDone] = []
        self.gravity_mps2: float | None = None
        """Magnitude of the mean specific force at the last standstill, in m/s²."""
        self.noise: Vector3 | None = None
        """Standard deviation of the gyro's readings at the last standstill, in rad/s."""
        self._look = Look()
        self._token: object = None
        self.wake_at = math.inf
        """Deadline of a running measurement, in s; infinity while nothing is measured."""

    @property
    def measuring(self) -> bool:
        """Whether a requested measurement is running."""
        return self.wake_at < math.inf

    def measure(self, token: object, now: float) -> None:
        """Begin to measure the bias for two seconds. The result is later added to ``answers``."""
        self._look = Look()
        self._token, self.wake_at = token, now + ANSWER_WITHIN_S

    def give_up(self, reason: str) -> None:
        """End a running measurement as failed. ``reason`` is the cause with a remedy."""
        if self.wake_at < math.inf:
            self._answer(False, f"gyro bias unchanged: {reason}")

    def tick(self, now: float) -> None:
        """End a running measurement as failed if its deadline has passed."""
        if now >= self.wake_at:
            self.give_up(
                "the calibration needs two seconds of IMU readings without a gap, but did not"
                " receive them; check ~/state, then call again"
            )

    def hear(self, rate: Vector3, force: Vector3, stamp_s: float) -> None:
        """Add a reading of the IMU in SI units.

        ``rate`` includes the gyro's bias. The accelerometer's bias is already subtracted from
        ``force``.
        """
        look = self._look
        if stamp_s - look.last_s > GAP_S:
            look = self._look = Look()
        look.hear(rate, force, stamp_s)
        length_s = stamp_s - look.began_s
        if length_s >= BLOCK_S and (length_s >= MEASURE_S or not self.measuring):
            self._conclude()

    def displaced(self, dx_m: float, dy_m: float, dyaw_rad: float) -> None:
        """Add a displacement of the wheels, which shows motion or rest. Its axes do not matter."""
        self._look.displaced(dx_m, dy_m, dyaw_rad)

    def _conclude(self) -> None:
        look, self._look = self._look, Look()
        if motion := look.motion:
            self.give_up(f"the robot moves ({motion}); keep it still for 2 s, then call again")
            return
        self.gravity_mps2 = math.hypot(*mean(look.forces))
        self.noise = deviation(look.rates)
        if self.measuring:
            self.bias = mean(look.rates)
            self._answer(
                True,
                f"gyro bias {_numbers(self.bias)} rad/s, noise {_numbers(self.noise)} rad/s rms,"
                f" from {len(look.rates)} readings",
            )
        elif self.refine and look.displacements:
            x, y, z = (
                known + REFINEMENT * (seen - known)
                for known, seen in zip(self.bias, mean(look.rates), strict=True)
            )
            self.bias = x, y, z

    def _answer(self, success: bool, message: str) -> None:
        self.answers.append(RequestDone(self._token, success, message))
        self._token, self.wake_at = None, math.inf


def mean(vectors: Sequence[Vector3]) -> Vector3:
    """Return the mean of one or more vectors, axis by axis."""
    x, y, z = (math.fsum(row) / len(vectors) for row in zip(*vectors, strict=True))
    return x, y, z


def deviation(vectors: Sequence[Vector3]) -> Vector3:
    """Return the standard deviation of one or more vectors, axis by axis."""
    n = len(vectors)
    x, y, z = (
        math.dist(axis, (middle,) * n) / math.sqrt(n)
        for axis, middle in zip(zip(*vectors, strict=True), mean(vectors), strict=True)
    )
    return x, y, z


def _numbers(vector: Vector3) -> str:
    return "(" + ", ".join(f"{value:.5f}" for value in vector) + ")"
