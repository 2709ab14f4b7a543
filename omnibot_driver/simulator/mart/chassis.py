# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motor board, its two motors, and the robot that they move.

Motor registers: 0 full forward, 128 stop, 255 full backward. This module does not know commands.
"""

from math import cos, exp, inf, pi, sin

from omnibot_driver.simulator.mart.settings import MartSettings, Stuck

STOP = 128
STEP_S = 0.01
RAMPS_PER_S = 40.0
"""Number of updates of the applied effort per second. Each update changes the effort by at most the
set acceleration."""
STANDS_MPS = 0.006
RIGHT_FAULTS, LEFT_FAULTS = 4 | 16, 8 | 32


class Chassis:
    """The motor board with its motors, its encoder and the body of the robot.

    * ``right``, ``left``: motor registers.
    * ``x_m``, ``y_m``, ``yaw_rad``: the true pose, yaw unwrapped.
    * ``counts``: encoder counts since the last reset.
    * ``way_m``: total distance, forward and backward.
    * ``silent``: whether the serial line to the motor board is cut.

    Set ``volts``, ``stuck``, ``motor_status`` and ``silent`` only through ``change``.
    """

    def __init__(self, settings: MartSettings) -> None:
        self._settings = settings
        self._alpha = 1.0 - exp(-STEP_S / settings.motor_lag_s)
        self._per_count = settings.encoder_sign / settings.metres_per_count
        self._track_m = settings.track_m
        self._dead_units = settings.dead_zone_units
        self._noise = (settings.seed * 2_654_435_761 + 12_345) & 0x7FFFFFFF
        self.x_m = self.y_m = self.yaw_rad = self.way_m = 0.0
        self.motor_status = settings.motor_status
        self.silent = settings.motor_board_silent
        self.stuck: Stuck = settings.stuck
        self.volts = settings.volts
        self.power_cycle()

    def power_cycle(self) -> None:
        """Switch the motor board off and on. The wheels stop."""
        self.right = self.left = STOP
        self._applied_right = self._applied_left = 0.0
        self.right_mps = self.left_mps = 0.0
        self.counts = 0.0
        self.acceleration = 5
        self._settle()

    def change(
        self,
        *,
        volts: float | None = None,
        stuck: Stuck | None = None,
        motor_status: int | None = None,
        silent: bool | None = None,
    ) -> None:
        """Change the given properties of the motor board.

        A property that is None stays as it is.
        """
        self.volts = self.volts if volts is None else volts
        self.stuck = self.stuck if stuck is None else stuck
        self.motor_status = self.motor_status if motor_status is None else motor_status
        self.silent = self.silent if silent is None else silent
        self._settle()

    def _settle(self) -> None:
        settings = self._settings
        speed = settings.speed_mps_per_unit * self.volts / settings.nominal_volts
        half = settings.motor_inequality / 2
        stopped_right = self.stuck in ("right", "both") or self.motor_status & RIGHT_FAULTS
        stopped_left = self.stuck in ("left", "both") or self.motor_status & LEFT_FAULTS
        self._gain_right = 0.0 if stopped_right else speed * (1 - half)
        self._gain_left = 0.0 if stopped_left else speed * (1 + half)

    def copy(self) -> "Chassis":
        """Return an independent copy."""
        new = Chassis.__new__(Chassis)
        new.__dict__.update(self.__dict__)
        return new

    def set(self, right: int, left: int) -> None:
        """Write both motor registers.

        This has no effect if the serial line to the motor board is cut.
        """
        if not self.silent:
            self.right, self.left = right & 0xFF, left & 0xFF

    def accelerate(self, units: int) -> None:
        """Set the acceleration, in register units per 25 ms."""
        if not self.silent:
            self.acceleration = units

    def reset_encoders(self) -> None:
        """Set the encoders to zero."""
        if not self.silent:
            self.counts = 0.0

    @property
    def encoder(self) -> int:
        """Encoder count that the motor board reports; 0 if the serial line to it is cut."""
        return 0 if self.silent else int(self.counts)

    @property
    def speed_mps(self) -> float:
        """Speed of the body in m/s, forward positive."""
        return (self.right_mps + self.left_mps) / 2

    @property
    def powered(self) -> bool:
        """Whether at least one motor is commanded to turn."""
        return self.right != STOP or self.left != STOP

    @property
    def moving(self) -> bool:
        """Whether a wheel turns."""
        return self.right_mps != 0.0 or self.left_mps != 0.0

    @property
    def rests(self) -> bool:
        """Whether the robot stays at rest: commands, applied efforts and wheel speeds are zero."""
        return not (self.powered or self.moving or self._applied_right or self._applied_left)

    @property
    def error_bits(self) -> int:
        """Status bits of the motor board, as the reply to MCSTAT contains them."""
        return self.motor_status | (64 if self.volts > 30 else 0) | (128 if self.volts < 16 else 0)

    def _turn(
        self, wanted: int, applied: float, speed_mps: float, gain: float
    ) -> tuple[float, float]:
        """Advance one motor by 10 ms; return its applied effort and its speed in m/s."""
        if applied != wanted:
            slew = self.acceleration * RAMPS_PER_S * STEP_S
            if applied < wanted:
                applied = min(applied + slew, wanted)
            else:
                applied = max(applied - slew, wanted)
        dead = self._dead_units
        beyond = applied - dead if applied > dead else min(0.0, applied + dead)
        aim_mps = beyond * gain
        speed_mps += (aim_mps - speed_mps) * self._alpha
        if not aim_mps and -STANDS_MPS < speed_mps < STANDS_MPS:
            speed_mps = 0.0
        return applied, speed_mps

    def step(self) -> float:
        """Advance by 10 ms. Return the robot's turn rate in deg/s, with noise if a wheel turns."""
        self._applied_right, right = self._turn(
            STOP - self.right, self._applied_right, self.right_mps, self._gain_right
        )
        self._applied_left, left = self._turn(
            STOP - self.left, self._applied_left, self.left_mps, self._gain_left
        )
        self.right_mps, self.left_mps = right, left
        if right == 0.0 == left:
            return 0.0
        self.counts += right * STEP_S * self._per_count
        rate = (right - left) / self._track_m
        way = (right + left) / 2 * STEP_S
        middle = self.yaw_rad + rate * STEP_S / 2
        self.x_m += way * cos(middle)
        self.y_m += way * sin(middle)
        self.yaw_rad += rate * STEP_S
        self.way_m += abs(way)
        self._noise = noise = (self._noise * 1_103_515_245 + 12_345) & 0x7FFFFFFF
        shaking = (noise / 0x40000000 - 1.0) * 1.7 * self._settings.gyro_noise_dps
        return rate * (180 / pi) + shaking


def sight_m(chassis: Chassis, front_m: float, rear_m: float, *, backward: bool) -> float:
    """Return the distance in m from a sonar to the wall in its direction; infinity without a wall.

    ``backward``: whether it is the rear sonar. The walls cross the x axis at ``front_m`` and
    ``-rear_m``.
    """
    along = cos(chassis.yaw_rad + (pi if backward else 0.0))
    if along > 0.3:
        return (front_m - chassis.x_m) / along
    if along < -0.3:
        return (chassis.x_m + rear_m) / -along
    return inf
