# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A drive board whose messages go directly to the odometry, for the tests of the odometry."""

from omnibot_driver.core.fejemis.messages import BoardPose, WheelSpeeds
from omnibot_driver.core.fejemis.odometry import PoseOdometry
from omnibot_driver.core.geometry.se2 import Pose, roll
from omnibot_driver.core.readings import DisplacementReading

PERIOD_S = 0.02
TRACK_M = 0.4


def told(place: Pose, time_s: float) -> BoardPose:
    """Return the message with the drive board's pose, rounded as the board prints it."""
    return BoardPose(
        round(time_s, 5), round(place.x_m, 3), round(place.y_m, 3), round(place.yaw_rad, 4), 3
    )


class Drive:
    """A simulated drive board whose pose and speed messages go to the odometry every 20 ms."""

    def __init__(self, *, with_speeds: bool = True) -> None:
        self.odometry = PoseOdometry(TRACK_M)
        self.board, self.out, self.now = Pose(), Pose(), 10.0
        self.readings: list[DisplacementReading] = []
        self.with_speeds = with_speeds

    def say(self, pose: BoardPose) -> DisplacementReading | None:
        reading = self.odometry.pose(pose)
        if reading is not None:
            self.readings.append(reading)
            self.out = self.out.moved(roll(Pose(reading.dx_m, reading.dy_m, reading.dyaw_rad)))
        return reading

    def step(self, v: float, w: float, *, heard: bool = True) -> None:
        self.now += PERIOD_S
        self.board = self.board.moved(roll(Pose(v * PERIOD_S, 0.0, w * PERIOD_S)))
        if not heard:
            return
        if self.with_speeds:
            half = w * TRACK_M / 2
            self.odometry.speeds(WheelSpeeds(round(v - half, 3), round(v + half, 3)))
        self.say(told(self.board, self.now))

    def run(self, v: float, w: float, seconds: float, *, heard: bool = True) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.step(v, w, heard=heard)
