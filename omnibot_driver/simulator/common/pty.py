# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board in real time behind a pseudo-terminal.

Knows descriptors. Must not know what bytes mean.
"""

import array
import fcntl
import os
import select
import termios
import tty
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from omnibot_driver.simulator.common.faults import FaultyLine
from omnibot_driver.simulator.common.running import UNREAD_LIMIT, RunningBoard

if TYPE_CHECKING:
    from omnibot_driver.simulator.omnibot.firmware import SimulatedBoard


class PtyBoard(RunningBoard):
    """Context manager that runs a board at 100 Hz on a new pseudo-terminal, found at `path`.

    The terminal outlives the programs that open it. Bytes that nobody reads are lost like those of
    a UART once the kernel's buffer is full; `dropped` counts them. `link` names a symbolic link to
    be made for the terminal and removed on exit. `line` is what the board's bytes go through first.

    Raises FileExistsError when `link` is taken by anything but a dead link or a link to a
    pseudo-terminal.
    """

    def __init__(
        self, board: "SimulatedBoard", link: str | None = None, line: FaultyLine | None = None
    ) -> None:
        super().__init__(board, line)
        self.path = ""
        self._link = None if link is None else Path(link)

    def __enter__(self) -> Self:
        self._master, self._slave = os.openpty()
        try:
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
            if self._link is not None:
                _make_link(self._link, self.path)
        except BaseException:
            self._close()
            raise
        self.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.stop()
        finally:
            if self._link is not None and _leads_to(self._link, self.path):
                self._link.unlink()
            if not self._thread.is_alive():
                self._close()

    def _close(self) -> None:
        os.close(self._master)
        os.close(self._slave)

    def _receive(self, timeout_s: float) -> bytes:
        readable, _, _ = select.select([self._master], [], [], timeout_s)
        return os.read(self._master, 4096) if readable else b""

    def _send(self, data: bytes) -> int:
        unread = array.array("i", [0])
        fcntl.ioctl(self._slave, termios.FIONREAD, unread)
        room = max(0, UNREAD_LIMIT - unread[0])
        try:
            return os.write(self._master, data[:room]) if room and data else 0
        except BlockingIOError:
            return 0


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink():
        if link.exists() and not os.path.realpath(link).startswith("/dev/pts/"):
            raise FileExistsError(
                f"{link} already leads to {os.path.realpath(link)}, which is no pseudo-terminal; "
                "choose another name for the simulator's link or remove it first"
            )
        link.unlink()
    elif link.exists():
        raise FileExistsError(
            f"{link} exists and is no symbolic link; choose another name for the simulator's link "
            "or remove it first"
        )
    try:
        link.symlink_to(target)
    except OSError as error:
        raise type(error)(
            f"cannot make the link {link} ({error.strerror}): "
            "choose a folder that exists and is yours"
        ) from error


def _leads_to(link: Path, target: str) -> bool:
    return link.is_symlink() and os.readlink(link) == target
