# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of the simulated pair of Teensys and its robot: sizes, firmware, deliberate errors.

``Firmware`` has one switch for each difference between the manual, the public host programs and
related firmware, and for what the manual leaves open.
"""

from dataclasses import dataclass, field
from math import inf
from typing import Literal

Reverse = Literal["mirrored", "clamped"]
WHEEL_BASE_M = 0.40
"""Distance between the driving wheels in m: the manual's B."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Firmware:
    """Variant of the firmware, one switch for each difference.

    sums: lines carry the checksum ``;NN`` and are checked, as with the public host programs. If
        False, as in the manual, a line that begins with ``;`` is an unknown command.
    reverse: how the steering handles an angle beyond 90° at a negative speed. mirrored: the wheel
        takes the angle of the same curve driven forward; clamped: the wheel stays at 90°.
    timed_velocity: ``vel`` begins with the time.
    acceleration_in_g: ``acc`` is in g, not m/s².
    tilt: ``pose`` has a fifth number.
    carriage_return: lines end with ``\\r\\n``.
    start_resumes: after ``start`` the last ``rc`` is in effect again, even if sent while stopped.
    confirms: a command after ``!`` is confirmed, as in newer related firmware.
    shows_source: the heartbeat of the drive Teensy has the source of the last ``rc``; otherwise
        only 10 or -1.
    single_precision: times are float32, so after an hour they have steps of 0.2 ms.
    says_start: a boot ends with the line ``# Starting main loop``. If this line is damaged, the
        boot looks to the host like that of a firmware without the line.
    exact_words: a command without numbers is recognised only if its line has nothing else, not even
        a space; related firmware compares ``stop`` in this way.
    """

    sums: bool = True
    reverse: Reverse = "mirrored"
    timed_velocity: bool = False
    acceleration_in_g: bool = False
    tilt: bool = False
    carriage_return: bool = True
    start_resumes: bool = False
    confirms: bool = False
    shows_source: bool = True
    single_precision: bool = False
    says_start: bool = True
    exact_words: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A planned fault of the Teensy ``half``, which occurs ``at_s`` seconds after construction.

    ``what`` is the fault's name in ``faults``.
    """

    at_s: float
    half: str
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FejemisSettings:
    """Settings of the pair of Teensys, its robot and its surroundings.

    wheel_radius_scale, track_scale: true value divided by the configured one. slip: standard
    deviation in m of the distance of a wheel after 1 m. motor_lag_s: time constant of the speed of
    a driving wheel. steer_base_m: distance from the axle to the steered wheel, the manual's S, F or
    f. servo_degps: speed of the servo at its full velocity value 1000, chosen so that the manual's
    controller crosses over at 12 rad/s; servo_lag_s: time constant of the servo's speed.
    sensor_zero_deg: zero offset of the angle sensor, which the factory configuration corrects.
    angle_noise_deg, gyro_noise_dps, accel_noise_mps2: standard deviations. gyro_bias_dps,
    accel_bias_mps2: biases that a calibration must find. clock_ppm: errors of the two crystals,
    drive first. boot_s: duration of a boot. uptime_s: how long the boards have run at construction;
    if longer than boot_s, they have booted. swapped: the drive Teensy is at the second port. ids:
    the boards' numbers in heartbeats, drive first. lose_inbound: probability that a byte to a board
    is lost. front_m: distance from the start to a wall in front. faults: planned faults, in any
    order.
    """

    firmware: Firmware = field(default_factory=Firmware)
    seed: int = 0
    wheel_radius_m: float = 0.0775
    wheel_radius_scale: tuple[float, float] = (1.0, 1.0)
    track_scale: float = 1.0
    slip: float = 0.0
    motor_lag_s: float = 0.08
    gear: float = 19.0
    ticks: int = 68
    steer_base_m: float = 0.42
    servo_degps: float = 164.0
    servo_lag_s: float = 0.039
    sensor_zero_deg: float = 0.0
    angle_noise_deg: float = 0.03
    gyro_bias_dps: tuple[float, float, float] = (0.4, -0.3, 0.25)
    gyro_noise_dps: float = 0.1
    accel_bias_mps2: tuple[float, float, float] = (0.08, -0.05, 0.12)
    accel_noise_mps2: float = 0.04
    volts: float = 24.9
    cells: int = 6
    clock_ppm: tuple[float, float] = (20.0, -30.0)
    boot_s: float = 0.4
    uptime_s: float = 0.0
    swapped: bool = False
    ids: tuple[int, int] = (90, 91)
    lose_inbound: float = 0.0
    front_m: float = inf
    faults: tuple[Fault, ...] = ()
