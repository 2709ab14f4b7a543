# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A minimal simulation of a board's reports, without any code of the driver.

While the robot moves, the reported motion is the commanded one, even if the line damages the
command.
"""

import math
from typing import NamedTuple

from omnibot_driver.simulator.omnibot.wire import (
    Triple,
    delta_frame,
    imu_frame,
    paused_text,
    pose_frame,
)

TICK_S = 0.01
ANGULAR_SCALE = 500.0
BASE_RADIUS_M = 0.143
GYRO_LSB_PER_DPS = 131.0
GOAL_MPS = 0.2
"""Speed on the way to a goal, in m/s."""
ACCEL_Z = -16384
"""Gravity in LSB, as the upside-down sensor measures it."""


class Shown(NamedTuple):
    """The part of the board's state that the driver can detect in the board's frames and texts."""

    mode: str
    """The mode: booting, paused or running."""
    moves: bool


class Teller:
    """A minimal board.

    ``linear_scale``: the units (LSB) of a command that mean 1 m/s.

    ``goals``: whether the board drives to goals, as under position control.
    """

    def __init__(self, linear_scale: float, *, goals: bool = False) -> None:
        self._linear_scale, self._goals = linear_scale, goals
        self._twist = (0.0, 0.0, 0.0)
        self._mode = ""
        self._reboot()

    def moves_as(self, mode: int, words: Triple) -> None:
        """Store the twist that this motion frame commands.

        The robot has this twist while it moves.
        """
        a, b, c = words
        if self._goals:
            way = math.atan2(1e-3 * b - self._y, 1e-3 * a - self._x) - self._yaw
            self._twist = (GOAL_MPS * math.cos(way), GOAL_MPS * math.sin(way), 0.0)
        elif mode == 0x01:
            scale = self._linear_scale
            self._twist = (a / scale, b / scale, c / ANGULAR_SCALE)
        else:  # the manual's conversion from rim speeds
            va, vb, vc = (word / self._linear_scale for word in words)
            self._twist = (
                (vb - va) / (2 * math.cos(math.radians(30))),
                (2 * vc - va - vb) / 3,
                -(va + vb + vc) / (3 * BASE_RADIUS_M),
            )

    def step(self, shown: Shown) -> bytes:
        """Advance by one tick, and return the bytes that the board sends.

        ``shown``: the board's state in this tick.
        """
        if shown.mode != self._mode:
            if self._mode == "booting":
                self._reboot()
            self._mode, self._texts, self._to_text = shown.mode, 0, 0
        if shown.mode == "booting":
            return b""
        self._ticks += 1
        if shown.mode == "paused":
            self._to_text -= 1
            if self._to_text >= 0:
                return b""
            self._to_text = 99
            self._texts += 1
            return paused_text((self._texts - 1) % 256)
        vx, vy, yaw_rate = self._twist if shown.moves else (0.0, 0.0, 0.0)
        half = self._yaw + yaw_rate * TICK_S / 2
        self._x += (math.cos(half) * vx - math.sin(half) * vy) * TICK_S
        self._y += (math.sin(half) * vx + math.cos(half) * vy) * TICK_S
        self._yaw += yaw_rate * TICK_S
        gyro_z = round(-math.degrees(yaw_rate) * GYRO_LSB_PER_DPS)
        sent = imu_frame((20, 30, ACCEL_Z), (9, -12, max(-32768, min(32767, gyro_z - 3))))
        if self._ticks % 4 == 0:
            sent += self._delta()
        if self._ticks % 20 == 0:
            sent += pose_frame(1e3 * self._x, 1e3 * self._y, 1e3 * self._yaw, self._poses % 256)
            self._poses += 1
        return sent

    def _reboot(self) -> None:
        self._x = self._y = self._yaw = 0.0
        self._told = (0, 0, 0)
        self._ticks = self._deltas = self._poses = self._texts = self._to_text = 0

    def _delta(self) -> bytes:
        here = (round(1e4 * self._x), round(1e4 * self._y), round(1e4 * self._yaw))
        dx, dy, dyaw = (now - then for now, then in zip(here, self._told, strict=True))
        self._told = here
        self._deltas += 1
        return delta_frame((dx, dy, dyaw), (self._deltas - 1) % 256)
