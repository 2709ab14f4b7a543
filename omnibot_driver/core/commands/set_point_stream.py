# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""An actuator that decides which set-point frame is sent when.

Boards that follow set-points do not acknowledge frames, so frames are repeated. This module reads
no clock.
"""

import math
from collections.abc import Callable
from typing import Final, Protocol

from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import EMERGENCY_STOP, EmergencyStop, Order, Stop
from omnibot_driver.core.commands.set_points import Setpoint
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.packets import NO_PACKETS, Packets

PACE_S: Final = 0.01
"""Shortest time between frames, in s. More frequent frames would only fill a buffer."""
MOTION_PACE_S: Final = 0.018
"""Shortest time between two set-points, in s; short enough for commands at 50 Hz.

On a line that loses bytes, more set-points would mean more wrong motion
(docs/internals/integrity.md).
"""
STOP_RATE_HZ: Final = 20.0
"""Lowest rate at which Stop and the emergency stop are repeated, in Hz."""


class Encoder(Protocol):
    """The encoding of a board's frames with its present settings."""

    def stop(self) -> Packets:
        """Return the packets that make the robot stand still."""

    def emergency_stop(self) -> Packets:
        """Return the packets of the board's own emergency stop, without a Stop."""

    def encode(self, order: Order) -> Packets:
        """Return the packets that command ``order``.

        Raises CommandRefused if the board's frames cannot express ``order``.
        """

    def meaning(self, packets: Packets) -> BodyTwist:
        """Return the rounded body velocity that these packets command, in the board's axes."""


class SetpointStream:
    """An actuator that repeats the set-point in effect.

    * ``proof``: object to which each sent stop and each sent motion is reported.
    * ``heard``: function that is called with the packets and the time of each write, also for
      requests.
    """

    def __init__(
        self,
        encoder: Encoder,
        proof: StopProof,
        *,
        rate_hz: float = 20.0,
        heard: Callable[[Packets, float], None] | None = None,
    ) -> None:
        self._heard = heard
        self.rate_hz = rate_hz
        self.commanded: BodyTwist | None = None
        self._encoder, self._proof = encoder, proof
        self.connect()

    def is_zero(self, order: Order) -> bool:
        """Return whether this order is encoded as Stop.

        A very slow motion is also encoded as Stop, because its velocity is rounded to zero.
        """
        return self._encoder.encode(order) == self._encoder.stop()

    def connect(self) -> None:
        """Begin a new connection, on which nothing has been sent."""
        self._motion: Setpoint | None = None
        self._standing: Stop | EmergencyStop | None = None
        self._fresh = self._urgent = self._switching = False
        self._said_at = self._fresh_at = self._moved_at = self._stop_at = -math.inf

    def apply(self, wanted: Wanted, now: float) -> None:
        """Replace the order in effect. If the commanding topic changes, Stop is sent first."""
        rested = now - self._stop_at >= PACE_S
        if wanted is None or isinstance(wanted, Stop | EmergencyStop):
            begins = wanted is not self._standing
            self._motion, self._standing = None, wanted
            self._fresh = self._switching = False
            self._urgent = wanted is not None and (rested or (begins and wanted is EMERGENCY_STOP))
            return
        before, self._motion, self._standing = self._motion, wanted, None
        self._fresh = True
        self._switching |= before is not None and before.authority is not wanted.authority
        self._urgent = self._switching or wanted.is_zero
        if self._urgent and not rested:
            self._switching = self._urgent = False
            self._fresh_at = self._stop_at

    def wrote(self, packets: Packets, now: float) -> None:
        """Record that the packets of a request were written.

        If a motion command is in effect, its set-point is then sent again at once.
        """
        if self._heard is not None:
            self._heard(packets, now)
        first = dict(reversed(packets))
        stops = all(
            first.get(channel, b"").startswith(stop) for channel, stop in self._encoder.stop()
        )
        if stops:
            self._note_stop(now)
            if self._standing is not EMERGENCY_STOP:
                self._urgent = False
        # The packets may contain Stop, which has stopped the robot. Or the board may have received
        # only a part of a motion frame, and have taken bytes of the packets as the missing part.
        if self._motion is not None and not (stops and self._motion.is_zero):
            self._said_at = -math.inf

    def due(self, now: float) -> Packets:
        """Return the frames that the caller must write now, and record them as written."""
        if now < self.wake_at:
            return NO_PACKETS
        motion = self._motion
        new = self._fresh or self._urgent or not (motion is None or motion.settled)
        packets = self._next(now)
        self._said_at = now
        if new:
            self._fresh_at = now
            moves = motion is not None and not motion.is_zero and not self._switching
            self._moved_at = now if moves else -math.inf
        self._fresh, self._urgent, self._switching = self._switching, False, False
        self.commanded = self._encoder.meaning(packets)
        if self._heard is not None:
            self._heard(packets, now)
        return packets

    @property
    def wake_at(self) -> float:
        """Time at which the next frame is due, in s; infinity if none is due."""
        motion = self._motion
        if self._urgent:
            return -math.inf
        if motion is not None and self._fresh:
            return max(self._fresh_at + PACE_S, self._moved_at + MOTION_PACE_S)
        if self._standing is not None or (motion is not None and motion.is_zero):
            return self._said_at + 1.0 / max(self.rate_hz, STOP_RATE_HZ)
        if motion is None:
            return math.inf
        return self._said_at + (1.0 / self.rate_hz if motion.settled else MOTION_PACE_S)

    def _next(self, now: float) -> Packets:
        motion = self._motion
        if self._standing is EMERGENCY_STOP:
            self._note_stop(now)
            both = self._encoder.emergency_stop() + self._encoder.stop()
            return both * (2 if self._urgent else 1)
        if motion is not None and not self._switching:
            if motion.is_zero:
                self._note_stop(now)
            else:
                self._proof.moved()
                self._stop_at = -math.inf
            return self._encoder.encode(motion.order(now))
        self._note_stop(now)
        return self._encoder.stop()

    def _note_stop(self, now: float) -> None:
        self._stop_at = now
        self._proof.stopped(now)
