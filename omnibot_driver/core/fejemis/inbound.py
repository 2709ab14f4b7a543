# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Handles all messages: passes each to the parts that use it, and keeps the robot's mode."""

from collections.abc import Callable

from omnibot_driver.core.board import Mode
from omnibot_driver.core.fejemis.half import Half
from omnibot_driver.core.fejemis.messages import FrontAngle, Heartbeat, Message, keyword_of
from omnibot_driver.core.fejemis.obedience import Obedience
from omnibot_driver.core.fejemis.ports import Ports
from omnibot_driver.core.fejemis.told import Told
from omnibot_driver.core.fejemis.translation import Translation
from omnibot_driver.core.fejemis.upkeep import Upkeep
from omnibot_driver.core.fejemis.watch import Watch
from omnibot_driver.core.readings import PausedReading

AngleTold = Callable[[float, float], bool]
"""Function that receives the front wheel's angle in rad and the time in s.

It returns True for a new fault of the wheel.
"""


class Inbound:
    """Handler of all messages.

    * ``mode``: nominal while both boards send data and the drive board obeys.
    * ``relay_rad``: the front wheel's angle that must still be sent to the drive board, or None.
    """

    def __init__(
        self,
        ports: Ports,
        translation: Translation,
        upkeep: Upkeep,
        obedience: Obedience,
        told: Told,
        angle_told: AngleTold,
    ) -> None:
        self._ports, self._translation, self._upkeep = ports, translation, upkeep
        self._obedience, self._told, self._angle_told = obedience, told, angle_told
        self.watch = Watch(ports, translation.front, told)
        self.begin()

    def begin(self) -> None:
        """Begin new connections: forget the mode, ``relay_rad``, and all timeouts."""
        self.mode = Mode.UNKNOWN
        self.relay_rad: float | None = None
        self._front_unheard = True
        self._trouble = ""
        self.watch.begin()

    def take_relay(self) -> float | None:
        """Return the new angle of the front wheel in rad, which must be sent to the drive board.

        Return None if no angle has arrived since the last call.
        """
        angle_rad, self.relay_rad = self.relay_rad, None
        return angle_rad

    def receive(self, data: bytes, now: float, channel: int) -> None:
        """Decode the bytes from the port ``channel``, and handle the messages in them."""
        half = self._ports.halves[channel]
        for message in half.feed(data, now):
            if half.restarted:
                half.restarted = False
                self._restarted(half, now)
            self._hear(half, message, now)
        if half.role == "drive":
            self._translation.settle(half.clock, now)
        if half.not_understood(now):
            self._told.tell(
                f"many lines from the {self._ports.role(channel)} board are damaged or not"
                " understood: check the cable, and whether another program requests help text"
                " from the board",
                now,
            )
        if half.decoder.changed:
            half.decoder.changed = False
            ended = "now sends checksums" if half.decoder.sums else "no longer sends checksums"
            board = self._ports.role(channel)
            self._told.halt(f"the {board} board {ended}; robot stopped", now)

    def look(self, now: float, *, driving: bool) -> None:
        """Check the timeouts and update the mode; ``driving``: whether a motion is commanded."""
        machine = self._upkeep.machine
        was_unheard, self._front_unheard = self._front_unheard, now >= self.watch.front_unheard_at
        if self.watch.look(now, driving=driving):
            machine.off()
        elif machine.active and self._front_unheard:
            machine.off()
            self._told.tell(
                "no data from the front board for 0.25 s; brush and lift switched off", now
            )
        elif was_unheard and not self._front_unheard:
            machine.off()  # the board may have missed the first switch-off
        if not self._ports.ready:
            self.mode = Mode.UNKNOWN
        else:
            self.mode = Mode.PAUSED if self._is_stopped(now) else Mode.NOMINAL

    def _is_stopped(self, now: float) -> bool:
        return self._obedience.stopped(now, was_paused=self.mode is Mode.PAUSED)

    def _hear(self, half: Half, message: Message, now: float) -> None:
        if isinstance(message, Heartbeat):
            self._heartbeat(half, message, now)
        if (role := half.role) is None:
            return
        if keyword := keyword_of(message):
            half.note(keyword, now)
        self._upkeep.hear(role, message, now)
        if isinstance(message, FrontAngle):
            if role == "front":
                self._front_angle(message, now)
        elif role == "drive":
            self._translation.odometry.track_m = self._upkeep.geometry.track_m
            self._translation.hear_drive(message, half.clock, now)
        else:
            self._translation.hear_front(message, now)

    def _heartbeat(self, half: Half, message: Heartbeat, now: float) -> None:
        if self._ports.identify() and self._ports.swapped:
            self._told.tell(
                "the ports are swapped: the drive board is at `front_port`; the driver works"
                " in this order too",
                now,
            )
        before, self._trouble = self._trouble, self._ports.trouble
        if self._trouble:
            notify = self._told.tell if self._trouble == before else self._told.halt
            notify(f"{self._trouble}; robot stopped", now)
        if half.role != "drive":
            return
        self._obedience.hear(message.state)
        if self._ports.ready and self._is_stopped(now):
            was_paused, self.mode = self.mode is Mode.PAUSED, Mode.PAUSED
            self._upkeep.machine.off()
            self._translation.add(PausedReading(continues=was_paused), now)

    def _front_angle(self, message: FrontAngle, now: float) -> None:
        front = self._translation.front
        if not front.hear(message, now):
            return
        self.relay_rad = front.drives_by_rad
        self._translation.steering(front.angle_rad, now)
        if self._angle_told(front.angle_rad, now):
            self._told.halt(
                "the front wheel does not go where it is commanded; robot stopped. Check the servo"
                " and its power. If this happens in reverse, set `allow_reverse` to false",
                now,
            )

    def _restarted(self, half: Half, now: float) -> None:
        if (role := half.role) is None:
            return
        self.mode = Mode.UNKNOWN
        self._upkeep.restarted(role)
        if role == "drive":
            self._translation.restarted()
        else:
            self._translation.front.begin()
        self._told.halt(f"the {role} board has restarted; robot stopped", now)
