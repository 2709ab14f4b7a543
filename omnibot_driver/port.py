"""One open serial port or pyserial URL: the only module that knows pyserial.

It reads and writes bytes and turns every failure into a LinkError whose sentence says what to do.
It knows no threads and no board.
"""

import errno
import re
import termios
from typing import Final

import serial

from omnibot_driver.core.errors import LinkError

READ_TIMEOUT_S: Final = 0.2
"""How soon a port that cannot be interrupted returns to look whether it is still wanted."""
WRITE_TIMEOUT_S: Final = 0.2
MOST_AT_ONCE: Final = 4096


class Port:
    """An open port, exclusively ours. Raises LinkError when it cannot be opened."""

    def __init__(self, url: str, baudrate: int) -> None:
        self._url = url
        try:
            self._serial = serial.serial_for_url(
                url,
                baudrate=baudrate,
                timeout=READ_TIMEOUT_S,
                # Over rfc2217 pyserial cannot limit a write; there its socket does, to 5 s.
                write_timeout=None if url.startswith("rfc2217:") else WRITE_TIMEOUT_S,
                exclusive=True,
            )
        except Exception as error:  # its URL handlers raise whatever they stumble over
            raise LinkError(_explain(url, error)) from error

    def read(self) -> bytes:
        """All that has come in, waiting for the first byte; nothing after a while without one.

        Raises LinkError when the port is gone.
        """
        data = b""
        try:
            data = self._serial.read(1)
            while data and len(data) < MOST_AT_ONCE and (waiting := self._serial.in_waiting):
                data += self._serial.read(waiting)
        except OSError as error:
            if not data:
                raise LinkError(f"lost {self._url} while reading: {error}") from error
        return data  # what came before the loss; the next call finds it again

    def write(self, data: bytes) -> None:
        """All of it, or LinkError."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise LinkError(f"lost {self._url} while writing: {error}") from error

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread, where the port can do so."""
        cancel = getattr(self._serial, "cancel_read", None)
        if cancel is not None:
            cancel()

    def close(self) -> None:
        """Give the port back; harmless to repeat."""
        self._serial.close()


def _explain(url: str, error: Exception) -> str:
    """What is wrong with this port, and what to do."""
    code = error.errno if isinstance(error, OSError) else None
    # pyserial words some errors anew without their number; where it stumbled is in the context.
    misread = TypeError | ValueError | LookupError | re.error
    if isinstance(error, misread) or isinstance(error.__context__, misread):
        return (
            f"port '{url}' is not understood: give a device like /dev/ttyUSB0"
            " or a pyserial URL like socket://host:port"
        )
    if isinstance(error, termios.error) or isinstance(error.__context__, termios.error):
        return f"{url} is no serial port: `ls /dev/serial/by-id/` shows what is; set `port`"
    if code == errno.ENOENT:
        return (
            f"{url} does not exist: plug the board in, look it up with `ls /dev/serial/by-id/`"
            " and set the parameter `port`"
        )
    if code in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {url}: join the group dialout with"
            " `sudo usermod -aG dialout $USER` and log in again"
        )
    if code in (errno.EAGAIN, errno.EBUSY):
        return (
            f"{url} is in use by another program, perhaps a second driver:"
            f" `fuser {url}` names it; end it first"
        )
    return f"cannot open {url}: {error}; check the parameter `port`"
