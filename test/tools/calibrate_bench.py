# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A robot in simulated time for calibrations: a session and a board, without a ROS node."""

from collections.abc import Callable
from typing import Any

from session_bench import TICK_S, Bench

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.simulator.omnibot import BoardSettings
from omnibot_driver.tools.calibrate.log import Log
from omnibot_driver.tools.calibrate.motion import HALT, Bounds, Law, Topic

COMMANDED_EVERY = 2
"""Interval between two commands, in ticks of the board."""
STANDS_AFTER_S = 1.0


class BenchRobot:
    """A robot in simulated time that replaces the ``Robot`` of a calibration.

    ``bench.board``: the simulated board, with the true motion of the robot.
    """

    def __init__(self, **settings: Any) -> None:
        self.bench = Bench(BoardSettings(running=True, **settings))
        self.bench.open()
        self.bench.run_until_state("nominal")
        self.bench.run(1.0)
        self.parameters = {
            name: parameter.default for name, parameter in PARAMETERS.by_name.items()
        }

    def drive(
        self,
        law: Law,
        bounds: Bounds,
        *,
        topic: Topic = "cmd_vel",
        show: Callable[[float], object] = lambda _seconds: None,
    ) -> Log:
        assert topic == "cmd_vel"
        self.bench.events.clear()
        self.bench.run(0.04)
        first, began_s, command = self._pose(), self.bench.now, HALT
        wanted = law(0.0, Pose())
        while wanted is not None or command != HALT:
            target = HALT if wanted is None else wanted
            bounds.require_allowed(topic, target)
            command = bounds.approach(topic, command, target, COMMANDED_EVERY * TICK_S)
            self.bench.drive(*command)
            self.bench.run(COMMANDED_EVERY * TICK_S)
            now, seconds = self._pose(), self.bench.now - began_s
            way = first.way_to(now)
            pose = Pose(way.x_m, way.y_m, now.yaw_rad - first.yaw_rad)
            bounds.require_within(seconds, pose)
            wanted = law(seconds, pose) if wanted is not None else None
        self.bench.run(STANDS_AFTER_S)
        log = Log()
        for one in self.bench.odometry:
            pose = one.pose
            log.odometry_rows.append((one.stamp_s, pose.x_m, pose.y_m, pose.yaw_rad, 0.0, 0.0, 0.0))
        return log

    def _pose(self) -> Pose:
        """Return the latest pose of the odometry."""
        events = reversed(self.bench.events)
        return next(event.pose for event in events if isinstance(event, OdometryEstimate))
