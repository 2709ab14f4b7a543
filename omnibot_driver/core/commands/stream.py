# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Which frame goes out when: pacing, repeating, timing out, one authority, the e-stop latch.

Nothing acknowledges a command and the board never stops by itself. So the current command is
repeated, and when it expires Stop is repeated until the robot is seen to stand. This module does
not know what is in a frame; time is an argument.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.commands.stop_proof import StopProof

PACE_S: Final = 0.01
"""The board's control tick: frames closer together than this would only fill its buffer."""
MOTION_PACE_S: Final = 0.018
"""Between two set-points. More of them would raise the share of time that a lost byte can take
(docs/integrity.md); commands at 50 Hz are not slowed."""
STOPPING_S: Final = 1.0
"""Stop is repeated for at least so long..."""
UNPROVED_S: Final = 5.0
"""... and for so long at most while nothing shows that the robot stands."""
STOP_RATE_HZ: Final = 20.0
"""Stop and the emergency stop are repeated at least so often."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandSettings:
    """``timeout_s``: age at which a command expires; ``rate_hz``: how often it is repeated."""

    timeout_s: float = 0.5
    rate_hz: float = 20.0


class CommandStream:
    """The outbound line. ``settings`` may be replaced at any time."""

    def __init__(self, settings: CommandSettings, *, stop: bytes, emergency_stop: bytes) -> None:
        self.settings = settings
        self.latched = False
        self.proof = StopProof()
        self.current: Setpoint | None = None
        """The command that is being carried out."""
        self.commanded_at = -math.inf
        self.quiet = False
        """It has fallen silent, and nothing was commanded since."""
        self.unconfirmed = False
        """Stop was repeated for ``UNPROVED_S`` and a robot that was driven is not seen to stand."""
        self._stop, self._emergency_stop = stop, emergency_stop
        self._expires_at = -math.inf
        self._stopping_since: float | None = None
        self._urgent = self._fresh = self._switching = False
        self._said_at = self._fresh_at = self._moved_at = self._stop_at = -math.inf

    def command(self, motion: Setpoint, now: float, *, expires_at: float) -> None:
        """The newest command replaces the current one; another authority's is stopped first."""
        before, self.current = self.current, motion
        self.commanded_at, self._expires_at = now, expires_at
        self._stopping_since = None
        self._fresh = True
        self._switching |= before is not None and before.authority is not motion.authority
        self._urgent = self._switching or motion.stands
        if self._urgent and now - self._stop_at < PACE_S:
            self._switching = self._urgent = False
            self._fresh_at = self._stop_at

    def discard(self) -> None:
        """No command is current and the line goes quiet; a latched e-stop stays."""
        self.current = self._stopping_since = None
        self._fresh = self._urgent = self._switching = False

    def connect(self) -> None:
        """The line is new, and the board has heard nothing of it; a latched e-stop is said."""
        self.discard()
        self.proof.begin()
        self._said_at = self._fresh_at = self._moved_at = self._stop_at = -math.inf
        self._urgent = self.latched

    def halt(self, now: float) -> None:
        """Discard the command, Stop at once, and repeat it until the robot is seen to stand."""
        self.discard()
        self.quiet = False
        self._stopping_since = now
        self._urgent = now - self._stop_at >= PACE_S

    def fall_silent(self, now: float) -> None:
        """Nothing goes out any more, and whether the last Stop arrived is to be seen anew."""
        self.discard()
        self.quiet = True
        self.proof.begin()
        self.proof.stopped(now)

    def latch(self) -> None:
        """Emergency stop and Stop at once, twice; then both in turn until the release."""
        if not self.latched:
            self.discard()
            self.latched = self._urgent = True

    def release(self, now: float) -> None:
        """End the e-stop; the robot stands until a new command comes."""
        if self.latched:
            self.latched = False
            self.halt(now)

    def wrote(self, data: bytes, now: float) -> None:
        """A request went out. What it left of a motion frame is completed: say that again."""
        if data.startswith(self._stop):
            self._note_stop(now)
            if not self.latched:
                self._urgent = False
        elif self.current is not None:
            self._said_at = -math.inf

    def due(self, now: float) -> bytes:
        """The bytes to write now, possibly none. They count as written."""
        if self.current is not None and now >= self._expires_at:
            self.halt(now)
        if now < self._next_write():
            return b""
        new = self._fresh or self._urgent or not (self.current is None or self.current.settled)
        data = self._next(now)
        if data:
            self._said_at = now
            if new:
                self._fresh_at = now
                is_motion = self.current and not self.current.stands and not self._switching
                self._moved_at = now if is_motion else -math.inf
        self._fresh, self._urgent, self._switching = self._switching, False, False
        return data

    @property
    def wake_at(self) -> float:
        """When ``due`` has to be asked again; infinity while the line is quiet."""
        next_write = self._next_write()
        return next_write if self.current is None else min(next_write, self._expires_at)

    def _next_write(self) -> float:
        if self._urgent:
            return -math.inf
        current = self.current
        if current is not None and self._fresh:
            return max(self._fresh_at + PACE_S, self._moved_at + MOTION_PACE_S)
        if self.latched or self._stopping_since is not None or (current and current.stands):
            return self._said_at + 1.0 / max(self.settings.rate_hz, STOP_RATE_HZ)
        if current is None:
            return math.inf
        return self._said_at + (1.0 / self.settings.rate_hz if current.settled else MOTION_PACE_S)

    def _next(self, now: float) -> bytes:
        if self.latched:
            self._note_stop(now)
            return (self._emergency_stop + self._stop) * (2 if self._urgent else 1)
        if self.current is not None and not self._switching:
            if self.current.stands:
                self._note_stop(now)
            else:
                self.proof.moved()
                self._stop_at = -math.inf
            return self.current.frame(now)
        if self._stopping_since is not None:
            passed_s = now - self._stopping_since
            if passed_s >= (STOPPING_S if self.proof.proved else UNPROVED_S):
                self._stopping_since = None
                self.unconfirmed = self.proof.owed
                return b""
        self._note_stop(now)
        return self._stop

    def _note_stop(self, now: float) -> None:
        self._stop_at = now
        self.proof.stopped(now)
