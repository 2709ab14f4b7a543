# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot on the ground: how it truly moves when the motors turn.

This module must not know the firmware.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, exp, sin, sqrt
from random import Random
from typing import NamedTuple

from omnibot_driver.simulator.omnibot.chassis import (
    PlanarPose,
    Wheels,
    body_from_rims,
    rims_from_body,
)
from omnibot_driver.simulator.omnibot.motors import TICK_S, Motor
from omnibot_driver.simulator.omnibot.settings import BoardSettings

_AS_NUMBERED = (1, 2, 3)

SLIP_CORRELATION_M = 0.1
"""Distance in m that a wheel's rim rolls until its slip no longer depends on its earlier slip."""


@dataclass(frozen=True, slots=True)
class TruePose:
    """The robot's true pose, and its twist along its own axes, in m, rad, m/s and rad/s.

    The yaw is unwrapped. The pose begins at zero.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    vx_mps: float
    vy_mps: float
    yaw_rate: float


class Held(NamedTuple):
    """How a person holds the robot: roll and pitch in rad (REP-103), and turn rate in rad/s."""

    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rate: float = 0.0


class Force(NamedTuple):
    """A force along the robot's x and y axes, and a torque that turns it left, in PWM steps.

    The force is distributed to the wheels like a velocity, and added to the motors' efforts.
    """

    x_pwm: float = 0.0
    y_pwm: float = 0.0
    turning_pwm: float = 0.0


class Twist(NamedTuple):
    """Velocity along the robot's x and y axes in m/s, and left turn rate in rad/s."""

    vx_mps: float = 0.0
    vy_mps: float = 0.0
    yaw_rate: float = 0.0


class World:
    """The robot's three motors and the ground under them."""

    def __init__(self, settings: BoardSettings) -> None:
        self._random = Random(f"slip {settings.seed}")
        self._motors = tuple(Motor(constants) for constants in settings.motors)
        self._wiring = settings.motor_wiring
        self._rim_m_per_count = [
            settings.rim_m_per_count * scale for scale in settings.wheel_radius_scale
        ]
        self._base_radius_m = settings.base_radius_m * settings.base_radius_scale
        self._mean_slip = settings.slip
        self._slip = [settings.slip] * 3
        self._pose = PlanarPose(0.0, 0.0, 0.0)
        self._twist = (0.0, 0.0, 0.0)
        self._slope_pwm = settings.slope_pwm
        self.held = Held()
        self.force = Force()
        """Current force on the robot, for example from a person or from a bump in the ground."""
        self.gripped: Twist | None = None
        """Twist that a person forces on the robot against its motors; None if the robot moves
        freely."""
        self.acceleration = (0.0, 0.0)
        """Acceleration of the body's origin over the last tick, along body x and y, in m/s²."""

    @property
    def truth(self) -> TruePose:
        """True pose and twist of the robot."""
        return TruePose(*self._pose, *self._twist)

    @property
    def yaw_rate(self) -> float:
        """True left turn rate of the robot, in rad/s."""
        return self._twist[2]

    @property
    def encoders(self) -> tuple[int, int, int]:
        """Encoder counts of wheels A, B, C since construction."""
        a, b, c = self._motors
        return a.encoder, b.encoder, c.encoder

    @property
    def rim_speeds_mps(self) -> Wheels:
        """Current rim speeds of wheels A, B, C, in m/s."""
        (a, b, c), (a_m, b_m, c_m) = self._motors, self._rim_m_per_count
        return a.speed / TICK_S * a_m, b.speed / TICK_S * b_m, c.speed / TICK_S * c_m

    def advance(self, pwm: Wheels) -> None:
        """Advance by one tick.

        ``pwm``: the efforts of the three controllers, in PWM steps.
        """
        rims_m = self._turn_wheels(self._wired(pwm))
        if self._mean_slip:
            self._slip = [self._wander(*now) for now in zip(self._slip, rims_m, strict=True)]
        self._pose = self._pose.moved(*body_from_rims(self._on_floor(rims_m), self._base_radius_m))

        old_vx, old_vy, _ = self._twist
        on_floor_mps = self._on_floor(self.rim_speeds_mps)
        self._twist = vx, vy, yaw_rate = body_from_rims(on_floor_mps, self._base_radius_m)
        self.acceleration = (
            (vx - old_vx) / TICK_S - yaw_rate * vy,
            (vy - old_vy) / TICK_S + yaw_rate * vx,
        )

    def _wired(self, pwm: Wheels) -> Sequence[float]:
        """Return the efforts at the motors of wheels A, B, C, after swaps in the wiring.

        ``pwm``: the efforts of the three controllers.
        """
        if self._wiring == _AS_NUMBERED:
            return pwm
        reached = [0.0] * 3
        for effort, motor in zip(pwm, self._wiring, strict=True):
            reached[abs(motor) - 1] += effort if motor > 0 else -effort
        return reached

    def _turn_wheels(self, efforts: Sequence[float]) -> list[float]:
        """Turn the wheels for one tick; return their rim motion, in m."""
        if self.gripped is not None:
            moved = rims_from_body(*self.gripped, self._base_radius_m)
            wheels = zip(self._motors, efforts, self._rim_m_per_count, moved, strict=True)
            for motor, effort, rim_m_per_count, rim_mps in wheels:
                motor.turn(rim_mps * TICK_S / rim_m_per_count, effort)
            return [rim_mps * TICK_S for rim_mps in moved]
        (a, b, c), (a_m, b_m, c_m) = self._motors, self._rim_m_per_count
        (a_pwm, b_pwm, c_pwm), (a_load, b_load, c_load) = efforts, self._loads()
        return [
            a.advance(a_pwm, a_load) * a_m,
            b.advance(b_pwm, b_load) * b_m,
            c.advance(c_pwm, c_load) * c_m,
        ]

    def _loads(self) -> Wheels:
        """Return the efforts that slope and push add at the rims of wheels A, B, C."""
        x, y, turning = self.force
        if self._slope_pwm:
            x += self._slope_pwm * cos(self._pose.yaw_rad)
            y -= self._slope_pwm * sin(self._pose.yaw_rad)
        return rims_from_body(x, y, turning, 1.0)

    def _on_floor(self, rims: Sequence[float]) -> Wheels:
        (a, b, c), (a_slip, b_slip, c_slip) = rims, self._slip
        return a * (1 - a_slip), b * (1 - b_slip), c * (1 - c_slip)

    def _wander(self, slip: float, rim_m: float) -> float:
        """Return the wheel's slip, from 0 to 1, after its rim has moved by ``rim_m``.

        ``slip``: the slip before this motion. The standard deviation of the slip is half its mean.
        """
        kept = exp(-abs(rim_m) / SLIP_CORRELATION_M)
        change = self._random.gauss(0.0, self._mean_slip / 2) * sqrt(1 - kept * kept)
        drifted = self._mean_slip + kept * (slip - self._mean_slip) + change
        return max(0.0, min(1.0, drifted))
