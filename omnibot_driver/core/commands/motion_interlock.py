# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motion interlock: refuses motion after the motion monitor has stopped the robot.

In this module, a stop is always a stop by the motion monitor. Time is an argument.
"""

import math
from enum import Enum
from typing import Final

AGAIN_S: Final = 60.0
"""Two stops within this time, in s, are assumed to have the same cause. After the second stop,
motion is refused until the user calls ~/start or uses the e-stop (``Until``).
"""


class Until(Enum):
    """The condition that ends the refusal of motion commands."""

    NOTHING = "Motion is allowed"
    RELEASE = (
        "Motion is refused until you send a zero command, or until no command arrives for"
        " `cmd_vel_timeout`"
    )
    START = "This is the second such stop within 60 s: motion is refused until ~/start is called"
    ESTOP = (
        "This is the second such stop within 60 s: motion is refused until the e-stop is latched"
        " and released"
    )


class MotionInterlock:
    """The refusal of motion after a stop by the motion monitor.

    * ``until``: what ends the refusal.
    * ``starts``: whether the board supports ~/start.
    """

    def __init__(self, *, starts: bool = True) -> None:
        self._for_good = Until.START if starts else Until.ESTOP
        self.until = Until.NOTHING
        self.trips = 0
        self._tripped_at = self._commanded_at = -math.inf

    def trip(self, now: float) -> None:
        """Refuse motion, because the monitor has stopped a robot that did not move as commanded."""
        again = now - self._tripped_at <= AGAIN_S or self.until is self._for_good
        self.until = self._for_good if again else Until.RELEASE
        self.trips += 1
        self._tripped_at = now

    def start(self) -> None:
        """End any refusal, for example because the user has called ~/start."""
        self.until, self._tripped_at = Until.NOTHING, -math.inf

    def release(self) -> None:
        """Record that the e-stop was released.

        If the board has no ~/start, the release ends a refusal after the motion monitor's second
        stop within 60 s.
        """
        if self.until is Until.ESTOP:
            self.start()

    def expire(self, now: float, timeout_s: float) -> None:
        """End the refusal of motion if ``timeout_s`` has passed without a command.

        A refusal after the motion monitor's second stop within 60 s does not end in this way.
        """
        if self.until is Until.RELEASE and not self.reason(now, timeout_s):
            self.until = Until.NOTHING

    def be_active(self, now: float, timeout_s: float, *, stalled_s: float = 0.0) -> None:
        """Begin a new wait of ``timeout_s`` (s) without commands. After it, a refusal can end.

        Call this method after a refused command, and after a stall of ``stalled_s`` (s).
        """
        # A refusal whose time was over before the stall has ended. During the stall, commands may
        # have arrived unnoticed.
        self.expire(now - stalled_s, timeout_s)
        self._commanded_at = now

    def arrive(self, now: float, timeout_s: float, *, stands: bool) -> str:
        """Record a command, and return why it is refused; empty if it is allowed.

        * ``timeout_s``: time in s without commands after which a refusal can end.
        * ``stands``: whether the command is a standstill, which is always allowed.
        """
        reason = "" if stands else self.reason(now, timeout_s)
        if not stands:
            self._commanded_at = now
        if self.until is Until.RELEASE and not reason:
            self.until = Until.NOTHING
        return reason

    def reason(self, now: float, timeout_s: float) -> str:
        """Return why a motion at ``now`` is refused, with a remedy; empty if it is allowed."""
        if self.until is Until.RELEASE:
            if now - self._commanded_at >= timeout_s:
                return ""
            return (
                "the motion monitor has stopped the robot; send a zero command, or no command for"
                f" {timeout_s:g} s"
            )
        if self.until is Until.START:
            return (
                "the motion monitor has stopped the robot twice within 60 s; find the cause, then"
                " call ~/start"
            )
        if self.until is Until.ESTOP:
            return (
                "the motion monitor has stopped the robot twice within 60 s; find the cause, then"
                " latch and release the e-stop (service ~/estop)"
            )
        return ""
