# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of a simulated MART controller and its robot: sizes, simulated faults, firmware.

``Quirks`` are the deviations of the public server from its manual, with one switch each. So a
driver can be tested against the manual, the public server, or a single deviation.
"""

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """Deviations of the public server from its manual: none by default.

    stop_port_keeps_motion: SL stops F, B and RM, but the server regards the motion as still in
        progress. So the server refuses every later motion with a conflict, and a later SM or SRM
        hangs the command port permanently.
    spin_stop_ends_drives: SS stops F, B and RM, as SL does.
    early_stop_is_ignored: before the reply to F, B, R, L or RM, a stop on the stop port has no
        effect.
    left_spin_in_reference_move: L is accepted during RM, and hangs the command port.
    moves_wait_for_imu: F, B, TF, TB and SB wait until a dead IMU works again, and then continue.
    drives_trust_imu: RM, R and L start without a working IMU. Every uncontrolled motion continues
        without a working IMU. Without samples of the IMU, the server detects neither obstacles nor
        the start and the stop of the motion.
    reference_speed_wraps: RM with a speed below 1 or above 127 writes a register value that wraps
        around. RMCS then limits the value.
    reference_start_counts_on: RM counts samples until the wheel turns. The count does not begin at
        zero, but at the number of samples that the previous stop of RM took. If that stop took 0.56
        to 0.6 s, RM fails at once. If it took longer, RM waits endlessly for a stuck motor. The
        reply to a failed RM gives the reason why the last F or B failed.
    speed_word_first: a speed word has an effect only before the number. After the number it is
        ignored.
    zero_distance_is_unlimited: TF, TB, MCF and MCB with 0 inches, or with a word instead of a
        number, drive until stopped.
    echoes_distance: the reply to TF and TB has the distance computed from time, not the distance
        driven.
    crashes_on_missing_numbers: TIME, CS, MCS, SFR and SRR with too few numbers end the server.
    crashes_early: VOLTS and all motions except F and B end a server that has just started.
    empty_datagram_ends: an empty datagram at the command port ends the server.
    exit_is_silent: EXIT is answered only if LOG was sent before.
    log_deletes_files: LOG deletes the files of LAST MOVE and LAST TURN, so that these commands
        fail.
    unknown_reset_repeats: the reply to RST with an unknown word is a copy of the previous reply.
    clock_moves_heading: TIME during a motion changes the heading by the turn rate times the jump of
        the clock.
    undocumented_commands: commands that are not in the manual are accepted. Without this quirk, ENC
        is the only undocumented command that is accepted.
    heading_in_reference_moves_only: the heading of RMRA changes during RM only, according to the
        public source. But the running server that was observed updates this heading at any time.
    probe_turns: according to the public source, MCR by 0 runs the motors until the wheel moves. If
        the IMU is dead, it runs them for 0.5 s.
    heading_starts_off: according to the public source, the first sample of RM changes the heading.
        The change is half the turn rate times the time since the last sample of the previous RM.
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


DOCUMENTED = Quirks()
_SOURCE_ALONE = ("heading_in_reference_moves_only", "probe_turns", "heading_starts_off")
FIRMWARE = Quirks(
    **{field.name: True for field in fields(Quirks) if field.name not in _SOURCE_ALONE}
)
"""Quirks that were observed on the running public server."""
SOURCE = replace(FIRMWARE, spin_stop_ends_drives=False, **dict.fromkeys(_SOURCE_ALONE, True))
"""Quirks of the public source code. They equal ``FIRMWARE``, except where the code contradicts what
was observed on the running server."""

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

    speed_mps_per_unit: wheel speed for one register unit at ``nominal_volts``. The speed grows with
        the voltage.
    dead_zone_units: effort that is needed before a motor turns. Only effort beyond it gives speed.
    motor_inequality: how much faster the left motor is than the right one, as a fraction of the
        speed.
    encoder_sign: -1 if the encoder counts down while the robot drives forward.
    gyro_bias_dps: bias of the gyro, which the server does not know before SB.
    gyro_noise_dps: standard deviation of a sample of the gyro while a wheel turns.
    imu_dies_s, imu_returns_s: times since construction at which the IMU fails and works again.
    stuck: wheels that do not turn.
    motor_board_silent: whether the serial line to the motor board is cut.
    motor_status: bits of MCSTAT, except those of the voltage. A tripped or short-circuited motor
        stops.
    front_m, rear_m: distances from the start to walls across the x axis.
    dock_m: distance from the start forward to the dock.
    reference_start_fails: whether the server answers ``fail`` to RM although the robot moves.
    clock_s: initial wall clock in Unix time.
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
