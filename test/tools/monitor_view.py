# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A fake robot for tests of the monitor, without ROS."""

from typing import Any

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.reporting.status import Level, Status
from omnibot_driver.tools.monitor.model import Flow, View
from omnibot_driver.tools.monitor.teleop import DeadMan

FINE = (
    Status("Link", Level.OK, "connected", {"Port": "/dev/omnibot", "Reconnects": "0"}),
    Status("Stream", Level.OK, "complete", {"Framing faults": "0", "Sequence gaps": "0"}),
)


def view(**changes: Any) -> View:
    """Return the view of a healthy driver, with these fields changed."""
    values = {
        "driver": "/robot1/omnibot_driver",
        "state": "nominal",
        "estop": False,
        "estop_asked": False,
        "releasable": True,
        "silent_s": 0.01,
        "imu": Flow(100.0, 0.01, (99, 100, 101)),
        "odom": Flow(25.0, 0.02, (25, 25, 25)),
        "pose": Pose(1.5, -0.25, 0.5),
        "measured": BodyTwist(0.2, 0.0, -0.1),
        "commanded": BodyTwist(0.25, 0.0, -0.125),
        "force_mps2": (0.0, 0.1, 9.8),
        "rate_radps": (0.0, 0.0, 0.01),
        "statuses": FINE,
        "path": ((0.0, 0.0), (1.5, -0.25)),
        "steers": True,
        "said": "",
    }
    return View(**{**values, **changes})


class FakeRobot:
    """A fake robot. It shows the view ``shown``, and keeps the requests to it in ``asked``."""

    def __init__(self, *, teleop: bool = False) -> None:
        self.dead_man = DeadMan() if teleop else None
        self.shown = view()
        self.asked: list[str] = []

    def view(self) -> View:
        return self.shown

    def estop(self) -> None:
        self.asked.append("estop")

    def release(self) -> None:
        self.asked.append("release")

    def start(self) -> None:
        self.asked.append("start")

    def pause(self) -> None:
        self.asked.append("pause")

    def reset_odometry(self) -> None:
        self.asked.append("reset_odometry")
