# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The reasons to stop the motion in progress.

One reason is that the driver does not know what the robot does. This module knows the wanted
command and measurements; it does not know how a motion begins or is stopped. The caller passes the
time.
"""

from typing import Final

from omnibot_driver.core.commands.orders import Drive, GoTo
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart.ground import Ground
from omnibot_driver.core.mart.required_motion import moving_order, required_motion
from omnibot_driver.core.mart.states import ROLLING, Motion, State

BLIND_S, TRIPS = 0.8, 5
"""Terms of the longest time for which the robot may drive without a new measurement.

This time is BLIND_S (s), plus TRIPS times the average duration of an exchange.
"""
FROZEN_S, FROZEN_TIMES = 0.5, 3
"""Limits for a constant heading. If both are reached, the driver stops the robot.

``FROZEN_S``: time in s. The driver adds twice the average duration of a query to this limit.

``FROZEN_TIMES``: number of replies with the same heading.
"""
NO_START_S: Final = 1.5
"""Longest allowed time in s from the start of a motion until the robot moves."""
LATE: Final = " while the robot drives: check the network"
STUCK: Final = (
    "the robot is commanded to move, but does not move: check motors, wheels and power, and"
    " whether another program stops it"
)
HALF_STUCK: Final = (
    "one wheel does not turn: check its motor, wiring and power; forward motion is refused until"
    " the command is zero or expires"
)
CREEP_MPS, CREEP_RADPS = 0.01, 0.02
"""Limits in m/s and rad/s. A robot whose measured speed or turn rate exceeds one of them certainly
moves."""
BLOCKED_S: Final = 0.6
"""Time in s for which a wheel must stand still in a drive before it is regarded as blocked."""
STUCK_S, COASTS_S = 0.5, 0.2
"""Times in s for which the left wheel, which has no encoder, may have turned unseen.

This motion makes the odometry less certain.

``STUCK_S``: if the robot did not seem to move.

``COASTS_S``: if the robot was stopped because a wheel was blocked.
"""


class StopReasons(Ground):
    """The part of ``Pilot`` that decides whether the motion in progress may continue."""

    def _order(self, now: float) -> Drive | GoTo | None:
        return moving_order(self._wanted, now)

    def _wish(self, now: float) -> tuple[Motion, BodyTwist]:
        return required_motion(self._order(now), self._settings.track_m)

    def _agrees(self, now: float) -> bool:
        """Return whether the motion in progress is what the current command or job needs."""
        motion, twist = self._wish(now)
        if self.motion in (Motion.STRAIGHT, Motion.TURN):
            return self._move is not None or self.jobs.moving or self._rescue
        if motion is not self.motion:
            return False
        if motion is Motion.SPIN:
            turned_s = now - self._begun_s if self.state is State.TURNING else 0.0
            disturbed = self.conversation.disturbed(now)
            return self._turns.fits(
                twist.yaw_rate_radps, now, turned_s=turned_s, disturbed=disturbed
            )
        return True

    def _why_stop(self, now: float) -> str:
        """Return why the current motion must stop. The result is empty if the motion may continue.

        The reason is "wanted" if another motion or a stop is commanded. Any other reason is a
        sentence for the user.
        """
        if self.state not in (State.STARTING, State.MOVING, *ROLLING):
            return ""
        if self.health.tripped:
            return f"the motor board reports {self.health.tripped}"
        if not self._agrees(now):
            return "wanted"
        if self.state not in ROLLING:
            return ""
        odometry = self.odometry
        blind_s = BLIND_S + TRIPS * self.conversation.trip_s
        if self._heading_is_told and now - max(odometry.heading.told_s, self._begun_s) > blind_s:
            return f"the server does not report the relative heading{LATE}"
        if now - max(odometry.wheel.told_s, self._begun_s) > blind_s:
            return f"the server does not report the encoder count{LATE}"
        if (
            odometry.wheel.told_s - self._begun_s > NO_START_S
            and abs(odometry.speeds.means[0]) < CREEP_MPS
            and abs(odometry.speeds.means[1]) < CREEP_RADPS
        ):
            return STUCK
        if self.state is State.DRIVING and self.loop.blocked_s > BLOCKED_S:
            return HALF_STUCK
        longest_s = FROZEN_S + 2 * self.conversation.trip_s
        # on a slow network, few replies come within this time, and they may be equal by chance
        frozen = odometry.heading.same >= FROZEN_TIMES and self._frozen_s > longest_s
        if self._heading_is_told and frozen:
            if self.motion is not Motion.SPIN and abs(odometry.speeds.means[0]) < CREEP_MPS:
                return STUCK
            return "the relative heading does not change: the IMU is dead, or the robot cannot turn"
        return ""

    @property
    def _heading_is_told(self) -> bool:
        return self.state is State.DRIVING or self.motion in self.health.heading_told

    @property
    def _frozen_s(self) -> float:
        """Time in s for which the reported heading in this motion has been constant."""
        odometry = self.odometry
        return odometry.heading.told_s - max(odometry.heading.changed_s, self._begun_s)
