# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of a simulated MART controller and its robot: sizes, simulated faults, firmware.

Each deviation of the public server from its manual has a switch in ``Quirks``.
"""

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Deviations of the public server from its manual. By default, all are off.

    ``heading_in_reference_moves_only`` and the three deviations after it were found in the public
    source, not on the running server.

    * ``stop_port_keeps_motion``: SL stops F, B and RM, but the server still regards the motion as
      running: it refuses later motions, and a later SM or SRM hangs the command port.
    * ``spin_stop_ends_drives``: SS stops F, B and RM, as SL does.
    * ``early_stop_is_ignored``: the stop port has no effect before the reply to F, B, R, L or RM.
    * ``left_spin_in_reference_move``: L is accepted during RM, and hangs the command port.
    * ``moves_wait_for_imu``: F, B, TF, TB, PTF, MCF, MCB and SB wait for a working IMU.
    * ``drives_trust_imu``: without an IMU, RM, R and L start, and uncontrolled motions continue,
      but the server does not detect obstacles, or that the robot starts or stops.
    * ``reference_speed_wraps``: speeds below 1 or above 127 wrap around in RM; RMCS limits them.
    * ``reference_start_counts_on``: RM continues the previous RM's count of samples, so RM may
      fail at once. The reply to a failed RM has the error of the last F or B.
    * ``speed_word_first``: a speed word after the number is ignored.
    * ``zero_distance_is_unlimited``: TF, TB, MCF and MCB with 0 or a word as distance have no
      limit.
    * ``echoes_distance``: TF and TB report the distance computed from time, not the driven
      distance.
    * ``crashes_on_missing_numbers``: TIME, CS, MCS, SFR, SRR and SDR end the server if a number is
      missing.
    * ``crashes_early``: VOLTS and all motions except F and B end a server that has just started.
    * ``empty_datagram_ends``: an empty datagram at the command port ends the server.
    * ``exit_is_silent``: EXIT is answered only if LOG was sent before.
    * ``log_deletes_files``: LOG deletes the files of LAST MOVE and LAST TURN.
    * ``unknown_reset_repeats``: RST with an unknown word repeats the previous reply.
    * ``clock_moves_heading``: TIME in a motion adds turn rate * clock jump to the heading.
    * ``undocumented_commands``: the server has several undocumented commands. Without this quirk,
      it has only one of them, ENC.
    * ``heading_in_reference_moves_only``: the heading of RMRA changes in RM only.
    * ``probe_turns``: MCR 0 runs the motors until the wheel moves; with a dead IMU, for 0.5 s.
    * ``heading_starts_off``: at the first sample of RM, the heading of RMRA grows by half the turn
      rate times the time since the previous RM.
    * ``corrects_after_stop``: TF, TB, PTF, MCF and MCB may correct the heading even in the sample
      in which they stop by themselves. This leaves one motor on, usually with one unit.
    """

    stop_port_keeps_motion: bool = False
    spin_stop_ends_drives: bool = False
    early_stop_is_ignored: bool = False
    left_spin_in_reference_move: bool = False
    moves_wait_for_imu: bool = False
    drives_trust_imu: bool = False
    reference_speed_wraps: bool = False
    reference_start_counts_on: bool = False
    speed_word_first: bool = False
    zero_distance_is_unlimited: bool = False
    echoes_distance: bool = False
    crashes_on_missing_numbers: bool = False
    crashes_early: bool = False
    empty_datagram_ends: bool = False
    exit_is_silent: bool = False
    log_deletes_files: bool = False
    unknown_reset_repeats: bool = False
    clock_moves_heading: bool = False
    undocumented_commands: bool = False
    heading_in_reference_moves_only: bool = False
    probe_turns: bool = False
    heading_starts_off: bool = False
    corrects_after_stop: bool = False


DOCUMENTED = Quirks()
_SOURCE_ALONE = (
    "heading_in_reference_moves_only",
    "probe_turns",
    "heading_starts_off",
    "corrects_after_stop",
)
FIRMWARE = Quirks(
    **{field.name: True for field in fields(Quirks) if field.name not in _SOURCE_ALONE}
)
"""Quirks that were observed on the running public server."""
SOURCE = replace(FIRMWARE, spin_stop_ends_drives=False, **dict.fromkeys(_SOURCE_ALONE, True))
"""Quirks in the public source code: those of ``FIRMWARE`` and four that were found only in this
code, but not ``spin_stop_ends_drives``, which the code contradicts."""

Firmware = Literal["documented", "firmware", "source"]
QUIRKS: dict[Firmware, Quirks] = {
    "documented": DOCUMENTED,
    "firmware": FIRMWARE,
    "source": SOURCE,
}

Stuck = Literal["none", "left", "right", "both"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MartSettings:
    """Settings of the controller, its robot and its surroundings.

    * ``speed_mps_per_unit``: wheel speed per register unit beyond the dead zone, at
      ``nominal_volts``.
    * ``dead_zone_units``: number of register units up to which a motor does not turn.
    * ``motor_inequality``: how much faster the left motor is, as a fraction of the speed.
    * ``encoder_sign``: -1 if the encoder counts down while the robot drives forward.
    * ``gyro_bias_dps``: bias of the gyro, which the server measures before linear moves and in SB.
    * ``gyro_noise_dps``: standard deviation of a gyro sample while a wheel turns.
    * ``imu_dies_s``, ``imu_returns_s``: times since construction at which the IMU fails and works
      again.
    * ``motor_board_silent``: whether the serial line to the motor board is cut.
    * ``motor_status``: status bits except those of the voltage. A trip or short circuit stops the
      motor.
    * ``front_m``, ``rear_m``: distances from the start to walls across the x axis.
    * ``dock_m``: distance from the start to the dock, forward.
    * ``reference_start_fails``: whether the server answers ``fail`` to RM although the robot moves.
    * ``clock_s``: initial wall clock in Unix time.
    """

    quirks: Quirks = FIRMWARE
    seed: int = 0
    speed_mps_per_unit: float = 0.0078
    metres_per_count: float = 0.0004
    encoder_sign: int = 1
    track_m: float = 0.40
    volts: float = 24.0
    nominal_volts: float = 24.0
    dead_zone_units: float = 0.0
    motor_inequality: float = 0.0
    motor_lag_s: float = 0.05
    gyro_bias_dps: float = 0.02
    gyro_noise_dps: float = 1.0
    imu_dies_s: float = inf
    imu_returns_s: float = inf
    stuck: Stuck = "none"
    motor_board_silent: bool = False
    motor_status: int = 0
    front_m: float = inf
    rear_m: float = inf
    dock_m: float = inf
    reference_start_fails: bool = False
    clock_s: int = 946_684_800
