# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The robot that the two Teensys move: driving wheels, servo of the steered wheel, lift, brush.

This module must not know the Teensys or their lines.
"""

from dataclasses import dataclass
from math import copysign, cos, pi, sin
from random import Random

from omnibot_driver.simulator.fejemis.settings import WHEEL_BASE_M, FejemisSettings

MECHANICAL_STOP_DEG = 100.0
SERVO_FULL = 1000.0
SERVO_PERIOD_S = 0.025
LIFT_SECONDS_AT_6_V = 12.0
STANDS_MPS = 1e-4


@dataclass(frozen=True, slots=True)
class TrueState:
    """True pose and motion of the robot in m, rad, m/s and rad/s. The yaw counts full turns."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    yaw_rate_radps: float


class Servo:
    """The servo that turns the steered wheel. It takes a new command every 25 ms.

    * ``command``: wanted speed, -1000 to 1000, reached with a lag.
    * ``angle_deg``: angle of the wheel, positive to the left.
    """

    def __init__(self, settings: FejemisSettings) -> None:
        self.command = 0.0
        self.angle_deg = 0.0
        self._taken = self._degps = 0.0
        self._since_s = 0.0
        self._per_unit = settings.servo_degps / SERVO_FULL
        self._lag_s = settings.servo_lag_s

    def advance(self, step_s: float) -> None:
        """Advance by ``step_s`` seconds."""
        self._since_s += step_s
        if self._since_s >= SERVO_PERIOD_S - 1e-9:
            self._since_s = 0.0
            self._taken = max(-SERVO_FULL, min(SERVO_FULL, self.command))
        wanted = self._taken * self._per_unit
        if wanted == 0.0 and abs(self._degps) < 1e-6:
            self._degps = 0.0
            return
        self._degps += (wanted - self._degps) * step_s / (self._lag_s + step_s)
        angle = self.angle_deg + self._degps * step_s
        self.angle_deg = max(-MECHANICAL_STOP_DEG, min(MECHANICAL_STOP_DEG, angle))


class Lift:
    """The lift, a linear actuator; ``height`` is 0 at its lower end and 1 at its upper end."""

    def __init__(self) -> None:
        self.volts = 0.0
        self.height = 0.0

    def advance(self, step_s: float) -> None:
        """Advance by ``step_s`` seconds."""
        if self.volts:
            moved = self.height + self.volts / 6.0 * step_s / LIFT_SECONDS_AT_6_V
            self.height = max(0.0, min(1.0, moved))


class Vehicle:
    """The robot with its true state. Pairs are for the left and the right wheel.

    * ``turns``: revolutions since construction.
    * ``wanted_radps``: set-points of the speed controllers.
    * ``powered``: whether the controllers drive the wheels, which otherwise coast to a stop.
    * ``held``: whether the wheels are blocked by hand.
    """

    def __init__(self, settings: FejemisSettings) -> None:
        self._settings = settings
        self._random = Random(f"fejemis slip {settings.seed}")
        self.truth = TrueState(0.0, 0.0, 0.0, 0.0, 0.0)
        self.servo = Servo(settings)
        self.lift = Lift()
        self.brush = False
        self.wanted_radps = (0.0, 0.0)
        self.powered = True
        self.held = (False, False)
        self.radps = [0.0, 0.0]
        self.turns = [0.0, 0.0]
        self.accel_mps2 = (0.0, 0.0)
        """Acceleration of the body in m/s², forward and to the left."""
        self._radii_m = tuple(
            settings.wheel_radius_m * scale for scale in settings.wheel_radius_scale
        )
        self._track_m = WHEEL_BASE_M * settings.track_scale

    @property
    def standing(self) -> bool:
        """Whether both driving wheels are truly at rest."""
        return self.radps == [0.0, 0.0]

    def advance(self, step_s: float) -> None:
        """Advance by ``step_s`` seconds."""
        self.servo.advance(step_s)
        self.lift.advance(step_s)
        if self.standing and (self.wanted_radps == (0.0, 0.0) or not self.powered):
            if self.truth.speed_mps or self.truth.yaw_rate_radps or any(self.accel_mps2):
                state = self.truth
                self.truth = TrueState(state.x_m, state.y_m, state.yaw_rad, 0.0, 0.0)
                self.accel_mps2 = (0.0, 0.0)
            return
        self._roll(step_s)

    def _roll(self, step_s: float) -> None:
        settings, state = self._settings, self.truth
        ways = []
        for index in (0, 1):
            wanted = self.wanted_radps[index] if self.powered else 0.0
            rate = self.radps[index]
            rate += (wanted - rate) * step_s / (settings.motor_lag_s + step_s)
            if self.held[index] or (
                wanted == 0.0 and abs(rate) * self._radii_m[index] < STANDS_MPS
            ):
                rate = 0.0
            self.radps[index] = rate
            self.turns[index] += rate * step_s / (2 * pi)
            way_m = rate * step_s * self._radii_m[index]
            if settings.slip and way_m:
                way_m += self._random.gauss(0.0, settings.slip) * abs(way_m) ** 0.5
            ways.append(way_m)
        way_m = sum(ways) / 2
        turn_rad = (ways[1] - ways[0]) / self._track_m
        middle_rad = state.yaw_rad + turn_rad / 2
        speed_mps, yaw_rate_radps = way_m / step_s, turn_rad / step_s
        self.accel_mps2 = ((speed_mps - state.speed_mps) / step_s, speed_mps * yaw_rate_radps)
        self.truth = TrueState(
            state.x_m + way_m * cos(middle_rad),
            state.y_m + way_m * sin(middle_rad),
            state.yaw_rad + turn_rad,
            speed_mps,
            yaw_rate_radps,
        )


def wheel_speeds(
    speed: float, turn_radps: float, angle_deg: float, base_m: float, steer_m: float
) -> tuple[float, float]:
    """Return the speeds of the left and the right wheel in m/s, with the equations of the manual.

    ``angle_deg``: angle of the front wheel. ``base_m``, ``steer_m``: the manual's B and f.
    """
    if speed == 0.0 and turn_radps == 0.0:
        return 0.0, 0.0
    # The manual adds the squares of m/s and rad/s, although these units differ.
    outer = copysign((speed**2 + turn_radps**2) ** 0.5, speed if speed else 1.0)
    theta = abs(angle_deg) * pi / 180.0
    if theta < 1e-6:
        return outer, outer
    radius_m = steer_m * cos(theta) / sin(theta) + base_m / 2
    inner = outer - outer * base_m / max(radius_m, base_m / 4)
    return (inner, outer) if angle_deg > 0.0 else (outer, inner)
