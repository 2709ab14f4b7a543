# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot that a simulated LOIS ECU drives: two wheels on the ground, and the resulting motion.

This module does not know the board.
"""

from dataclasses import dataclass
from math import cos, sin, tau
from random import Random

from omnibot_driver.simulator.lois_ecu.motors import Encoder, Motor
from omnibot_driver.simulator.lois_ecu.settings import LoisSettings


@dataclass(frozen=True, slots=True)
class TrueState:
    """True pose and motion of the robot, in m, rad, m/s and rad/s. The yaw is not wrapped."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge that the encoder of a wheel gives at ``at_s``.

    index: 0 left, 1 right.
    is_long: whether a long level ended.
    direction: 1 forward, -1 backward.
    """

    at_s: float
    index: int
    is_long: bool
    direction: int


class Vehicle:
    """The robot.

    ``corrections``: for each encoder, the factors by which the board multiplies the durations of
    the signal's short and long levels. The simulation chooses the lengths of the levels so that
    these factors are exact.
    """

    def __init__(
        self,
        settings: LoisSettings,
        corrections: tuple[tuple[float, float], ...],
        random: Random,
    ) -> None:
        self._settings, self._random = settings, random
        self._x_m = self._y_m = self._yaw_rad = 0.0
        self._speed_mps = self._yaw_rate_radps = 0.0
        self.motors = tuple(
            Motor(motor, settings.load_percent, random) for motor in settings.motors
        )
        self.encoders = tuple(
            Encoder(
                settings.steps,
                long / (short + long),
                noise=settings.mark_noise,
                random=Random(f"marks {settings.seed} {long}"),
            )
            for short, long in corrections
        )
        self._wheels = tuple(
            (index, motor, encoder, settings.wheel_radius_m * scale)
            for index, (motor, encoder, scale) in enumerate(
                zip(self.motors, self.encoders, settings.wheel_radius_scale, strict=True)
            )
        )
        self._track_m = settings.track_m * settings.track_scale

    @property
    def truth(self) -> TrueState:
        """True pose and motion of the robot."""
        return TrueState(self._x_m, self._y_m, self._yaw_rad, self._speed_mps, self._yaw_rate_radps)

    @property
    def standing(self) -> bool:
        """Whether both wheels are truly at rest."""
        return all(motor.rpm == 0.0 for motor in self.motors)

    def advance(self, duties: tuple[float, float], now_s: float, step_s: float) -> list[Edge]:
        """Simulate the step that ends at ``now_s``. Return the encoder edges in order of time."""
        slip = self._settings.slip
        ways: list[float] = []
        edges: list[Edge] = []
        for index, motor, encoder, radius_m in self._wheels:
            turns = motor.advance(duties[index], step_s)
            way_m = turns * tau * radius_m
            for part, is_long, direction in encoder.turn(turns) if turns else ():
                edges.append(Edge(now_s - step_s * (1 - part), index, is_long, direction))
            if slip and way_m:
                way_m += self._random.gauss(0.0, slip) * abs(way_m) ** 0.5
            ways.append(way_m)
        left_m, right_m = ways
        if left_m or right_m:
            self._roll(left_m, right_m, step_s)
        else:
            self._speed_mps = self._yaw_rate_radps = 0.0
        if len(edges) > 1:
            edges.sort(key=lambda edge: (edge.at_s, edge.index))
        return edges

    def _roll(self, left_m: float, right_m: float, step_s: float) -> None:
        way_m = (left_m + right_m) / 2
        turn_rad = (right_m - left_m) / self._track_m
        middle_rad = self._yaw_rad + turn_rad / 2
        self._x_m += way_m * cos(middle_rad)
        self._y_m += way_m * sin(middle_rad)
        self._yaw_rad += turn_rad
        self._speed_mps = way_m / step_s
        self._yaw_rate_radps = turn_rad / step_s
