# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot that a simulated LOIS ECU drives: two wheels on the ground, and the resulting motion.

This module knows duties and the positions of the encoder marks. It does not know the board.
"""

from dataclasses import dataclass
from math import cos, pi, sin
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
    """The robot. ``truth``: its true pose and motion.

    ``corrections``: the board's factors for each encoder's short and long level. The true lengths
    of the levels fit these factors exactly.
    """

    def __init__(
        self,
        settings: LoisSettings,
        corrections: tuple[tuple[float, float], ...],
        random: Random,
    ) -> None:
        self._settings, self._random = settings, random
        self.truth = TrueState(0.0, 0.0, 0.0, 0.0, 0.0)
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

    @property
    def standing(self) -> bool:
        """Whether both wheels are truly at rest."""
        return all(motor.rpm == 0.0 for motor in self.motors)

    def advance(self, duties: tuple[float, float], now_s: float, step_s: float) -> list[Edge]:
        """Advance by the step that ends at ``now_s``. Return the encoder edges in order of time."""
        settings, state = self._settings, self.truth
        ways: list[float] = []
        edges: list[Edge] = []
        for index, (motor, encoder) in enumerate(zip(self.motors, self.encoders, strict=True)):
            turns = motor.advance(duties[index], step_s)
            if turns and (edge := encoder.turn(turns)) is not None:
                part, is_long, direction = edge
                edges.append(Edge(now_s - step_s * (1 - part), index, is_long, direction))
            radius_m = settings.wheel_radius_m * settings.wheel_radius_scale[index]
            way_m = turns * 2 * pi * radius_m
            if settings.slip and way_m:
                way_m += self._random.gauss(0.0, settings.slip) * abs(way_m) ** 0.5
            ways.append(way_m)
        left_m, right_m = ways
        if left_m or right_m:
            self._roll(left_m, right_m, step_s)
        elif state.speed_mps or state.yaw_rate_radps:
            self.truth = TrueState(state.x_m, state.y_m, state.yaw_rad, 0.0, 0.0)
        return sorted(edges, key=lambda edge: (edge.at_s, edge.index))

    def _roll(self, left_m: float, right_m: float, step_s: float) -> None:
        settings, state = self._settings, self.truth
        way_m = (left_m + right_m) / 2
        turn_rad = (right_m - left_m) / (settings.track_m * settings.track_scale)
        middle_rad = state.yaw_rad + turn_rad / 2
        self.truth = TrueState(
            state.x_m + way_m * cos(middle_rad),
            state.y_m + way_m * sin(middle_rad),
            state.yaw_rad + turn_rad,
            way_m / step_s,
            turn_rad / step_s,
        )
