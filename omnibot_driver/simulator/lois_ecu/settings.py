# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of a simulated LOIS ECU and its robot: nominal values, deliberate errors, firmware.

``Quirks`` has one switch for each deviation of the public firmware from the manual.
"""

from dataclasses import dataclass, fields
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Deviations of the public firmware from the manual.

    All are off by default, and on in ``FIRMWARE``.

    Numbers such as 0x12 are the manual's command numbers. Fields with clear names are not listed.

    * ``ticks_of_forward_targets``: ticks count up, and only while the wheel's RPM target is
      positive.
    * ``odometry_stands_at_equal_speeds``: the position in 0x20 is constant while both RPMs are
      equal.
    * ``velocity_may_be_nan``: two ticks in one timer count give NaN or infinity in 0x20.
    * ``sign_of_command``: the measured speed has the sign of the target.
    * ``duty_drags_target``: while a negative duty is commanded, and the RPM target is not positive,
      each encoder tick lowers this target by 1. Requires ``ticks_of_forward_targets``.
    * ``reverse_runs_fast``: while the controller's duty is negative, and the RPM target is not
      positive, each encoder tick lowers the target of the controller's next step by 1. Requires
      ``ticks_of_forward_targets``.
    * ``low_pass_starts_at_zero``: wheels ignore RPM targets until 0x23 is written.
    * ``extra_settings``: the settings 0x21 to 0x23 exist.
    * ``appends_odometry``: 0x12 sends the odometry after the ticks, with command number 0x12.
    * ``clock_in_ms``: the timestamp of 0x12 is in ms, not in ns.
    * ``deaf_while_sending``: while the board sends, it keeps only the first character that arrives.
    * ``deaf_while_counting``: the board receives nothing for 0.2 ms after each encoder tick.
    * ``button_waits_while_sending``: the button takes effect only after the current message or
      record.
    * ``odometry_period_is_fixed``: writing the period of 0x20 has no effect.
    * ``terminal_mode_zeroes_correction``: the command of the terminal mode, 0x11, also sets the
      left wheel's correction factor for short levels to zero.
    * ``terminal_mixes_sensors``: each terminal mode forwards both sensors, character by character.
    * ``reset_clears_ticks_only``: 0x18 keeps the odometry and the set-points.
    * ``terminal_passes_input_on``: in a terminal mode, the board sends its input on to the sensor,
      at 9600 or 4800 baud, before it evaluates the input.
    * ``headings_average_over_north``: the mean heading of 359, 1 and 1 is 120.
    * ``records_in_100_us``: the samples of an RPM record are in 100 µs, not in 100 ns.
    * ``torque_comes_as_rpm``: the reply to 0x17 has command number 0x04.
    * ``record_waits_for_one_more``: a record of n headings is sent after sample n + 1.
    * ``large_records_never_end``: a record of more than 1024 samples is never complete.
    * ``lenient_hex``: fields need not be hexadecimal if the checksum is right.
    * ``limits_rpm``: targets are limited to 50 RPM.
    * ``fast_control``: the controller runs every 91 ms, with the coefficients for 200 ms.
    * ``slow_timer``: a count takes 100.7 µs instead of 100 µs, so reported speeds are 0.7 % too
      high.
    * ``slow_boot``: for 2 s after power-up, the board only stores its input.
    """

    ticks_of_forward_targets: bool = False
    odometry_stands_at_equal_speeds: bool = False
    velocity_may_be_nan: bool = False
    sign_of_command: bool = False
    keeps_speed_of_stalled_wheel: bool = False
    duty_drags_target: bool = False
    reverse_runs_fast: bool = False
    low_pass_starts_at_zero: bool = False
    extra_settings: bool = False
    appends_odometry: bool = False
    clock_in_ms: bool = False
    clock_stops_while_sending: bool = False
    deaf_while_sending: bool = False
    deaf_while_counting: bool = False
    button_waits_while_sending: bool = False
    odometry_period_is_fixed: bool = False
    terminal_mode_zeroes_correction: bool = False
    button_is_lost_in_terminal_mode: bool = False
    terminal_mixes_sensors: bool = False
    reset_clears_ticks_only: bool = False
    terminal_passes_input_on: bool = False
    one_ball_in_six_seconds: bool = False
    gps_is_ignored: bool = False
    headings_average_over_north: bool = False
    records_in_100_us: bool = False
    torque_comes_as_rpm: bool = False
    record_waits_for_one_more: bool = False
    large_records_never_end: bool = False
    lenient_hex: bool = False
    limits_rpm: bool = False
    fast_control: bool = False
    slow_timer: bool = False
    slow_boot: bool = False


DOCUMENTED = Quirks()
FIRMWARE = Quirks(**{field.name: True for field in fields(Quirks)})

Firmware = Literal["documented", "firmware"]
QUIRKS: dict[Firmware, Quirks] = {"documented": DOCUMENTED, "firmware": FIRMWARE}


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorSettings:
    """A first-order motor with dry friction.

    * ``rpm_per_percent``: speed in RPM per percent of duty beyond the dead zone.
    * ``friction_rpm_per_s``: additional deceleration without power.
    * ``second_time_constant_s``, ``dead_time_s``: lag and delay of the power stage.
    * ``backlash_turns``: play between motor and encoder, in turns of the wheel.
    """

    rpm_per_percent: float = 0.66
    dead_zone_percent: float = 6.0
    time_constant_s: float = 0.12
    friction_rpm_per_s: float = 60.0
    second_time_constant_s: float = 0.0
    dead_time_s: float = 0.0
    backlash_turns: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LoisSettings:
    """The board, its robot, and its position on Earth.

    * ``steps``: nominal encoder edges per turn.
    * ``wheel_radius_scale``, ``track_scale``: true value divided by nominal value.
    * ``slip``: standard deviation, in m, of the distance error of a wheel that rolls 1 m.
    * ``load_percent``: standard deviation of the load from the ground, in percent of duty.
    * ``mark_noise``: standard deviation of the distance between adjacent encoder marks, in half
      periods.
    * ``start_latitude_deg``, ``start_longitude_deg``: position of x = y = 0. The x axis points
      east.
    * ``heading_noise_deg``: standard deviation of each raw heading.
    * ``running``: whether the board has already booted.
    """

    quirks: Quirks = FIRMWARE
    seed: int = 0
    wheel_radius_m: float = 0.13
    track_m: float = 0.47
    steps: int = 60
    wheel_radius_scale: tuple[float, float] = (1.0, 1.0)
    track_scale: float = 1.0
    slip: float = 0.0
    load_percent: float = 0.0
    mark_noise: float = 0.0
    motors: tuple[MotorSettings, MotorSettings] = (MotorSettings(), MotorSettings())
    start_latitude_deg: float = 48.1
    start_longitude_deg: float = 11.5
    utc_s: int = 20 * 365 * 86400
    """Date and time at construction, in s since 2000-01-01, with 365 days a year."""
    compass_period_s: float = 0.1
    heading_noise_deg: float = 0.0
    running: bool = False
