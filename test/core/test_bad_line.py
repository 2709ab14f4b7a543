# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A minute of driving on a bad line, in simulated time. The line loses single bytes and bursts."""

import math
import struct
from collections import deque

import pytest
from session_bench import TICK_S, Bench

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.imu.scale import ImuScale
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.simulator.omnibot import BoardPose, BoardSettings, FaultyLine, LineFaults


class Drive:
    """A drive in curves at up to 0.3 m/s along each axis. The board's first pose is not zero."""

    def __init__(self, frame: str, faults: LineFaults) -> None:
        start = BoardPose(3000.0, -2000.0, 700.0)
        self.bench = Bench(BoardSettings(seed=3, frame=frame, running=True, initial_pose=start))
        self.bench.board.sent = deque()
        self.line = FaultyLine(LineFaults())
        step = self.bench.board.step
        self.bench.board.step = lambda: self.line.carry(step())  # type: ignore[method-assign]
        self.attached = self.told()
        self.errors: list[Pose] = []
        """Differences between odom and the board's own pose at the same tick."""
        self.bench.open()
        self.bench.run(1.0)
        self.line = FaultyLine(faults, seed=3)

    def told(self) -> Pose:
        pose = self.bench.board.odometry
        return Pose(pose.x_mm / 1000, pose.y_mm / 1000, pose.theta_mrad / 1000)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            t, before = self.bench.now, len(self.bench.events)
            if self.bench.board.tick % 5 == 0 and self.bench.session.state == "nominal":
                vx, vy, turn = (math.sin(speed * t) for speed in (0.9, 1.3, 0.5))
                self.bench.drive(0.3 * vx, 0.3 * vy, 0.45 * turn)
            self.bench.run(TICK_S)
            new = [event for event in self.bench.events[before:] if type(event) is OdometryEstimate]
            if new and new[-1].stamp_s > self.bench.now - TICK_S / 2:
                off = new[-1].pose - self.attached.way_to(self.told())
                self.errors.append(Pose(off.x_m, off.y_m, math.remainder(off.yaw_rad, math.tau)))

    def wrong_imu(self) -> int:
        """Return how many IMU readings are out of order or differ from those of the board."""
        scale, number, sent = ImuScale(), 0, list[object]()
        for frame in self.bench.board.sent:
            if frame.data[:2] == b"\xff\xfa":
                words = struct.unpack(">6h", frame.data[2:])
                sent.append((scale.specific_force(words[:3]), scale.angular_velocity(words[3:])))
        wrong = 0
        for event in self.bench.events:
            if type(event) is ImuEstimate:
                try:
                    reading = (event.specific_force, event.angular_velocity)
                    number = sent.index(reading, number, number + 1000) + 1
                except ValueError:
                    wrong += 1
        return wrong


@pytest.mark.slow
@pytest.mark.parametrize(("frame", "minutes"), [("earth", 1.0), ("body", 0.5)])
def test_after_a_minute_of_losses_odom_is_the_boards_own_pose(frame: str, minutes: float) -> None:
    """A line loses 1 byte in 1000, and bursts of bytes.

    Odom is right within 2 cm, and within 1.5 mm after 1.5 s without losses. At most one IMU reading
    per minute is wrong.
    """
    drive = Drive(frame, LineFaults(lose=0.001, burst=0.0005))
    drive.run(60.0 * minutes)
    assert drive.line.lost > 4000 * minutes
    assert len(drive.errors) > 1300 * minutes
    assert max(error.way_m for error in drive.errors) < 0.02
    assert drive.wrong_imu() <= minutes
    drive.line = FaultyLine(LineFaults())
    drive.run(1.5)
    assert drive.errors[-1].way_m < 1.5e-3
    assert abs(drive.errors[-1].yaw_rad) < 1.5e-3
