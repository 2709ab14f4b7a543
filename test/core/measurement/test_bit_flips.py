# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One bit of one frame is changed: which wrong values are published, and for how long."""

import math
import struct
from collections.abc import Callable

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from session_bench import TICK_S, Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings

IMU, DELTA, POSE = b"\xff\xfa", b"\xff\xfb", b"\xff\xfc"
PAYLOADS = {IMU: 12, DELTA: 7, POSE: 13}

flips = st.sampled_from([IMU, DELTA, POSE]).flatmap(
    lambda kind: st.tuples(
        st.just(kind), st.integers(0, PAYLOADS[kind] - 1), st.integers(0, 7), st.integers(0, 40)
    )
)
"""Tuples that say which bit to change, and when.

Each tuple: kind of frame, number of the byte in its payload, number of the bit in this byte, and
number of ticks before the change.
"""


class Drive:
    """A drive in curves, away from the origin, in which one bit of one frame is changed."""

    def __init__(self, frame: str = "earth") -> None:
        start = BoardPose(3000.0, -2000.0, 700.0)
        self.bench = Bench(BoardSettings(frame=frame, running=True, initial_pose=start))
        self.flip: Callable[[bytes], bytes] = lambda data: data
        self.flipped = False
        self.worst_m = self.worst_rad = 0.0
        self.last = Pose()
        step = self.bench.board.step
        self.bench.board.step = lambda: self.flip(step())  # type: ignore[method-assign]
        self.attached = self.told()
        self.bench.open()
        self.run(1.2)

    def told(self) -> Pose:
        pose = self.bench.board.odometry
        return Pose(pose.x_mm / 1000, pose.y_mm / 1000, pose.theta_mrad / 1000)

    @property
    def error(self) -> Pose:
        last = next(e for e in reversed(self.bench.events) if isinstance(e, OdometryEstimate))
        off = last.pose - self.attached.way_to(self.told())
        return Pose(off.x_m, off.y_m, math.remainder(off.yaw_rad, math.tau))

    def run(self, seconds: float) -> None:
        """Drive curves for ``seconds``. Record odom's errors once a bit of a frame has changed.

        The attribute ``last`` is the newest error. ``worst_m`` and ``worst_rad`` are the largest
        errors.
        """
        for _ in range(round(seconds / TICK_S)):
            t, before = self.bench.now, len(self.bench.events)
            if self.bench.session.state == "nominal" and round(t / TICK_S) % 5 == 0:
                self.bench.drive(0.3 * math.sin(0.9 * t), 0.3 * math.cos(1.3 * t), 0.4)
            self.bench.run(TICK_S)
            new = [e for e in self.bench.events[before:] if isinstance(e, OdometryEstimate)]
            if self.flipped and len(new) == 1:
                self.last = self.error
                self.worst_m = max(self.worst_m, self.last.way_m)
                self.worst_rad = max(self.worst_rad, abs(self.last.yaw_rad))

    def arm(self, kind: bytes, byte: int, bit: int) -> None:
        """Change one bit of one byte in the next frame of the given kind."""

        def flip(data: bytes) -> bytes:
            at = begins(data, kind)
            if self.flipped or at < 0:
                return data
            self.flipped = True
            changed = bytearray(data)
            changed[at + 2 + byte] ^= 1 << bit
            return bytes(changed)

        self.flip = flip


def begins(data: bytes, kind: bytes) -> int:
    """Return the position of the frame of this kind in a tick's bytes, or −1 if it is missing."""
    lengths = {14: (IMU,), 23: (IMU, DELTA), 29: (IMU, POSE), 38: (IMU, DELTA, POSE)}
    at = 0
    for found in lengths.get(len(data), ()):
        if found == kind:
            return at
        at += 2 + PAYLOADS[found]
    return -1


@pytest.mark.slow
@given(flips)
@example((DELTA, 6, 0, 0))
@example((DELTA, 6, 3, 0))
@example((DELTA, 0, 7, 4))
@example((POSE, 4, 0, 8))
@example((POSE, 12, 0, 8))
@settings(max_examples=25)
def test_a_changed_bit_leaves_little_and_after_1_5_s_nothing(
    flip: tuple[bytes, int, int, int],
) -> None:
    """One bit of a frame is changed. Odom is then wrong by at most 17 mm and 0.052 rad.

    After 1.5 s, odom is right within 1.5 mm and 1.5 mrad.
    """
    kind, byte, bit, ticks = flip
    drive = Drive()
    drive.run(ticks * TICK_S)
    drive.arm(kind, byte, bit)
    drive.run(1.5)
    assert drive.flipped
    assert drive.worst_m < 0.017
    assert drive.worst_rad < 0.052
    assert drive.last.way_m < 1.5e-3
    assert abs(drive.last.yaw_rad) < 1.5e-3
    speeds = [math.hypot(e.twist.vx_mps, e.twist.vy_mps) for e in drive.bench.odometry if e.twist]
    assert max(speeds) < 0.42 + 0.34


@pytest.mark.slow
@given(flips.filter(lambda flip: flip[0] == IMU))
@settings(max_examples=20)
def test_an_imu_word_is_published_wrong_by_half_a_g_at_the_most(
    flip: tuple[bytes, int, int, int],
) -> None:
    """An IMU reading with one changed bit is rejected, or wrong by less than 5 m/s² and 0.6 rad/s.

    All undamaged readings are published.
    """
    _, byte, bit, ticks = flip
    drive = Drive()
    drive.run(ticks * TICK_S)
    drive.arm(IMU, byte, bit)
    drive.run(0.5)
    scale, sent = ImuScale(), []
    for frame in drive.bench.board.sent:
        if frame.data[:2] == IMU:
            words = struct.unpack(">6h", frame.data[2:])
            sent.append((scale.specific_force(words[:3]), scale.angular_velocity(words[3:])))
    got = [
        (event.specific_force, event.angular_velocity)
        for event in drive.bench.events
        if isinstance(event, ImuEstimate)
    ]
    wrong = [reading for reading in got if reading not in sent]
    refused = drive.bench.session.refused.imu
    assert len(wrong) + refused == 1
    assert len(got) == len(sent) - refused
    for number, (force, rate) in enumerate(got):
        if (force, rate) in wrong:
            true_force, true_rate = sent[number]
            assert math.dist(force, true_force) < 5.0
            assert math.dist(rate, true_rate) < 0.6


def test_what_is_refused_is_counted_and_told() -> None:
    """A displacement is damaged and rejected. It is counted and reported in one notice."""
    drive = Drive()
    drive.arm(DELTA, 0, 6)
    drive.run(1.0)
    assert drive.bench.session.refused.displacements == 1
    (notice,) = [text for text in drive.bench.notices if "rejected" in text]
    assert notice.startswith("implausible readings rejected: 1 ")
    assert "1 odometry" in notice


@pytest.mark.slow
@pytest.mark.parametrize(
    ("byte", "bit"),
    [(byte, bit) for byte in range(4) for bit in (range(8) if byte < 2 else (0, 7))],
)
def test_the_first_pose_of_all_turns_nothing_if_it_is_wrong(byte: int, bit: int) -> None:
    """The first pose of the board has a wrong heading. The next two poses are right.

    The odometry uses these two poses, so odom is right.
    """
    start = BoardPose(3000.0, -2000.0, 700.0)
    drive = Drive.__new__(Drive)
    drive.bench = Bench(BoardSettings(running=True, initial_pose=start))
    drive.flipped, drive.worst_m, drive.worst_rad = False, 0.0, 0.0
    step = drive.bench.board.step
    drive.bench.board.step = lambda: drive.flip(step())  # type: ignore[method-assign]
    drive.attached = drive.told()
    drive.arm(POSE, 8 + byte, bit)
    drive.bench.open()
    drive.run(2.0)
    assert drive.flipped
    assert drive.last.way_m < 1.5e-3
    assert abs(drive.last.yaw_rad) < 1.5e-3
