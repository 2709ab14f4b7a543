# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Changes of the terminal mode, and the stop before changes that need a robot at rest.

In a terminal mode, the board reports neither motion nor its e-stop button. This module knows modes
and times, but not how commands are sent.
"""

import math
from typing import Final

from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.messages import SetDuty, SetRpm, TerminalMode

SENSORS: Final = (TerminalMode.GPS, TerminalMode.COMPASS)
UNPROVED_S: Final = 2.0
"""Time in s for which the driver sends Stop if it cannot see whether the robot is at rest."""
AGAIN_S: Final = 0.5
STILL_TALKS_S: Final = 0.3
"""Time in s, after a mode is written, in which reports of the earlier mode can still arrive."""


class ModeChange:
    """Brings the board into the requested terminal mode, ``wanted``.

    ``want`` requests a mode. ``stop_first`` stops the robot for the change of a parameter. Both
    methods may be called at any time.
    """

    def __init__(self) -> None:
        self.wanted = TerminalMode.HOST
        self._told: TerminalMode | None = None
        """The terminal mode that was written last.

        None in a new connection, and after a message that the board sends only outside terminal
        modes.
        """
        self._said_at_s = self._again_at_s = -math.inf
        self._stopping: dict[str, str] = {}
        """The changes that wait until the robot has stopped: new values of parameters, by name."""
        self._stopping_since_s: float | None = None
        self.left = False
        """Whether the board has left a terminal mode. The code that reads this value then sets it
        to False."""

    def connect(self) -> None:
        """Begin a new connection.

        At its beginning, the driver does not know the mode of the board.
        """
        self._told = None

    def want(self, mode: TerminalMode) -> None:
        """Request a terminal mode. A sensor's mode begins only after the robot has been stopped."""
        if mode not in SENSORS:
            self._stopping.pop("terminal_mode", None)
        elif mode is not self.wanted:
            self.stop_first("terminal_mode", mode.name.lower())
        self.wanted = mode
        self._again_at_s = -math.inf

    def stop_first(self, parameter: str, value: str) -> None:
        """Stop the robot, because ``parameter`` gets a new ``value``.

        Motion is refused until the robot is seen at rest, but at most for about ``UNPROVED_S``.
        """
        self._stopping[parameter], self._stopping_since_s = value, None

    @property
    def terminal(self) -> bool:
        """Whether the driver has written a terminal mode.

        The board may then send the lines of a sensor.
        """
        return self._told is not None

    @property
    def sensor_wanted(self) -> bool:
        """Whether a sensor's mode is requested.

        In such a mode, the board only passes on the sensor's lines.
        """
        return self.wanted in SENSORS

    @property
    def reason(self) -> str:
        """Reason why motion is refused, as a sentence. Empty if motion is allowed."""
        mode = self.wanted.name.lower()
        if self.sensor_wanted and self._told is self.wanted:
            return (
                f"terminal_mode is {mode}, so the board reports no motion;"
                " set terminal_mode to host"
            )
        if self._told is not None and not self.sensor_wanted:
            return "the board has not left its terminal mode yet; wait until its reports arrive"
        what_to_do = "set terminal_mode to host" if self.sensor_wanted else "wait"
        if self._stopping:
            changes = (f"{name} is changing to {value}" for name, value in self._stopping.items())
            return f"{' and '.join(changes)}, and the robot is being stopped first; {what_to_do}"
        return f"terminal_mode is changing to {mode}; {what_to_do}" if self.sensor_wanted else ""

    @property
    def wake_at(self) -> float:
        """Time at which to call ``stops`` and ``due`` next."""
        if self._stopping:
            return -math.inf if self._stopping_since_s is None else self._again_at_s
        waits = self.sensor_wanted or self._told is not None
        return self._again_at_s if waits else math.inf

    def stops(self, now: float, *, stands: bool, cleared: bool) -> SetDuty | SetRpm | None:
        """Return the command to send now to stop the robot, or None if no stop is needed.

        ``stands``: whether the robot is seen at rest.

        ``cleared``: whether RPM 0/0 was sent often enough.
        """
        if not self._stopping:
            return None
        command: SetDuty | SetRpm = outbound.STOP
        if self._stopping_since_s is None:
            self._stopping_since_s = now
        elif stands or now - self._stopping_since_s >= UNPROVED_S:
            if cleared:
                self._stopping.clear()
                self._again_at_s = -math.inf
                return None
            # RPM 0/0 clears the RPM target. While the target is positive, the public firmware
            # counts the ticks of a wheel as forward motion, even if a duty drives the wheel
            # backward.
            command = outbound.EMERGENCY_STOP
        self._again_at_s = now + 0.05
        return command

    def due(self, now: float, *, settled: bool) -> TerminalMode | None:
        """Return the mode to write now, or None.

        ``settled``: whether all settings were sent.
        """
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
        """Record a message that the board sends only outside terminal modes.

        It shows that no terminal mode is active now.
        """
        if self._told is None or now - self._said_at_s < STILL_TALKS_S:
            return
        if not self.sensor_wanted:
            self.left = True
        self._told = None  # so that ``due`` writes a sensor's mode again
