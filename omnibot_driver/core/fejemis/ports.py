# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds out which board (or *half*) is at which port, and addresses lines to the boards.

An unidentified board only gets heartbeat requests, and lines that stop or switch off something.
"""

from dataclasses import replace
from typing import Final

from omnibot_driver.core.fejemis.half import Half, Role
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.sums import lines
from omnibot_driver.core.fejemis.teensy_clock import TeensyClock
from omnibot_driver.core.fejemis.traits import TRAITS
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.traits import Traits

ROLES: Final[tuple[Role, Role]] = ("drive", "front")
PARAMETERS: Final = ("port", "front_port")
"""Names of the parameters for the two ports, by channel."""
SWAPPED: Final = replace(TRAITS, channels=TRAITS.channels[::-1])


class Ports:
    """The two boards, in the order of their ports.

    ``swapped``: whether the drive board is at the second port.
    """

    def __init__(self, settings: FejemisSettings) -> None:
        clocks: dict[int, TeensyClock] = {}
        self.halves = Half(settings.line_sums, clocks), Half(settings.line_sums, clocks)
        self.swapped = self._known_swapped = False

    @property
    def traits(self) -> Traits:
        """The robot's traits, which name each port after the board that was found at this port."""
        return SWAPPED if self.swapped else TRAITS

    def begin(self, settings: FejemisSettings) -> None:
        """Begin new connections on both ports."""
        for half in self.halves:
            half.begin(settings.line_sums)

    def configure(self, settings: FejemisSettings) -> None:
        """Apply the setting ``line_sums``, which says whether lines have checksums."""
        for half in self.halves:
            if half.decoder.line_sums != settings.line_sums:
                half.decoder.line_sums = settings.line_sums

    @property
    def ready(self) -> bool:
        """Whether one drive board and one front board send the data that driving requires."""
        return all(half.ready for half in self.halves) and not self.trouble

    @property
    def with_sums(self) -> bool:
        """Whether the text lines to both boards carry checksums."""
        return all(half.sums for half in self.halves)

    def half(self, role: Role) -> Half | None:
        """Return the board that has the ``role``.

        Return None if neither board has this role, or if both boards have it.
        """
        first, second = self.halves
        if first.role == role:
            return None if second.role == role else first
        return second if second.role == role else None

    def role(self, channel: int) -> Role:
        """Return the role of the board at ``channel``; while it is unknown, the expected role."""
        return self.halves[channel].role or ROLES[channel ^ self.swapped]

    def identify(self) -> bool:
        """Find out which board is at which port. Call this after a heartbeat.

        Return whether the boards have exchanged their ports since the ports of both boards were
        last known. Initially, the drive board is expected at the first port.
        """
        first, second = (half.role for half in self.halves)
        if first == second:
            return False
        self.swapped = first == "front" or (first is None and second == "drive")
        if first is None or second is None:
            return False
        before, self._known_swapped = self._known_swapped, self.swapped
        return before is not self.swapped

    @property
    def trouble(self) -> str:
        """Why the two boards cannot be one robot, with advice; empty if they can."""
        for name, half in zip(PARAMETERS, self.halves, strict=True):
            if half.identity is not None and half.role is None:
                return (
                    f"the board at `{name}` has the id {half.identity}; a Fejemis has 90 (drive)"
                    " and 91 (front): connect the correct board, or set its id"
                )
        first, second = self.halves
        heard = first.heartbeat is not None and second.heartbeat is not None
        if heard and first.role is not None and first.role == second.role:
            missing = "front" if first.role == "drive" else "drive"
            return (
                f"both ports lead to a {first.role} board: connect a {missing} board to one of"
                " these ports, and check `port` and `front_port`"
            )
        return ""

    def line(self, role: Role, *texts: bytes) -> Packets:
        """Return a packet with lines for one board; no packet while its port is unknown."""
        half = self.half(role)
        return NO_PACKETS if half is None else self.at(self.halves.index(half), *texts)

    def ending(self, role: Role, *texts: bytes) -> Packets:
        """Return lines that stop or switch off something on the board with this ``role``.

        While the port of this board is unknown, the lines go to each port whose board is unknown.
        If the driver knows the boards at both ports, the lines go to both ports.
        """
        if self.half(role) is not None:
            return self.line(role, *texts)
        unknown = [channel for channel, half in enumerate(self.halves) if half.role is None]
        return sum((self.at(channel, *texts) for channel in unknown or (0, 1)), NO_PACKETS)

    def both(self, text: bytes) -> Packets:
        """Return the packets that send ``text`` as a line to both boards.

        A line end comes first, so that it ends any incomplete line.
        """
        return tuple(
            (channel, b"\n" + data.lstrip(b"\n"))
            for channel, data in self.at(0, text) + self.at(1, text)
        )

    def at(self, channel: int, *texts: bytes) -> Packets:
        """Return a packet with lines for the board at ``channel``; no packet without ``texts``."""
        data = lines(*texts, sums=self.halves[channel].sums)
        return ((channel, data),) if data else NO_PACKETS
