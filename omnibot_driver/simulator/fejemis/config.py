# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What each Teensy stores in its configuration memory, with the factory values."""

from dataclasses import dataclass

Vector = tuple[float, float, float]

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

STEERING = (1, 43.0, 0, 0, 0, 1, 1, 0.16, 0.048, 0, 0, 0, 0, 0, 0, 1, 1000.0)
"""Factory parameters of the steering controller: the manual's P-Lead controller.

Order, as in the help text: use, Kp; useI, taui, ilimit; constant 1; useLeadf, tz, tp = alpha *
tau_d; useLeadb, tz, tp; usePre, tz, tp; useULim, Ulim.
"""

WHEELS = (1, 7.0, 1, 0.05, 20.0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 24.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveConfig:
    """Configuration of the drive Teensy.

    * ``wheel_base_m``: distance between the driving wheels, for the odometry.
    * ``confs_m``: the manual's B (distance between the driving wheels) and F (distance from the
      axle to the steered wheel), for the control of turns.
    """

    number: int
    name: str = "drive"
    radii_m: tuple[float, float]
    gear: float
    ticks: float
    wheel_base_m: float
    confs_m: tuple[float, float]
    gyro_offset_dps: Vector = (0.0, 0.0, 0.0)
    accel_offset_mps2: Vector = (0.0, 0.0, 0.0)
    accel_scale: Vector = (1.0, 1.0, 1.0)
    mag_offset_ut: Vector = (0.0, 0.0, 0.0)
    mag_matrix: tuple[float, ...] = IDENTITY


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontConfig:
    """Configuration of the front Teensy.

    * ``confs_m``: the manual's B (not used) and F, the distance from the axle to the steered wheel.
    * ``ir``: raw readings of sensor 1 at 13 cm and 50 cm, then those of sensor 2.
    * ``steering``: parameters of the steering controller, in the order of ``cpsteer``.
    """

    number: int
    name: str = "front"
    confs_m: tuple[float, float]
    angle_offset_deg: float = 0.0
    angle_inverted: bool = False
    ir: tuple[float, float, float, float] = (46000.0, 14000.0, 46000.0, 14000.0)
    steering: tuple[float, ...] = STEERING
