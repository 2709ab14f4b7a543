# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of the two simulated Teensys and their robot: sizes, firmware, planned faults.

The manual, the public host programs and related firmware differ, and the manual leaves some things
open. ``Firmware`` has one switch for each such point.
"""

from dataclasses import dataclass, field
from math import inf
from typing import Literal

Reverse = Literal["mirrored", "clamped"]
WHEEL_BASE_M = 0.40
"""Distance between the driving wheels in m: the manual's B."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Firmware:
    """Variant of the firmware. Each switch decides one point on which the sources differ.

    ``sums``: lines carry the checksum ``;NN`` and are checked, as with the public host programs. If
    False, lines carry no checksum, as in the manual. A line that begins with ``;`` is then an
    unknown command.
    ``reverse``: angle of the front wheel when the robot drives backward. ``mirrored``: the angle at
    which the robot drives forward along the same curve. ``clamped``: 90° to the left or right.

    ``timed_velocity``: ``vel`` begins with the time.

    ``acceleration_in_g``: ``acc`` is in g, not in m/s².

    ``tilt``: ``pose`` has a fifth number.

    ``carriage_return``: lines end with a carriage return and a line feed.

    ``start_resumes``: after ``start``, the last ``rc`` command is in effect again, even if it came
    while the Teensy was stopped.

    ``confirms``: a command after ``!`` is confirmed, as in newer related firmware.

    ``shows_source``: the heartbeat of the drive Teensy shows the source of the last ``rc`` command.
    If False, it shows only 10 or -1.

    ``single_precision``: times are float32, so after an hour they advance in steps of 0.2 ms.

    ``says_start``: a boot ends with the line ``# Starting main loop``. If False, a boot looks to
    the host as if this line was lost.

    ``exact_words``: a command without numbers is recognised only if its line contains nothing else,
    not even a space. Related firmware compares ``stop`` in this way.
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
    """A planned fault of one Teensy.

    ``at_s``: when the fault occurs, in s after construction.

    ``half``: the Teensy, ``drive`` or ``front``.

    ``what``: name of the fault in ``faults.py``.
    """

    at_s: float
    half: str
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FejemisSettings:
    """Settings of the two Teensys, their robot and its surroundings.

    ``wheel_radius_scale``, ``track_scale``: true size divided by the configured size.

    ``slip``: standard deviation, in m, of a wheel's random error of distance after 1 m.

    ``motor_lag_s``: time constant of a driving wheel's speed.

    ``ticks``: encoder ticks per revolution of the motor.

    ``steer_base_m``: distance from the axle to the steered wheel; the manual's S, F or f.

    ``servo_degps``: speed of the servo at its full command, 1000. With this speed, the manual's
    controller crosses over at 12 rad/s.

    ``servo_lag_s``: time constant of the servo's speed.

    ``sensor_zero_deg``: zero offset of the angle sensor. The factory configuration corrects it.

    ``angle_noise_deg``, ``gyro_noise_dps``, ``accel_noise_mps2``: standard deviations of the noise.

    ``gyro_bias_dps``, ``accel_bias_mps2``: biases that a calibration must find.

    ``clock_ppm``: errors of the two crystals, first that of the drive Teensy.

    ``boot_s``: duration of a boot.

    ``uptime_s``: how long the Teensys have run at construction. If this is longer than ``boot_s``,
    they have booted.

    ``swapped``: whether the drive Teensy is at the second port.

    ``ids``: the numbers of the Teensys in their heartbeats, first that of the drive Teensy.

    ``lose_inbound``: probability that a byte to a Teensy is lost.

    ``front_m``: distance from the start to a wall in front.

    ``faults``: planned faults, in any order.
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
