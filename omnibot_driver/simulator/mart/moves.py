# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The start of each kind of motion, and its end by a command.

Each step takes the server as an argument, so a copy of the server (``MartServer.copy``) can
continue a motion. This module does not know the words of commands.
"""

from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart import motion as motions
from omnibot_driver.simulator.mart.alarms import change_speed
from omnibot_driver.simulator.mart.files import note_of
from omnibot_driver.simulator.mart.motion import Kind, Motion
from omnibot_driver.simulator.mart.state import COMMAND
from omnibot_driver.simulator.mart.stop_port import end_motion

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

BIAS_SAMPLES = 10
PATIENCE_SAMPLES = 50
PROBE_S = 0.5
WRITES_S = 0.005
LINEAR_S = REFERENCE_S = 0.015
"""Time in s in which the server sets up the motor board before a linear or reference move."""


def start_linear(server: "MartServer", word: str, *, backward: bool) -> None:
    """Start an uncontrolled move (F, B), which has no target distance."""
    motion = server.motions[Kind.LINEAR]
    motion.word, motion.backward, motion.no_clearance = word, backward, False
    motion.speed = server.custom.get("linear", (5, motions.SPEEDS[word]))[1]
    server.starting = Kind.LINEAR
    server.sampling_since_s = server.now_s
    server.later(motions.SETUP_S, _set_up, Kind.LINEAR, server.custom.get("linear", (5, 0))[0])


def start_controlled(
    server: "MartServer",
    inches: int,
    word: str,
    *,
    kind: Kind = Kind.CONTROLLED_LINEAR,
    backward: bool = False,
    docking: bool = False,
    no_clearance: bool = False,
    plain: bool = False,
) -> None:
    """Start a move over a distance (TF, TB, PTF, MCF, MCB).

    ``inches``: the distance; 0 or less means no limit. ``plain``: whether the reply contains no
    distance.
    """
    motion = server.motions[kind]
    motion.word, motion.backward = word, backward
    motion.docking, motion.no_clearance = docking, no_clearance
    motion.speed = motions.SPEEDS[word]
    motion.target = -1 if plain else inches
    motion.reported_in = 0.0
    motion.running = True
    server.starting = kind
    server.sampling_since_s = server.now_s
    if inches > 0:
        motion.limit(inches)
    else:
        motion.limited = False
    server.later(motions.SETUP_S, _set_up, kind, 5)


def _set_up(server: "MartServer", kind: Kind, acceleration: int) -> None:
    motion = server.motions[kind]
    server.chassis.accelerate(acceleration)
    server.chassis.reset_encoders()
    clearance_in = motion.clearance_in
    motion.begin(server.now_s)
    motion.clearance_in = clearance_in
    if kind in (Kind.LINEAR, Kind.REFERENCE):
        motion.posts = 0
    take_bias(server, kind, BIAS_SAMPLES, 0)


def take_bias(server: "MartServer", kind: Kind | None, left: int, missed: int) -> None:
    """Take a sample of the gyro bias, before a motion or for the bias measurement SB.

    * ``kind``: the motion that starts after the last sample; None for SB.
    * ``left``: samples still to take.
    * ``missed``: samples in a row that have failed.
    """
    if server.imu.living(server.now_s):
        left, missed = left - 1, 0
    else:
        missed += 1
    if left:
        if missed > PATIENCE_SAMPLES and not server.quirks.moves_wait_for_imu:
            server.abort(f"fail {motions.MPU_LOST}")
            return
        server.later(motions.BIAS_SAMPLE_S, take_bias, kind, left, missed)
        return
    server.imu.learn()
    if kind is None:
        server.starting = None
        server.answer("ok")
        return
    server.later(LINEAR_S, _go_linear, kind)


def _go_linear(server: "MartServer", kind: Kind) -> None:
    motion = server.motions[kind]
    register = 128 + motion.speed if motion.backward else 128 - motion.speed
    _go(server, motion, register, register)
    server.wait(COMMAND, kind, started if kind is Kind.LINEAR else controlled_done, kind)


def _go(server: "MartServer", motion: Motion, right: int, left: int) -> None:
    motion.right, motion.left = right, left
    motion.started_s = server.now_s
    server.drive(right, left)
    server.watch(motion.kind)


def start_reference(server: "MartServer", speed: int) -> None:
    """Start a reference move (RM), a forward drive with changes of speed."""
    motion = server.motions[Kind.REFERENCE]
    motion.speed, motion.backward, motion.no_clearance = speed, False, False
    server.starting = Kind.REFERENCE
    server.later(REFERENCE_S, _go_reference, speed)


def _go_reference(server: "MartServer", speed: int) -> None:
    motion = server.motions[Kind.REFERENCE]
    server.chassis.accelerate(5)
    server.chassis.reset_encoders()
    samples = motion.samples
    motion.begin(server.now_s)
    if server.quirks.reference_start_counts_on:
        # RM fails at once if its last stop took 0.56 s to 0.6 s. If that stop took longer, RM waits
        # endlessly for a stuck motor.
        motion.samples = samples
    server.zero_heading()
    server.sampling_since_s = server.now_s
    _go(server, motion, 128 - speed, 128 - speed)
    server.wait(COMMAND, Kind.REFERENCE, started, Kind.REFERENCE)


def start_spin(server: "MartServer", word: str, *, left: bool) -> None:
    """Start an uncontrolled spin (R, L), which has no target angle."""
    server.motions[Kind.SPIN].word = word
    server.starting = Kind.SPIN
    server.later(WRITES_S, _go_spin, Kind.SPIN, left)


def start_controlled_spin(server: "MartServer", angle_deg: int, word: str, *, left: bool) -> None:
    """Start a spin by an angle (MCR, MCL).

    An angle of 0 degrees or less only tests the IMU, but with the quirk ``probe_turns``, the motors
    run.
    """
    motion = server.motions[Kind.CONTROLLED_SPIN]
    motion.word = "SLOW" if angle_deg < motions.SMALL_SPIN_DEG else word
    motion.target = angle_deg
    motion.running = True
    server.starting = Kind.CONTROLLED_SPIN
    if angle_deg <= 0 and not server.quirks.probe_turns:
        server.chassis.reset_encoders()
        server.later(PROBE_S, _probed)
    else:
        server.later(WRITES_S, _go_spin, Kind.CONTROLLED_SPIN, left)


def _probed(server: "MartServer") -> None:
    motion = server.motions[Kind.CONTROLLED_SPIN]
    motion.begin(server.now_s)
    motion.watching = motion.starting = False
    motion.error = "" if server.imu.living(server.now_s) else motions.MPU_LOST
    controlled_done(server, Kind.CONTROLLED_SPIN)


def _go_spin(server: "MartServer", kind: Kind, left: bool) -> None:
    motion = server.motions[kind]
    acceleration, speed = server.custom.get("spin", (0, 0))
    if motion.word != "CUSTOM":
        acceleration, speed = 5, motions.SPEEDS[motion.word]
    motion.speed = speed
    server.chassis.accelerate(acceleration)
    server.chassis.reset_encoders()
    motion.begin(server.now_s)
    turn = -speed if left else speed
    _go(server, motion, 128 + turn, 128 - turn)
    server.wait(COMMAND, kind, started if kind is Kind.SPIN else controlled_done, kind)


def started(server: "MartServer", kind: Kind) -> None:
    """Answer the command that has started an uncontrolled motion, or has failed to start it."""
    motion = server.motions[kind]
    server.starting = None
    if kind is Kind.REFERENCE and (server.settings.reference_start_fails or motion.error):
        told = Kind.LINEAR if server.quirks.reference_start_counts_on else kind
        server.answer(f"fail {server.motions[told].error}")
    elif motion.error:
        server.answer(f"fail {motion.error}")
    else:
        motion.running = True
        server.answer("ok")


def controlled_done(server: "MartServer", kind: Kind) -> None:
    """End a controlled motion: save its file, and answer the command that has started it."""
    motion = server.motions[kind]
    server.starting = None
    motion.running = False
    if not server.quirks.echoes_distance:
        motion.reported_in = abs(server.driven_m) * motions.INCHES_PER_M
    server.save(note_of(server, motion))
    if motion.error:
        server.answer(f"fail {motion.error}")
    elif kind is Kind.CONTROLLED_LINEAR and motion.target >= 0:
        server.answer(f"ok {last_distance_in(server)}")
    else:
        server.answer("ok")


def last_distance_in(server: "MartServer") -> int:
    """Return the distance of the last TF, TB or PTF, in inches."""
    return round(server.motions[Kind.CONTROLLED_LINEAR].reported_in)


def stop(server: "MartServer", kind: Kind) -> None:
    """Stop a motion that has no target distance or angle (SM, SRM)."""
    if end_motion(server, server.motions[kind]):
        server.wait(COMMAND, kind, stopped, kind)
    else:
        server.later(WRITES_S, stopped, kind)


def stopped(server: "MartServer", kind: Kind) -> None:
    """Answer a stop (SM or SRM) after the robot has come to rest, or has failed to do so."""
    motion = server.motions[kind]
    motion.running = motion.released = False
    if kind is Kind.LINEAR:
        server.custom.pop("linear", None)
    if kind is not Kind.REFERENCE:
        server.save(note_of(server, motion))
    if motion.error:
        server.answer(f"fail {motion.error}")
    elif kind is Kind.SPIN:
        server.answer(f"ok {round(motion.angle_deg)}")
    else:
        server.answer("ok")


def change_linear(server: "MartServer", right: int, left: int) -> bool:
    """Change the speeds of the drive F or B (CS). Return whether the server accepts the change."""
    motion = server.motions[Kind.LINEAR]
    if motion.stopping:
        return False
    change_speed(server, motion, right, left)
    return True


def change_reference(server: "MartServer", right: int, left: int) -> bool:
    """Change the speeds of a forward drive (RMCS). Return whether the server accepts the change."""
    motion = server.motions[Kind.REFERENCE]
    if motion.stopping or motion.starting:
        return False
    if right or left:
        fast = min(motion.right, motion.left) < motions.FAST_REGISTER
        if fast and motion.right - right == 128 == motion.left - left:
            server.chassis.accelerate(2)
        change_speed(server, motion, right, left)
    return True
