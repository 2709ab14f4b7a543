# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Into a terminal mode and out of it, and the standstill that any change of mode waits for.

In a terminal mode the board passes a sensor's lines through and is silent itself. It still obeys
set-points, but it shows no motion, and the public firmware reports no press of its button. So the
robot is stopped first, and is not driven before the protocol is heard again. Whatever is written is
sent again until its effect is seen. Knows modes and times, no lines.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.messages import TerminalMode

SENSORS: Final = (TerminalMode.GPS, TerminalMode.COMPASS)
UNPROVED_S: Final = 2.0
"""How long a robot is stopped that cannot be seen to stand."""
AGAIN_S: Final = 0.5
STILL_TALKS_S: Final = 0.3
"""What the board says of itself so soon after a change of the mode may have been on its way."""


class ModeChange:
    """``reason``: why the robot is not driven now, in a sentence; empty where it may be.

    ``wanted`` may be changed at any time, and ``stop_first`` be called.
    """

    def __init__(self) -> None:
        self.wanted = TerminalMode.HOST
        self._told: TerminalMode | None = None
        """The sensor whose lines the board was asked for, until its own are heard again."""
        self._said_at_s = self._again_at_s = -math.inf
        self._stopping = ""
        self._stopping_since_s: float | None = None
        self.left = False
        """The protocol is heard again after a terminal mode; to be taken back by who reads it."""

    def connect(self) -> None:
        """The line is new, and the board may be in any mode."""
        self._told = None

    def want(self, mode: TerminalMode) -> None:
        """Another mode; a sensor's begins when the robot stands."""
        if mode in SENSORS and mode is not self.wanted:
            self.stop_first(f"terminal_mode becomes {mode.name.lower()}")
        self.wanted = mode
        self._again_at_s = -math.inf

    def stop_first(self, why: str) -> None:
        """The robot is stopped, and driven again when it stands."""
        self._stopping, self._stopping_since_s = why, None

    @property
    def terminal(self) -> bool:
        """Whether lines of a sensor are to be expected."""
        return self._told is not None

    @property
    def sensor_wanted(self) -> bool:
        """Whether the board's own silence is wanted."""
        return self.wanted in SENSORS

    @property
    def reason(self) -> str:
        """The reason why motion is refused."""
        if self.sensor_wanted:
            return (
                f"terminal_mode is {self.wanted.name.lower()}, and the board reports no motion;"
                " set terminal_mode to host"
            )
        if self._told is not None:
            return "the board has not left its terminal mode yet; wait for its data"
        return self._stopping and f"{self._stopping}, and the robot is being stopped first; wait"

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` must be called again."""
        if self._stopping:
            return -math.inf if self._stopping_since_s is None else self._again_at_s
        waits = self.sensor_wanted or self._told is not None
        return self._again_at_s if waits else math.inf

    def stops(self, now: float, *, stands: bool) -> bool:
        """Whether Stop is to be said now, as the robot has to stand first."""
        if not self._stopping:
            return False
        if self._stopping_since_s is None:
            self._stopping_since_s = now
        elif stands or now - self._stopping_since_s >= UNPROVED_S:
            self._stopping = ""
            self._again_at_s = -math.inf
            return False
        self._again_at_s = now + 0.05
        return True

    def due(self, now: float, *, settled: bool) -> TerminalMode | None:
        """The mode to write now. ``settled``: no other settings are on their way."""
        if self._stopping or now < self._again_at_s:
            return None
        if self.sensor_wanted:
            self._again_at_s = now + AGAIN_S
            if not settled or self._told is self.wanted:
                return None
            self._told, self._said_at_s = self.wanted, now
            return self.wanted
        if self._told is None:
            return None
        self._again_at_s, self._said_at_s = now + AGAIN_S, now
        return TerminalMode.HOST

    def protocol_heard(self, now: float) -> None:
        """The board spoke for itself: it is in no terminal mode, or not yet."""
        if self._told is None or now - self._said_at_s < STILL_TALKS_S:
            return
        if not self.sensor_wanted:
            self.left = True
        self._told = None  # a sensor is asked for again
