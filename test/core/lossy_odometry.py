# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated robot on a line that loses frames, and odometry from the frames that arrive."""

import math
from collections.abc import Callable
from random import Random

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.odometry.estimator import Odometry
from omnibot_driver.core.omnibot import OmniBotSettings, decode
from omnibot_driver.core.omnibot.frames import DeltaFrame, Frame, PausedFrame, PoseFrame
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.readings import DisplacementReading, PausedReading, PoseReading
from omnibot_driver.simulator.omnibot import BoardMode, BoardSettings, SimulatedBoard

TICK_S = 0.01
DELTA, POSE, TEXT = b"\xff\xfb", b"\xff\xfc", b"Pa"
Loses = Callable[[bytes, float], bool]


def loses_nothing(_data: bytes, _now: float) -> bool:
    return False


class Line:
    """A line that can lose frames, from a simulated OmniBot board to the driver's odometry.

    All IMU readings are zero. ``loses``: function that returns, for a frame's bytes and the time,
    whether the frame is lost.
    """

    def __init__(
        self,
        board: BoardSettings,
        settings: OdometrySettings | None = None,
        *,
        loses: Loses = loses_nothing,
        seed: int = 0,
    ) -> None:
        self.board = SimulatedBoard(board)
        self.board._imu.read = lambda _world: ((0, 0, 0), (0, 0, 0))  # type: ignore[method-assign]
        self.translation = Translation(
            OmniBotSettings(delta_frame=board.frame, delta_period_s=board.delta_period_s)
        )
        self.odometry = Odometry(settings or OdometrySettings())
        self.loses = loses
        self.now = 0.0
        self.estimates: list[OdometryEstimate] = []
        self.attached = self.told = board_pose(self.board)
        self.drives = True
        random = Random(f"drive {seed}")
        self._phases = [random.uniform(0, math.tau) for _ in range(3)]
        self._speeds = [random.uniform(0.4, 1.6) for _ in range(3)]

    def run(self, seconds: float) -> list[OdometryEstimate]:
        """Drive for ``seconds`` and return the new estimates in order."""
        begun = len(self.estimates)
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            if self.board.tick % 5 == 0:
                self._command()
            mark = self.board.tick
            self.board.step()
            for sent in reversed(self._sent_since(mark)):
                self._hear(sent)
        return self.estimates[begun:]

    def _sent_since(self, tick: int) -> list[bytes]:
        found = []
        for sent in reversed(self.board.sent):
            if sent.tick <= tick:
                break
            found.append(sent.data)
        return found

    def _hear(self, data: bytes) -> None:
        if data[:2] == b"\xff\xfa" or self.loses(data, self.now):
            return
        (reading,) = self.translation.readings([decoded(data)], [0], self.now)
        if isinstance(reading, DisplacementReading):
            self.estimates += self.odometry.displace(reading, self.now)
            self.told = board_pose(self.board)
        elif isinstance(reading, PoseReading):
            self.estimates += self.odometry.settle(reading)
        else:
            assert isinstance(reading, PausedReading)

    def _command(self) -> None:
        """Command a smooth curve of up to 0.43 m/s along each axis and 0.45 rad/s."""
        sizes = (30, 30, 225)
        words = [
            round(self._commanding * size * math.sin(self.now * speed + phase)) & 0xFFFF
            for size, speed, phase in zip(sizes, self._speeds, self._phases, strict=True)
        ]
        self.board.receive(b"\xff\xfe\x01" + b"".join(word.to_bytes(2, "big") for word in words))

    @property
    def _commanding(self) -> bool:
        """Whether motion is commanded: only if the test wants to drive, and the board runs.

        Otherwise zeros are commanded: a paused board may take a byte of a motion command for a
        letter such as P.
        """
        return self.drives and self.board.mode is BoardMode.NOMINAL

    @property
    def error(self) -> Pose:
        """Error of the newest odom pose, compared with the true pose.

        The true pose is the board's own pose at the last delta that arrived.
        """
        wanted = self.attached.way_to(self.told)
        got = self.estimates[-1].pose
        off = got - wanted
        return Pose(off.x_m, off.y_m, math.remainder(off.yaw_rad, math.tau))


def decoded(data: bytes) -> Frame:
    frame = decode(data)
    assert isinstance(frame, DeltaFrame | PoseFrame | PausedFrame)
    return frame


def board_pose(board: SimulatedBoard) -> Pose:
    told = board.odometry
    return Pose(told.x_mm / 1000, told.y_mm / 1000, told.theta_mrad / 1000)
