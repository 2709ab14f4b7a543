# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Find the mounting of the IMU from gravity in three postures: level, front up, left side up.

A turn to the left shows whether gyro and gravity agree. This module does not know how the user is
asked.
"""

import math
from dataclasses import dataclass
from itertools import permutations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.core.imu.scale import STANDARD_GRAVITY
from omnibot_driver.tools.calibrate.log import Imu
from omnibot_driver.tools.calibrate.seen import Contradiction

Array = NDArray[np.float64]

STILL_RADPS: Final = 0.1
"""Largest standard deviation of the gyro's rates, in rad/s, while the robot is held still."""
GRAVITY_PART: Final = 0.15
LEAST_TILT_RAD: Final = math.radians(10)
MOST_TILT_RAD: Final = math.radians(75)
SQUARE_RAD: Final = math.radians(35)
"""Largest accepted deviation of the angle between the two tilts from 90°, in rad."""
LEAST_TURN_RAD: Final = math.radians(30)
SNAP_RAD: Final = math.radians(15)
"""Largest rotation, in rad, by which a measured mounting is corrected to make its axes parallel to
the body's axes."""
HAND_RAD: Final = math.radians(2)
"""Smallest assumed standard deviation, in rad, of the direction of a tilt made by hand."""
LEVEL_WEIGHT: Final = 20.0
"""Weight of the level posture in the fit. A posture that is tilted by hand is less exact, and has
the weight 1."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """The mounting of the IMU on the robot.

    * ``rotation``: converts from the sensor's axes to the body's axes.
    * ``yaw_sigma_rad``: standard deviation of the yaw, due to inexact tilts.
    * ``tilts_rad``: angles of the tilts with the front and with the left side raised.
    """

    rotation: Array
    yaw_sigma_rad: float
    tilts_rad: tuple[float, float]

    @property
    def rpy_rad(self) -> tuple[float, float, float]:
        """Roll, pitch and yaw of the sensor in the body, in rad, about fixed axes as in a URDF."""
        return rpy(self.rotation)

    def snapped(self) -> "Mounting | None":
        """Return the nearest right-angled mounting, or None if it differs by more than 15°."""
        nearest = max(_right_angles(), key=lambda one: float(np.trace(one.T @ self.rotation)))
        cosine = (float(np.trace(nearest.T @ self.rotation)) - 1.0) / 2.0
        if math.acos(max(-1.0, min(1.0, cosine))) > SNAP_RAD:
            return None
        return Mounting(nearest, self.yaw_sigma_rad, self.tilts_rad)


def up(imu: Imu) -> Array:
    """Return the upward direction in the sensor's axes, as a unit vector.

    Raises Contradiction if there are no readings, or if the sensor moved or did not measure
    gravity.
    """
    if not len(imu.stamp_s):
        raise Contradiction("no reading of the IMU was received")
    trembling = float(np.max(np.std(imu.rate_radps, axis=0)))
    force: Array = np.mean(imu.force_mps2, axis=0)
    length = float(np.linalg.norm(force))
    if trembling > STILL_RADPS:
        raise Contradiction(
            f"the robot was not held still (its gyro varied by {trembling:.2f} rad/s rms)"
        )
    if abs(length / STANDARD_GRAVITY - 1.0) > GRAVITY_PART:
        raise Contradiction(
            f"the accelerometer measured {length:.2f} m/s², which is not gravity: the robot was"
            " moved, or `accel_range` is wrong"
        )
    return force / length


def bias(imu: Imu) -> Array:
    """Return the gyro's mean reading at rest, in rad/s."""
    return np.asarray(np.mean(imu.rate_radps, axis=0))


def mounting(level: Array, nose_up: Array, left_up: Array) -> Mounting:
    """Return the mounting from the upward direction in three postures.

    Arguments: unit vectors in the sensor's axes. Raises Contradiction if a tilt is too small or too
    large, or if the tilts are not about 90° apart.
    """
    nose_rad, left_rad = _tilt(level, nose_up, "front"), _tilt(level, left_up, "left side")
    forward, left = _level_part(level, nose_up), _level_part(level, left_up)
    square_rad = math.atan2(float(level @ np.cross(forward, left)), float(forward @ left))
    if abs(square_rad - math.pi / 2) > SQUARE_RAD:
        raise Contradiction(
            f"the angle between the two tilts is {math.degrees(square_rad):.0f}° instead of 90°:"
            " repeat both tilts"
        )
    # "Up" in the body's axes, as it follows from the two tilts.
    body = np.array(
        [
            (0.0, 0.0, 1.0),
            (math.sin(nose_rad), 0.0, math.cos(nose_rad)),
            (0.0, math.sin(left_rad), math.cos(left_rad)),
        ]
    )
    weights = np.diag([LEVEL_WEIGHT, 1.0, 1.0])
    # Wahba's problem: find the rotation from the measured to the computed directions.
    u, _, vt = np.linalg.svd(body.T @ weights @ np.array([level, nose_up, left_up]))
    rotation = u @ vt  # no mirror image: both sets of directions are right-handed
    sigma_rad = math.hypot(abs(square_rad - math.pi / 2) / math.sqrt(2), HAND_RAD)
    return Mounting(rotation, sigma_rad, (nose_rad, left_rad))


def require_left_turn(imu: Imu, bias_radps: Array, level: Array) -> float:
    """Return the angle, in rad, by which the user has turned the robot to the left.

    ``level``: the upward direction in the sensor's axes. Raises Contradiction if the turn is too
    small, or to the right.
    """
    rate = (imu.rate_radps - bias_radps) @ level
    turn_rad = float(np.sum((rate[1:] + rate[:-1]) / 2 * np.diff(imu.stamp_s)))
    if abs(turn_rad) < LEAST_TURN_RAD:
        raise Contradiction(f"the robot was turned by only {math.degrees(turn_rad):.0f}°")
    if turn_rad < 0:
        raise Contradiction(
            f"gyro and gravity show a turn to the right by {-math.degrees(turn_rad):.0f}°: turn the"
            " robot to the left"
        )
    return turn_rad


def rpy(rotation: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw about fixed axes, in rad. At a pitch of 90° the roll is 0."""
    sine = max(-1.0, min(1.0, -float(rotation[2, 0])))
    if abs(sine) > 1.0 - 1e-9:
        yaw = math.atan2(-float(rotation[0, 1]), float(rotation[1, 1]))
        return 0.0, math.copysign(math.pi / 2, sine), yaw
    return (
        math.atan2(float(rotation[2, 1]), float(rotation[2, 2])),
        math.asin(sine),
        math.atan2(float(rotation[1, 0]), float(rotation[0, 0])),
    )


def _tilt(level: Array, tilted: Array, what: str) -> float:
    tilt_rad = math.acos(max(-1.0, min(1.0, float(level @ tilted))))
    if not LEAST_TILT_RAD <= tilt_rad <= MOST_TILT_RAD:
        raise Contradiction(
            f"when the {what} was raised, the robot was tilted by {math.degrees(tilt_rad):.0f}°;"
            f" raise the {what} by 20° to 45°"
        )
    return tilt_rad


def _level_part(level: Array, tilted: Array) -> Array:
    """Return the part of ``tilted`` that is perpendicular to ``level``, as a unit vector."""
    part = tilted - (tilted @ level) * level
    return np.asarray(part / np.linalg.norm(part))


def _right_angles() -> list[Array]:
    """Return the 24 rotations after which each axis is parallel to one of the original axes."""
    found = []
    for places in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            one = np.zeros((3, 3))
            for row, (place, sign) in enumerate(zip(places, signs, strict=True)):
                one[row, place] = sign
            if np.linalg.det(one) > 0:
                found.append(one)
    return found
