# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a simulated LOIS ECU and its robot are like: nominal values, planted errors, firmware.

``Quirks`` are the ways in which the public firmware departs from the manual, one switch each, so
that a driver can be tried against either, or against one of them alone.
"""

from dataclasses import dataclass, fields
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """All off: as the manual says. All on: as the public firmware does.

    ticks_of_forward_targets: ticks count up, and only while the wheel's RPM target is positive.
    odometry_stands_at_equal_speeds: its position does not move while both integer RPMs are equal.
    velocity_may_be_nan: two ticks within one count of the timer divide by zero.
    sign_of_command: the speed has the target's sign, not the wheel's.
    keeps_speed_of_stalled_wheel: a wheel that does not tick keeps its last speed.
    duty_drags_target: negative duty pulls the wheel's RPM target down with each tick.
    reverse_runs_fast: so does the controller's own negative duty, until its next step.
    low_pass_starts_at_zero: no RPM is ever reached until 0x23 is written.
    extra_settings: 0x21 to 0x23 exist.
    appends_odometry: 0x12 sends the odometry behind the ticks, under its own number.
    clock_in_ms: the time of 0x12 is in ms.
    clock_stops_while_sending: and does not run while a group is sent.
    deaf_while_sending: characters that come meanwhile are lost, but for the first.
    deaf_while_counting: the same for 0.2 ms with each tick.
    button_waits_while_sending: a press takes the power away when the group, or record, has gone.
    odometry_period_is_fixed: writing 0x20's period does nothing.
    terminal_mode_zeroes_correction: every write of 0x11 overwrites the left short correction.
    button_is_lost_in_terminal_mode: a press is not told.
    terminal_mixes_sensors: each mode passes on both sensors, character by character.
    reset_clears_ticks_only: odometry and set-points stay.
    terminal_passes_input_on: what the host says goes to the sensor at its baud rate (9600, 4800),
        and the board reads no further before it has gone.
    one_ball_in_six_seconds: 0x19 is ignored while a ball is on its way.
    gps_is_ignored: position, time and date are zeros.
    headings_average_over_north: the mean of 359, 1 and 1 is 120.
    records_in_100_us: not in 100 ns.
    torque_comes_as_rpm: the answer to 0x17 has the number 0x04.
    record_waits_for_one_more: headings are sent when sample n + 1 is there.
    large_records_never_end: more than 1024 samples do not fit.
    lenient_hex: a payload that is not a number is obeyed if its checksum is right.
    limits_rpm: beyond 50 RPM it drives 50.
    fast_control: each 91 ms instead of 200 ms, with the same coefficients.
    slow_timer: one count of 100 us takes 100.7 us, so each speed is reported 0.7 % too high.
    slow_boot: silent and deaf for two seconds; what comes meanwhile is read then.
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
    """A motor of first order with dry friction.

    rpm_per_percent: beyond the dead zone; friction_rpm_per_s: how fast it slows down without power,
    besides the time constant. second_time_constant_s, dead_time_s: of the power stage, before the
    motor; backlash_turns: of the wheel, between motor and encoder.
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
    """The board, its robot, and where it is.

    wheel_radius_scale, track_scale: true over nominal. slip: standard deviation in m of the way of
    a wheel after 1 m. load_percent: of duty, standard deviation of what the ground takes, changing
    within half a second. start_latitude_deg ...: where x = y = 0 is; x is east.
    mark_noise: of the encoders' marks, standard deviation of the way from one to the next, as part
    of it. heading_noise_deg: of each raw heading. running: it has booted already.
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
    """Seconds of the day and the date begin from this, counted from 2000-01-01, 365 days a year."""
    compass_period_s: float = 0.1
    heading_noise_deg: float = 0.0
    running: bool = False
