# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A pseudo-terminal that carries a serial channel of a simulated board.

This module knows file descriptors. It must not know what the bytes mean.
"""

import array
import fcntl
import os
import termios
import tty
from pathlib import Path

from omnibot_driver.simulator.common.running import UNREAD_LIMIT


class Terminal:
    """A new pseudo-terminal. The driver opens ``address``, the simulator uses ``descriptor``.

    ``link``: path of a symbolic link to make. It replaces only a dead link or a link to a
    pseudo-terminal. Raises OSError if the link cannot be made.
    """

    def __init__(self, link: str | Path | None = None) -> None:
        self._link = None if link is None else Path(link)
        self.descriptor, self._near = os.openpty()
        try:
            tty.setraw(self._near)
            os.set_blocking(self.descriptor, False)
            self.address = os.ttyname(self._near)
            self.name = self.address if self._link is None else str(self._link)
            if self._link is not None:
                _make_link(self._link, self.address)
        except BaseException:
            self._close_descriptors()
            raise

    def receive(self) -> list[bytes]:
        """Return the bytes received. Call this only when ``descriptor`` is readable."""
        return [os.read(self.descriptor, 4096)]

    def send(self, data: bytes) -> int:
        """Send bytes to the driver; return how many were accepted."""
        unread = array.array("i", [0])
        fcntl.ioctl(self._near, termios.FIONREAD, unread)
        room = max(0, UNREAD_LIMIT - unread[0])
        try:
            return os.write(self.descriptor, data[:room]) if room and data else 0
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Remove the link, if it still leads to this terminal, and close the terminal."""
        if self._link is not None and _leads_to(self._link, self.address):
            self._link.unlink()
        self._close_descriptors()

    def _close_descriptors(self) -> None:
        os.close(self.descriptor)
        os.close(self._near)


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink():
        if link.exists() and not os.path.realpath(link).startswith("/dev/pts/"):
            raise FileExistsError(
                f"{link} already leads to {os.path.realpath(link)}, which is not a"
                f" pseudo-terminal; remove {link}, or choose another name for the simulator's link"
            )
        link.unlink()
    elif link.exists():
        raise FileExistsError(
            f"{link} exists and is not a symbolic link; remove {link}, or choose another name for"
            " the simulator's link"
        )
    try:
        link.symlink_to(target)
    except OSError as error:
        raise type(error)(
            f"cannot make the link {link} ({error.strerror}): "
            "choose a folder that exists and that you may write to"
        ) from error


def _leads_to(link: Path, target: str) -> bool:
    return link.is_symlink() and os.readlink(link) == target
