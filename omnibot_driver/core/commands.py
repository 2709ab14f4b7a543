# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Which frame goes out when: pacing, repeating, timing out, one authority, the e-stop latch.

Nothing acknowledges a command and the board never stops by itself, so the current command is
repeated, and when it grows old Stop is, for a while. This module does not know what is in a frame;
time is an argument.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.motion import Motion

PACE_S: Final = 0.01
"""The board's control tick: commands closer together than this would only fill its buffer."""
STOPPING_S: Final = 1.0
"""How long Stop is repeated before the line goes quiet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandSettings:
    """``timeout_s``: age at which a command is worth nothing; ``rate_hz``: how often it repeats."""

    timeout_s: float = 0.5
    rate_hz: float = 20.0


class CommandStream:
    """The outbound line. ``settings`` may be replaced at any time."""

    def __init__(self, settings: CommandSettings, *, stop: bytes, emergency_stop: bytes) -> None:
        self.settings = settings
        self.latched = False
        self._stop, self._emergency_stop = stop, emergency_stop
        self.current: Motion | None = None
        """The command that is being carried out."""
        self.commanded_at = -math.inf
        self._expires_at = -math.inf
        self._stopping_until = -math.inf
        self._written_at = self._said_at = -math.inf
        self._last_written = b""
        self._urgent = False
        self._fresh = self._switching = False
        self._quiet = True
        """Nothing is to be written until something happens."""

    def command(self, motion: Motion, now: float, *, expires_at: float) -> None:
        """The newest command replaces whatever was current; another's is stopped in between."""
        before, self.current = self.current, motion
        self.commanded_at, self._expires_at = now, expires_at
        self._fresh, self._quiet = True, False
        self._switching |= before is not None and before.authority is not motion.authority
        self._urgent = self._switching or motion.stands
        if self._urgent and self._just_written(self._stop, now):
            self._switching = self._urgent = False

    def discard(self) -> None:
        """No command is current and the line goes quiet; an e-stop stays."""
        self.current = None
        self._stopping_until = -math.inf
        self._fresh = self._urgent = self._switching = False

    def halt(self, now: float) -> None:
        """Discard the command, Stop at once, and repeat it for ``STOPPING_S``."""
        self.discard()
        self._stopping_until, self._quiet = now + STOPPING_S, False
        self._urgent = not self._just_written(self._stop, now)

    def latch(self, now: float) -> None:
        """E-stop: nothing but emergency-stop frames from now on, the first at once."""
        self.discard()
        self.latched, self._quiet = True, False
        self._urgent = not self._just_written(self._emergency_stop, now)

    def release(self, now: float) -> None:
        """End the e-stop; the robot stands until a new command comes."""
        if self.latched:
            self.latched = False
            self.halt(now)

    def wrote(self, data: bytes, now: float) -> None:
        """Anything was written to the line, by whomever."""
        self._last_written, self._written_at = data, now

    def due(self, now: float) -> bytes:
        """The bytes to write now, possibly none. They count as written."""
        if self._quiet:
            return b""
        if self.current is not None and now >= self._expires_at:
            self.halt(now)
        next_write = self._next_write()
        if now < next_write:
            return b""
        frame = self._frame(next_write, now)
        self._fresh, self._urgent, self._switching = self._switching, False, False
        if frame:
            self._said_at = now
            self.wrote(frame, now)
        else:
            self._quiet = True
        return frame

    @property
    def wake_at(self) -> float:
        """When ``due`` has to be asked again; infinity while the line is quiet."""
        if self._quiet:
            return math.inf
        next_write = self._next_write()
        if self.current is not None:
            return min(next_write, self._expires_at)
        return next_write if self._frame(next_write, next_write) else math.inf

    def _just_written(self, frame: bytes, now: float) -> bool:
        return self._last_written == frame and now - self._written_at < PACE_S

    def _next_write(self) -> float:
        if self._urgent:
            return -math.inf
        paced_at = self._written_at + PACE_S
        if self._fresh or (self.current is not None and not self.current.settled):
            return paced_at
        return max(paced_at, self._said_at + 1.0 / self.settings.rate_hz)

    def _frame(self, due_at: float, now: float) -> bytes:
        if self.latched:
            return self._emergency_stop
        if self._switching:
            return self._stop
        if self.current is not None:
            return self.current.frame(now)
        return self._stop if due_at < self._stopping_until else b""
