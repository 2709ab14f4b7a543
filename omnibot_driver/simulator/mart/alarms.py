# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Supervision of a motion in progress, 100 times a second, as in the real server.

It detects starts, stops and near obstacles, and ends controlled moves. This module does not know
commands.
"""

from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart import motion as motions
from omnibot_driver.simulator.mart.files import note_of
from omnibot_driver.simulator.mart.motion import SAMPLE_S, Kind, Motion

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

CORRECTS_AFTER_S = 0.25
LARGEST_CORRECTION = 30
GAINS = (4.0, 0.05, 10.0)
_TIMED = (Kind.CONTROLLED_LINEAR, Kind.MEASURED_LINEAR)


def stop_motors(server: "MartServer", motion: Motion) -> None:
    """Write the value for stop to both motor registers.

    Later calls of ``sample`` wait until the right wheel (with the encoder) is at rest.
    """
    if motion.kind is Kind.REFERENCE and (
        motion.left < motions.FAST_REGISTER or motion.right < motions.FAST_REGISTER
    ):
        server.chassis.accelerate(2)
        motion.stop_samples = motions.SLOW_STOP_SAMPLES
    server.drive(128, 128)
    server.sampling_since_s = -1.0
    motion.right = motion.left = 128
    motion.samples = motion.same = 0
    motion.starting, motion.stopping = False, True
    motion.clearance_in = motions.FRONT_CLEARANCE_IN


def sample(server: "MartServer", motion: Motion) -> None:
    """Supervise the motion for one sample period of 10 ms."""
    kind, now = motion.kind, server.now_s
    if kind in _TIMED:
        _watch_clearance(server, motion)
        if motion.docking and not (motion.stopping or motion.starting) and server.docked:
            stop_motors(server, motion)
    if not server.imu.living(now):
        _miss(server, motion)
        return
    if kind is Kind.REFERENCE:
        server.sample_reference(first=motion.sampled_s < 0.0)
    motion.sampled_s = now
    if kind is Kind.LINEAR or kind is Kind.REFERENCE:
        _watch_clearance(server, motion)
    rate = server.imu.rate_dps
    motion.angle_deg += (motion.last_rate + rate) / 2 * SAMPLE_S
    motion.last_rate = rate
    motion.sample_count += 1
    encoder, motion.encoder = motion.encoder, server.chassis.encoder
    if motion.starting:
        _start(server, motion, encoder)
    elif motion.stopping:
        _stop(server, motion, encoder)
    elif kind is Kind.CONTROLLED_SPIN:
        offset = motions.STOP_OFFSET_DEG[motion.word]
        if abs(motion.angle_deg) + offset >= motion.target:
            stop_motors(server, motion)
    elif kind in _TIMED:
        _hold_course(server, motion)
    motion.last_encoder = encoder


def _miss(server: "MartServer", motion: Motion) -> None:
    """End the motion with an error if samples of the IMU have been missing for too long.

    With the quirk ``drives_trust_imu``, only controlled motions are checked.
    """
    if server.quirks.drives_trust_imu and motion.kind not in (*_TIMED, Kind.CONTROLLED_SPIN):
        return
    now, last = server.now_s, motion.sampled_s
    if (last >= 0.0 and now - last > motions.LOST_S) or (
        last < 0.0 and now - motion.started_s > motions.LOST_AT_START_S
    ):
        stop_motors(server, motion)
        motion.error = motions.MPU_LOST
        _end(server, motion)


def _watch_clearance(server: "MartServer", motion: Motion) -> None:
    if motion.starting or motion.stopping or motion.no_clearance:
        return
    least = motions.REAR_CLEARANCE_IN if motion.backward else motion.clearance_in
    seen = server.clearance_in(backward=motion.backward)
    if seen == -1 or seen >= least:
        return
    stop_motors(server, motion)
    if motion.kind in _TIMED:
        side = "rear" if motion.backward else "front"
        motion.error = f"Insufficient {side} clearance."
    elif motion.kind is Kind.LINEAR:
        motion.error = "insufficent clearence"
    else:
        motion.error = "insufficient clearance"


def _start(server: "MartServer", motion: Motion, encoder: int) -> None:
    motion.samples += 1
    if motion.samples == motions.START_SAMPLES:
        stop_motors(server, motion)
        motion.error = "start timedout"
        _end(server, motion)
    elif encoder:
        motion.starting = False
        motion.samples = 0
        motion.moved_s = server.now_s
        if motion.kind not in (*_TIMED, Kind.CONTROLLED_SPIN):
            server.post(motion.kind)


def _stop(server: "MartServer", motion: Motion, encoder: int) -> None:
    motion.samples += 1
    if motion.samples == motion.stop_samples:
        stop_motors(server, motion)
        words = {Kind.CONTROLLED_SPIN: "start timedout", Kind.CONTROLLED_LINEAR: "stop timedout"}
        motion.error = words.get(motion.kind, "stop time out")
        _end(server, motion)
    elif motion.samples > 1 and encoder == motion.last_encoder:
        motion.same += 1
        if motion.same == motions.STILL_SAMPLES:
            motion.reported_in = _timed_distance_in(motion)
            _end(server, motion)
    else:
        motion.same = 0
        motion.turned_s = server.now_s


def _end(server: "MartServer", motion: Motion) -> None:
    server.alarm = None
    motion.watching = False
    if motion.released:
        motion.running = motion.released = False
    if motion.kind is Kind.REFERENCE:
        server.save(note_of(server, motion))
    server.post(motion.kind)


def _timed_distance_in(motion: Motion) -> float:
    """Return the distance in inches, computed from time and calibration alone.

    The server has an error, which is simulated: it adds the distance of acceleration and
    deceleration in feet to a distance in inches.
    """
    if motion.kind not in _TIMED:
        return 0.0
    ramps_s, top_inps = sum(motions.RAMPS_S[motion.word]), motions.TOP_SPEED_INPS[motion.word]
    ran_s = motion.turned_s - motion.moved_s
    return max(0.0, ramps_s * top_inps / 24 + (ran_s - ramps_s) * top_inps)


def _hold_course(server: "MartServer", motion: Motion) -> None:
    since_s = server.now_s - motion.moved_s
    if motion.limited and since_s >= motion.stop_after_s:
        stop_motors(server, motion)
    if since_s <= CORRECTS_AFTER_S:
        return
    if motion.stopping and not server.quirks.corrects_after_stop:
        return
    proportional, integral, differential = GAINS
    angle = motion.angle_deg
    motion.angle_sum += angle
    correction = int(proportional * angle) + integral * motion.angle_sum
    if not motion.first_sample:
        correction += int(differential * (angle - motion.last_angle))
    motion.first_sample = False
    motion.last_angle = angle
    change = int(correction) - motion.correction
    motion.correction += change
    if abs(motion.correction) >= LARGEST_CORRECTION:
        stop_motors(server, motion)
        motion.error = "excessive gyro correct"
    elif change:
        change_speed(server, motion, -change, change)


def change_speed(server: "MartServer", motion: Motion, right: int, left: int) -> None:
    """Change the speeds of both wheels, in units of the motor registers; forward is positive.

    A wheel beyond full speed gets full speed, and the other wheel loses the excess. A wheel that
    would change its direction stops.
    """
    new_right, new_left = motion.right - right, motion.left - left
    if motion.backward:
        if new_right > 255:
            new_left, new_right = new_left - (new_right - 255), 255
        if new_left > 255:
            new_right, new_left = new_right - (new_left - 255), 255
        new_right, new_left = max(new_right, 128), max(new_left, 128)
    else:
        if new_right < 0:
            new_left, new_right = new_left - new_right, 0
        if new_left < 0:
            new_right, new_left = new_right - new_left, 0
        new_right, new_left = min(new_right, 128), min(new_left, 128)
    motion.right, motion.left = new_right, new_left
    server.drive(new_right, new_left)
