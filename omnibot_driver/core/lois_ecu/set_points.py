# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Set-points for a LOIS ECU: how motions are encoded, and what was sent last.

``outbound`` explains the choice of set-points. This module works on commands, times and written
bytes.
"""

import math
from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.messages import SetDuty, SetRpm, Stream
from omnibot_driver.core.lois_ecu.settings import BOOT_PERIOD_MS, LoisEcuSettings

CLEAR_AFTER_S: Final = 2.0
"""Shortest time in s from a Stop until RPM 0/0 is sent. RPM 0/0 clears the firmware's measured
speed, but ends the counting of ticks. So the ticks must show the standstill first."""
CLEAR_AFTER_TICKS: Final = 6
"""Shortest time from a Stop until RPM 0/0 is sent, in periods of the tick reports. RPM 0/0 clears
the firmware's measured speed, but ends the counting of ticks. So the ticks must show the standstill
first."""
CLEAR_AGAIN_S: Final = 0.15


class SetPoints:
    """Encoder of set-points. It also remembers which set-points were sent.

    * ``saturated``: number of commands that were slowed, because a value was above its limit.
    * ``stopped_at_s``: time of the first zero set-point after the last motion command; infinity if
      none was sent. Each RPM 0/0 (``clears``) moves this time forward.
    * ``stood``: whether the robot was seen at rest since ``stopped_at_s``.
    * ``moved_at_s``: time of the last motion command.
    * ``said_at_s``: time of the last set-point, also of a zero one.
    """

    def __init__(self, settings: LoisEcuSettings) -> None:
        self.settings = settings
        self.saturated = 0
        self.connect()

    def connect(self) -> None:
        """Begin a new connection, and forget the set-points that were sent."""
        self._said: SetRpm | SetDuty | None = None
        self.stopped_at_s = math.inf
        self.moved_at_s = self.said_at_s = -math.inf
        self.stood = False
        self._clears_left = outbound.CLEARED_TIMES

    @property
    def driving(self) -> bool:
        """Whether the last set-point moves the robot."""
        return self._said is not None and _moves(self._said)

    def wrote(self, data: bytes, now: float) -> list[SetRpm | SetDuty]:
        """Record that ``data`` was sent to the board. Return the set-points in it."""
        said = outbound.set_points(data, with_sum=self.settings.with_sum)
        for command in said:
            self.said_at_s = now
            if _moves(command):
                self.stopped_at_s, self.stood = math.inf, False
                self.moved_at_s = now
                if isinstance(command, SetDuty):
                    self._clears_left = outbound.CLEARED_TIMES
            else:
                if self.stopped_at_s == math.inf:
                    self.stopped_at_s = now
                if isinstance(command, SetRpm):
                    self._clears_left = max(self._clears_left - 1, 0)
                elif self.driving:
                    self._clears_left = outbound.CLEARED_TIMES
            self._said = command
        return said

    # RPM 0/0, which makes the firmware forget the speed of a wheel at rest

    def clear_again(self) -> None:
        """Plan RPM 0/0 before the next set-points: the firmware then forgets its measured speed."""
        self._clears_left = outbound.CLEARED_TIMES

    @property
    def cleared(self) -> bool:
        """Whether RPM 0/0 was sent as many times as necessary since the last motion."""
        return not self._clears_left

    @property
    def clears_at(self) -> float:
        """Time in s at which to send RPM 0/0 after a Stop; infinity if RPM 0/0 is not needed."""
        return self.stopped_at_s + self._clear_after_s if self._clears_left else math.inf

    @property
    def _clear_after_s(self) -> float:
        ticks_ms = self.settings.periods_ms.get(Stream.TICKS, BOOT_PERIOD_MS)
        return max(CLEAR_AFTER_S, CLEAR_AFTER_TICKS * ticks_ms / 1000)

    def clears(self, now: float) -> bool:
        """Return whether to send RPM 0/0 now, after a Stop. If so, also plan its repetition."""
        if now < self.clears_at:
            return False
        self.stopped_at_s = now - self._clear_after_s + CLEAR_AGAIN_S
        return True

    # Motions

    def wheels(self, rates_radps: Sequence[float]) -> list[SetRpm | SetDuty]:
        """Return the set-points that command the rates of the left and right wheel, in rad/s.

        If both rates round to zero, return Stop.
        """
        settings = self.settings
        left, right = rates_radps
        if settings.drive_mode == "duty":
            percent = settings.wheel_radius_m * settings.duty_scale
            return [self._duty(left * percent, right * percent)]
        rpm = 60 / math.tau
        pair, was_saturated = outbound.saturated((left * rpm, right * rpm), outbound.MOST_RPM)
        self.saturated += was_saturated
        if not any(pair):
            return [outbound.STOP]
        command = SetRpm(*self._board_order(pair))
        return [outbound.EMERGENCY_STOP, command] if self._clears_left else [command]

    def _duty(self, left: float, right: float) -> SetDuty:
        most = min(self.settings.max_duty, outbound.MOST_PERCENT)
        pair, was_saturated = outbound.saturated((left, right), most)
        self.saturated += was_saturated
        return SetDuty(*self._board_order(pair))

    def meaning(self, data: bytes) -> BodyTwist:
        """Return the body velocity that is commanded by the last set-point in ``data``."""
        settings = self.settings
        found = outbound.set_points(data, with_sum=settings.with_sum)
        if not found:
            return BodyTwist(0.0, 0.0, 0.0)
        match found[-1]:
            case SetRpm(left, right):
                unit = math.tau / 60
            case SetDuty(left, right):
                unit = 1 / (settings.duty_scale * settings.wheel_radius_m)
        left, right = self._board_order((left, right))
        return self.kinematics.body_twist((left * unit, right * unit))

    @property
    def kinematics(self) -> DifferentialKinematics:
        """Kinematics of the robot. Left and right mean the left and right side of the robot.

        If the board is inverted, the board's left side is the robot's right side.
        """
        settings = self.settings
        return DifferentialKinematics(
            wheel_radius_m=settings.wheel_radius_m, track_m=settings.track_m
        )

    def _board_order(self, pair: tuple[int, int]) -> tuple[int, int]:
        """Swap the two values if the board is inverted.

        The swap converts a pair from the robot's order to the board's order, or back.
        """
        return (pair[1], pair[0]) if self.settings.inverted else pair


def _moves(command: SetRpm | SetDuty) -> bool:
    match command:
        case SetRpm(left, right) | SetDuty(left, right):
            return bool(left or right)
