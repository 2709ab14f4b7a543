# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated user with a tape measure, for ``calibrate geometry``."""

import math
from collections.abc import Callable

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.simulator.omnibot import SimulatedBoard


class Surveyor:
    """A user who measures the true pose in whole millimetres and half degrees."""

    def __init__(self, board: Callable[[], SimulatedBoard]) -> None:
        self._board = board
        self._mark = Pose()
        self._turns = 0.0

    def __call__(self, question: str) -> str:
        truth = self._board().truth
        here = Pose(truth.x_m, truth.y_m, truth.yaw_rad)
        if "Mark the floor" in question:
            self._mark = here
            sign = 1 if "left" in question else -1
            self._turns = (
                sign * float(question.split(": ")[1].split()[0]) if "turn" in question else 0
            )
        way = self._mark.way_to(here)
        if "degrees" in question:
            turned = math.degrees(here.yaw_rad - self._mark.yaw_rad) - 360 * self._turns
            return str(round(2 * turned) / 2)
        if "forward of" in question:
            return str(round(1000 * way.x_m))
        if "left of" in question:
            return str(round(1000 * way.y_m))
        return "y"
