# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of the two simulated Teensys and their robot: sizes, firmware, planned faults.

``Firmware`` has one switch for each point that the manual leaves open or other sources contradict.
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

    * ``sums``: lines carry the checksum ``;NN`` and are checked. The manual has none.
    * ``reverse``: angle of the front wheel for driving backward: as for driving forward on the same
      curve ("mirrored"), or at most ±90° ("clamped").
    * ``tilt``: ``pose`` has a fifth number, the tilt.
    * ``start_resumes``: ``start`` resumes the last ``rc``, even one received while stopped.
    * ``confirms``: a command that begins with ``!`` is confirmed.
    * ``shows_source``: the drive Teensy's heartbeat shows the source of the last ``rc``. Otherwise
      it shows only 10 (motion allowed) or -1 (stopped).
    * ``single_precision``: times are float32, with steps of 0.2 ms after an hour.
    * ``says_start``: a boot ends with the line ``# Starting main loop``.
    * ``exact_words``: a command without numbers must be the whole line, as in related firmware.
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

    * ``at_s``: simulated time of the fault since the board was constructed, in s.
    * ``half``: the Teensy, ``drive`` or ``front``.
    * ``what``: a name in ``faults.py``.
    """

    at_s: float
    half: str
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FejemisSettings:
    """Settings of the two Teensys, their robot and its surroundings.

    * ``wheel_radius_scale``, ``track_scale``: true size divided by the configured size.
    * ``slip``: standard deviation, in m, of the distance error of a wheel that rolls 1 m.
    * ``ticks``: encoder ticks per revolution of the motor.
    * ``steer_base_m``: distance from the axle to the steered wheel; the manual's S, F or f.
    * ``servo_degps``: speed of the servo at the full command, 1000.
    * ``sensor_zero_deg``: zero offset of the angle sensor, which the factory configuration
      corrects.
    * ``clock_ppm``, ``ids``: for the drive and the front Teensy, the error of the clock's rate in
      ppm, and the id in heartbeats.
    * ``uptime_s``: time for which the Teensys have run at construction. If it is longer than
      ``boot_s``, they have booted.
    * ``swapped``: whether the drive Teensy is at the second port.
    * ``lose_inbound``: probability that a byte to a Teensy is lost.
    * ``front_m``: distance from the start to a wall in front.
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
    # With this speed, the crossover frequency of the manual's controller is 12 rad/s.
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
