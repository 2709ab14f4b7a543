# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One open serial port or pyserial URL.

Every LinkError says what to do. This module knows ports; it does not know threads or boards.
"""

import contextlib
import fcntl
import io
import os
import select
import socket
import termios
import time
from typing import Final

import serial

from omnibot_driver.core.errors import LinkError, PortInUse
from omnibot_driver.core.packets import Packet, Packets, joined
from omnibot_driver.kernel_counts import overruns
from omnibot_driver.transports import NONE_MISSING, READ_TIMEOUT_S, WRITE_TIMEOUT_S
from omnibot_driver.transports.serial_address import explain, is_in_use

MOST_AT_ONCE: Final = 4096
PEER_OPTIONS: Final = {
    socket.TCP_KEEPIDLE: 1,
    socket.TCP_KEEPINTVL: 1,
    socket.TCP_USER_TIMEOUT: 5000,
}
"""Options of a network socket. If the peer acknowledges nothing for five seconds, neither data nor
keepalive probes, it is regarded as lost."""
PSEUDO_TERMINALS: Final = range(136, 144)
"""Major device numbers of pseudo-terminals in Linux."""


class SerialPort:
    """A ``Transport`` of one channel: an open port, used by this process alone.

    ``parameter``: the parameter that names the port, for messages.
    """

    ends_with_us = False
    missing = NONE_MISSING

    def __init__(self, url: str, baudrate: int, parameter: str = "port") -> None:
        self._url = url
        self._is_terminal = False
        self._peer: socket.socket | None = None
        self._descriptor: int | None = None
        self._arrivals: select.poll | None = None
        try:
            self._serial = serial.serial_for_url(
                url,
                baudrate=baudrate,
                timeout=READ_TIMEOUT_S,
                # Over rfc2217 pyserial cannot limit a write's time; the socket limits it to 5 s.
                write_timeout=None if url.lower().startswith("rfc2217:") else WRITE_TIMEOUT_S,
                exclusive=True,
            )
        except LinkError:
            raise
        except Exception as error:  # pyserial's URL handlers can raise any exception
            kind = PortInUse if is_in_use(error) else LinkError
            raise kind(explain(url, parameter, error)) from error
        try:
            self._settle_in()
        except (OSError, termios.error) as error:
            self.close()
            raise LinkError(explain(url, parameter, error)) from error

    @property
    def descriptors(self) -> tuple[int, ...] | None:
        """Descriptor of the port; None if the port does not have one."""
        return None if self._descriptor is None else (self._descriptor,)

    @property
    def overruns(self) -> int | None:
        """How often the kernel has lost bytes since the opening; None if it does not count this."""
        count = None if self._descriptor is None else overruns(self._descriptor)
        return None if count is None else count - self._overruns_before

    def read(self) -> Packet:
        """Return the received bytes, after waiting up to 0.2 s for the first one."""
        return 0, self._read()

    def _read(self) -> bytes:
        data = b""
        try:
            if self._arrivals is not None:
                return _read_whole(self._serial, self._arrivals)
            data = self._serial.read(1)
            while data and len(data) < MOST_AT_ONCE and (waiting := self._serial.in_waiting):
                data += self._serial.read(waiting)
        except OSError as error:
            if not data:
                raise LinkError(f"lost {self._url} while reading: {error}") from error
        return data  # if the port was lost after these bytes, the next call detects that

    def write(self, packets: Packets) -> None:
        """Write all bytes at once."""
        data = joined(packets)
        try:
            if self._descriptor is None:
                self._serial.write(data)
            else:
                _write_whole(self._descriptor, data)
        except OSError as error:
            self.drop_output()
            raise LinkError(f"lost {self._url} while writing: {error}") from error

    def write_if_room(self, packets: Packets) -> int:
        """Write what the port accepts without waiting; return the number of bytes written."""
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                return os.write(self._descriptor, joined(packets))
        return 0

    def drop_output(self) -> None:
        """Discard the written bytes that are not sent yet."""
        with contextlib.suppress(OSError, termios.error):
            self._serial.reset_output_buffer()

    def interrupt(self) -> None:
        """End a ``read`` that waits in another thread, if this kind of port allows it."""
        cancel = getattr(self._serial, "cancel_read", None)
        if cancel is not None:
            cancel()

    def close(self) -> None:
        """Close the port. A second call does nothing."""
        if self._is_terminal:
            with contextlib.suppress(OSError):
                fcntl.ioctl(self._serial.fileno(), termios.TIOCNXCL)
        self._is_terminal, self._descriptor = False, None
        self._serial.close()
        if self._peer is not None:
            self._peer.close()  # pyserial leaves a socket open whose peer has gone

    def _settle_in(self) -> None:
        with contextlib.suppress(io.UnsupportedOperation):
            self._descriptor = self._serial.fileno()
        descriptor = self._descriptor
        self._overruns_before = overruns(descriptor) or 0 if descriptor is not None else 0
        self._is_terminal = descriptor is not None and os.isatty(descriptor)
        if type(self._serial) is serial.Serial:  # handlers of URLs may process each read
            self._arrivals = select.poll()
            self._arrivals.register(self._serial.fileno(), select.POLLIN)
            self._arrivals.register(self._serial.pipe_abort_read_r or -1, select.POLLIN)
        if descriptor is not None and self._is_terminal:
            attributes = termios.tcgetattr(descriptor)
            # Closing keeps DTR and RTS raised: if the next opening raised them, some boards would
            # restart.
            attributes[2] &= ~termios.HUPCL
            termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
            # A pseudo-terminal would stay exclusive after the death of its user.
            if os.major(os.fstat(descriptor).st_rdev) not in PSEUDO_TERMINALS:
                fcntl.ioctl(descriptor, termios.TIOCEXCL)
        peer = getattr(self._serial, "_socket", None)  # pyserial has no public name for it
        if isinstance(peer, socket.socket):
            self._peer = peer
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in PEER_OPTIONS.items():
                peer.setsockopt(socket.IPPROTO_TCP, option, value)


def _read_whole(port: serial.Serial, arrivals: select.poll) -> bytes:
    """Return up to 4096 available bytes. This takes two system calls; pyserial needs five."""
    for ready, _ in arrivals.poll(1e3 * READ_TIMEOUT_S):
        if ready != port.fd:
            os.read(ready, 1000)  # pyserial's ``cancel_read``
            return b""
        try:
            data = os.read(ready, MOST_AT_ONCE)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("the device was disconnected")
        return data
    return b""


def _write_whole(descriptor: int, data: bytes) -> None:
    """Write all bytes, and sleep while the port accepts none; pyserial would not sleep.

    Raises TimeoutError if bytes remain 0.2 s (``WRITE_TIMEOUT_S``) after the beginning of the
    write.
    """
    until = time.monotonic() + WRITE_TIMEOUT_S
    while True:
        try:
            written = os.write(descriptor, data)
        except BlockingIOError:
            written = 0
        data = data[written:]
        if not data:
            return
        room = select.poll()
        room.register(descriptor, select.POLLOUT)
        if not room.poll(max(0.0, 1e3 * (until - time.monotonic()))):
            raise TimeoutError(f"it has not accepted all data within {WRITE_TIMEOUT_S:g} s")
