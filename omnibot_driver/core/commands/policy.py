# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The command policy: which command is in effect, when it expires, and how the robot is stopped.

A board continues the last motion until it receives Stop, so Stop is sent when a command expires.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.commands.actuator import Actuator
from omnibot_driver.core.commands.orders import EMERGENCY_STOP, STOP
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.packets import Packets

STOPPING_S: Final = 1.05
"""Shortest time in s for which Stop is repeated.

Stop is sent at least every 0.05 s, so the last Stop is sent at least 1 s after the first.
"""
UNPROVED_S: Final = 5.0
"""Longest time, in s, for which Stop is repeated without proof that the robot stands still."""
ROUNDING_S: Final = 1e-6
"""Margin added to a wake-up time, in s, so that rounding cannot make the wake-up too early."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandSettings:
    """The settings of the policy.

    * ``timeout_s``: age at which a command expires, in s.
    * ``rate_hz``: rate at which a command is repeated.
    """

    timeout_s: float = 0.5
    rate_hz: float = 20.0


class CommandPolicy:
    """The command in effect: what the robot should do now.

    * ``proof``: the proof that the robot stands still.
    """

    def __init__(self, settings: CommandSettings, actuator: Actuator, proof: StopProof) -> None:
        self.proof = proof
        self._actuator = actuator
        self.configure(settings)
        self.latched = False
        self.current: Setpoint | None = None
        """Command in effect, or None."""
        self.commanded_at = -math.inf
        self.quiet = False
        """Whether the policy sends nothing while it waits for the proof of the last Stop."""
        self.unconfirmed = False
        """Whether the repetition of Stop has ended without proof that the robot stands still."""
        self._expires_at = -math.inf
        self._stopping_since: float | None = None

    def configure(self, settings: CommandSettings) -> None:
        """Use these settings from the next command or repetition on."""
        self.settings = settings
        self._actuator.rate_hz = settings.rate_hz

    def command(self, setpoint: Setpoint, now: float, *, expires_at: float) -> None:
        """Replace the current command by ``setpoint``. While the e-stop is latched, do nothing."""
        if self.latched:
            return
        self.current = setpoint
        self.commanded_at, self._expires_at = now, expires_at
        self._stopping_since = None
        self._actuator.apply(setpoint, now)

    def discard(self, now: float) -> None:
        """Drop the current command and send nothing more.

        While the e-stop is latched, the emergency stop is still repeated.
        """
        self.current = self._stopping_since = None
        if not self.latched:
            self._actuator.apply(None, now)

    def connect(self, now: float) -> None:
        """Begin a new connection. If the e-stop is latched, send the emergency stop again."""
        self.current = self._stopping_since = None
        self.proof.begin()
        self._actuator.connect()
        if self.latched:
            self._actuator.apply(EMERGENCY_STOP, now)

    def halt(self, now: float) -> None:
        """Drop the current command, and repeat Stop until a standstill is proved.

        Stop is repeated for ``STOPPING_S`` to ``UNPROVED_S``. While the e-stop is latched, the
        emergency stop is repeated instead, until ``release``.
        """
        self.current = None
        self.quiet = False
        self._stopping_since = None if self.latched else now
        self._actuator.apply(EMERGENCY_STOP if self.latched else STOP, now)

    def fall_silent(self, now: float) -> None:
        """Send nothing more, and wait for a new proof that the robot obeyed the last Stop."""
        self.discard(now)
        self.quiet = True
        self.proof.begin()
        self.proof.stopped(now)

    def latch(self, now: float) -> None:
        """Drop the current command, and repeat the emergency stop until ``release``."""
        if not self.latched:
            self.current = self._stopping_since = None
            self.latched = True
            self._actuator.apply(EMERGENCY_STOP, now)

    def release(self, now: float) -> None:
        """Release the e-stop. The robot stays stopped until the next command."""
        if self.latched:
            self.latched = False
            self.halt(now)

    def due(self, now: float) -> Packets:
        """Return the packets to write now, possibly none, and regard them as written."""
        if self.current is not None and now >= self._expires_at:
            self.halt(now)
        if self._stopping_since is not None and now - self._stopping_since >= self._stopping_s:
            self._stopping_since = None
            self.unconfirmed = self.proof.owed
            self._actuator.apply(None, now)
        return self._actuator.due(now)

    @property
    def wake_at(self) -> float:
        """Time at which ``due`` must be called again, in s; infinity if nothing is to be sent."""
        if self.current is not None:
            return min(self._actuator.wake_at, self._expires_at)
        if self._stopping_since is not None:
            ends_at = self._stopping_since + self._stopping_s + ROUNDING_S
            return min(self._actuator.wake_at, ends_at)
        return self._actuator.wake_at

    @property
    def _stopping_s(self) -> float:
        return STOPPING_S if self.proof.proved else UNPROVED_S
