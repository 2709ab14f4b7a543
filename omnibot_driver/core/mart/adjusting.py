# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How the driver corrects the motors' units during a drive, and what it learns from the result.

This module knows the current motion and its measured speed; it does not know how motions begin or
end.
"""

import math
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.moves import Moves
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.mart.stop_reasons import CREEP_MPS
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import DisplacementReading

WAG_S, WAG_UNITS = 0.2, 2
"""A small turn that tests the IMU in a drive in which the reported heading is constant.

``WAG_S``: time in s of constant heading before this turn.

``WAG_UNITS``: motor units added to the left motor, and subtracted from the right one.
"""

SUPERVISED_S: Final = 1.0
"""Longest time in s in a backward drive (B) without an answer to a change of the motors' units.
After this time, the driver sends ``CS 0 0`` to find out whether the server still supervises the
motors: a restarted server lets the motors run on."""
STARTED_M: Final = 0.01
"""Distance in m after which it is certain that the current units are enough to turn the motors."""


class Adjusting(Moves):
    """The part of ``Pilot`` that adjusts the current motion to the user's command."""

    @property
    def motor_balance(self) -> str:
        """The measured speed of the left motor divided by that of the right motor, as text."""
        ratio = self.loop.measured_balance
        return "unknown" if ratio is None else f"{ratio:.3f}"

    def _adjust(self, now: float) -> Packets:
        odometry = self.odometry
        if self.state is State.DRIVING and not odometry.heading.is_known:
            if abs(odometry.speeds.means[0]) > CREEP_MPS:
                odometry.heading.started()
            return NO_PACKETS
        self._fresh = False
        _, twist = self._wish(now)
        change = self.loop.change(abs(twist.vx_mps), twist.yaw_rate_radps, now)
        self.commanded = twist
        if change is None and self._heading_is_told and self._frozen_s > WAG_S:
            change = (-WAG_UNITS, WAG_UNITS)  # the next change undoes this small turn
        self._probes = change is None
        if change is None:
            obeyed_s = max(self._begun_s, self._obeyed_s)
            if self.state is State.REVERSING and now >= obeyed_s + SUPERVISED_S:
                self._require(words.CS)
                return self._ask(words.CS.request(0, 0), now)
            return NO_PACKETS
        right, left = change
        self._require(words.RMCS if self.state is State.DRIVING else words.CS)
        self.loop.changed(right, left, now)
        if self.state is State.DRIVING:
            return self._ask(words.RMCS.request(right, left), now)
        self._predict_turn()
        self.odometry.guess_changed(self.loop.part, self._late_s)
        return self._ask(words.CS.request(-right, -left), now)

    def _learn(self, moved: DisplacementReading, now: float) -> None:
        self.loop.trip_s = self.conversation.trip_s
        if moved.duration_s is not None:
            blind = self.odometry.left_over_right is not None
            self._turns.keep_lessons()
            self.loop.measured(moved.dx_m, moved.dyaw_rad, moved.duration_s, now, right_only=blind)
        self._predict_turn()

    def _predict_turn(self) -> None:
        """Set the ratio of wheel speeds (left / right) from which the robot's turn is computed.

        The ratio is None except in a turn on the spot, and in a backward drive (B) in which the
        server reports no headings.
        """
        told = self.motion is Motion.REFERENCE or self.motion in self.health.heading_told
        if self.motion is Motion.REVERSE and not told:
            self.odometry.left_over_right = self.loop.left_over_right
            self.odometry.bend = self.loop.bend
        elif self.motion is Motion.TURN:
            self.odometry.left_over_right = -(self._records.balance or self.loop.balance)
        elif self.motion is Motion.SPIN:
            self.odometry.left_over_right = -self.loop.balance
        else:
            self.odometry.left_over_right = None

    def _doubt_the_left_wheel(self, seconds: float) -> None:
        """Add uncertainty to the odometry, because the left wheel may have turned for ``seconds``.

        The left wheel has no encoder, and the right wheel may be stuck.
        """
        units = self._turns.units if self.motion is Motion.SPIN else self.loop.units
        most_m = units * self.loop.per_unit_mps * seconds
        turn_rad = min(math.pi, most_m / self._settings.track_m)
        self.odometry.doubt.add((most_m / 2) ** 2, turn_rad**2)

    def _learn_standing(self) -> None:
        """Record that the present motor units are too small to turn the motors.

        Do nothing if the robot has already moved in this motion: then an obstacle blocks the robot.
        """
        odometry = self.odometry
        moved_m = abs(odometry.moved_m) + abs(odometry.turn.spun_rad) * self._settings.track_m / 2
        if moved_m < STARTED_M:
            self.loop.stood(self._turns.units if self.motion is Motion.SPIN else None)
