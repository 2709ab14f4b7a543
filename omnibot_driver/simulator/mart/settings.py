# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a simulated MART motion controller and its robot are like: sizes, planted faults, firmware.

``Quirks`` are the ways in which the public server departs from its manual, one switch each, so that
a driver can be tried against either, or against one of them alone.
"""

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """All off: as the manual says.

    stop_port_keeps_motion: SL ends F, B and RM, but the motion stays in progress: all that follows
        fails with a conflict, and SM or SRM hangs the command port for good.
    spin_stop_ends_drives: SS does to F, B and RM what SL does.
    early_stop_is_ignored: a stop on the stop port before the reply to F, B, R, L or RM.
    left_spin_in_reference_move: L during RM is accepted, and hangs the command port.
    moves_wait_for_imu: F, B, TF, TB and SB wait for a dead IMU, and then go on.
    drives_trust_imu: RM, R and L start without a living IMU, and every uncontrolled motion goes on
        without one, blind to obstacles. Only samples of the IMU see that it started or stopped.
    reference_speed_wraps: RM below 1 or above 127 is a register that wraps, and RMCS clamps it.
    reference_start_counts_on: RM counts the samples until the wheel turns from where its last stop
        left off. After a stop of 0.56 to 0.6 s it fails at once; after a longer one it waits for a
        stuck motor for good. The reason that it gives is that of the last F or B.
    speed_word_first: a speed word counts in front of the number only. Behind it, it is ignored.
    zero_distance_is_unlimited: TF, TB, MCF and MCB by 0 inches, or by a word, drive until stopped.
    echoes_distance: TF and TB answer what they should have driven.
    crashes_on_missing_numbers: TIME, CS, MCS, SFR and SRR with fewer numbers end the server.
    empty_datagram_ends: so does an empty datagram.
    exit_is_silent: EXIT without LOG before is not answered.
    log_deletes_files: LOG deletes the files of LAST MOVE and LAST TURN, which are then not there.
    unknown_reset_repeats: RST of something unknown is answered by the last reply.
    clock_moves_heading: TIME during a motion turns the relative heading with it.
    undocumented_commands: those that the manual does not have, ENC apart.
    heading_in_reference_moves_only: RMRA stands still but in RM. So the public source reads; the
        server that was run answers RMRA at any time.
    probe_turns: MCR by 0 starts the motors until the wheel moves, or for 0.5 s if the IMU is dead.
        So the public source reads.
    heading_starts_off: the first sample of RM counts the time since the one before. So the public
        source reads.
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
"""As the public server was seen to behave."""
SOURCE = replace(FIRMWARE, spin_stop_ends_drives=False, **dict.fromkeys(_SOURCE_ALONE, True))
"""The same where its source says something else than what was seen."""

Firmware = Literal["documented", "firmware", "source"]
QUIRKS: dict[Firmware, Quirks] = {
    "documented": DOCUMENTED,
    "firmware": FIRMWARE,
    "source": SOURCE,
}

Stuck = Literal["none", "left", "right", "both"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MartSettings:
    """The controller, its robot, and where it is.

    speed_mps_per_unit: of a wheel at nominal_volts; the speed grows with the voltage.
    dead_zone_units: a motor stands below it. motor_inequality: how much faster the left motor is
    than the right one, as a part of the speed. encoder_sign: -1 where forward counts down.
    gyro_bias_dps: what the server does not know of. gyro_noise_dps: standard deviation of a sample
    while a wheel turns. imu_dies_s, imu_returns_s: since construction. stuck: wheels that do not
    turn. motor_board_silent: its serial line is cut. motor_status: bits of MCSTAT, besides those of
    the voltage; a tripped or short motor stops. front_m, rear_m: walls across the way, from where
    the robot begins. dock_m: the way forward to the dock. reference_start_fails: a build that
    answers ``fail`` to RM, and moves. clock_s: what its wall clock shows at first, in Unix time.
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
