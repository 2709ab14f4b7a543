# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated Fejemis on two pseudo-terminals, each of which can be unplugged alone.

This module passes the bytes on, and does not depend on their meaning.
"""

import select
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from batches import InBatches

from omnibot_driver.simulator.common.board import Packet
from omnibot_driver.simulator.common.terminal import Terminal
from omnibot_driver.simulator.fejemis import CHANNELS, SimulatedFejemis

PATIENCE_S: Final = 30.0
STANDS_TICKS: Final = 400
"""Number of the simulated boards' ticks in 0.8 s."""
DRIVE, FRONT = 0, 1


class TwoPorts(InBatches[SimulatedFejemis]):
    """A simulated Fejemis on two pseudo-terminals.

    ``ports``: paths of symbolic links to the terminals, as udev makes them.

    ``heard``: bytes received by each port since it was last plugged in.
    """

    def __init__(self, board: SimulatedFejemis, folder: Path) -> None:
        super().__init__(board)
        self.ports = [str(folder / channel.name) for channel in CHANNELS]
        self.heard = [bytearray(), bytearray()]
        self._terminals: list[Terminal | None] = [None, None]
        self._plugging = threading.Lock()

    def __enter__(self) -> Self:
        for channel in (DRIVE, FRONT):
            self.plug(channel)
        self.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()
        for channel in (DRIVE, FRONT):
            self.unplug(channel)

    def plug(self, channel: int) -> None:
        """Open a new terminal and let the channel's link point to it.

        The new terminal usually has another name than the channel's previous terminal.
        """
        with self._plugging:
            self.heard[channel] = bytearray()
            self._terminals[channel] = Terminal(self.ports[channel])

    def unplug(self, channel: int) -> None:
        """Close the pseudo-terminal of a channel, as if the cable were unplugged.

        The Teensy continues to execute its last command.
        """
        with self._plugging:
            terminal, self._terminals[channel] = self._terminals[channel], None
            if terminal is not None:
                terminal.close()

    def wait_until(self, predicate: Callable[[SimulatedFejemis], object]) -> None:
        """Wait until the predicate holds. Fail after ``PATIENCE_S``."""
        found = self.wait_for(lambda board: bool(predicate(board)), PATIENCE_S)
        assert found, {**self.facts, "last": self.last()}

    def do(self, action: Callable[[SimulatedFejemis], Any]) -> Any:
        """Call ``action`` with the board, between two ticks. Return the result of ``action``."""
        with self.lock:
            return action(self.board)

    def last(self) -> list[list[str]]:
        """Return the last twelve lines that each Teensy has executed: drive first, then front."""
        halves = (self.board.drive, self.board.front)
        return [[obeyed.text for obeyed in list(half.commands)[-12:]] for half in halves]

    def stands_for_good(self) -> None:
        """Wait until both driving wheels have been at rest for 0.8 s.

        The default ``cmd_vel_timeout`` is shorter than this time. So after this time, no earlier
        command can move the robot.
        """
        since: list[int] = []

        def stood(board: SimulatedFejemis) -> bool:
            if not board.standing:
                since.clear()
                return False
            since.append(board.tick)
            return since[-1] - since[0] >= STANDS_TICKS

        self.wait_until(stood)

    def _receive(self, timeout_s: float) -> Iterator[Packet]:
        with self._plugging:
            open_ones = {
                terminal.descriptor: (channel, terminal)
                for channel, terminal in enumerate(self._terminals)
                if terminal is not None
            }
            readable, _, _ = select.select(list(open_ones), [], [], timeout_s)
            found = [
                (channel, data)
                for channel, terminal in map(open_ones.__getitem__, readable)
                for data in terminal.receive()
            ]
        for channel, data in found:
            self.heard[channel] += data
        yield from found

    def _send(self, channel: int, data: bytes) -> int:
        with self._plugging:
            terminal = self._terminals[channel]
            return 0 if terminal is None else terminal.send(data)
