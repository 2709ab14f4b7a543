# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``sim://``: a simulated board inside this process, as a port of pyserial's.

Options come after a question mark: ``sim://?seed=1&imu_only``. The board begins when the port is
opened, and ends with it. This module knows pyserial's interface and no bytes.
"""

import threading
from queue import Empty, SimpleQueue
from typing import Any

from serial.serialutil import PortNotOpenError, SerialBase

from omnibot_driver.core.errors import LinkError
from omnibot_driver.simulator.common.running import UNREAD_LIMIT, RunningBoard
from omnibot_driver.simulator.omnibot.options import OptionError, board_from_url


class InProcessBoard(RunningBoard):
    """A board whose line is memory."""

    def __init__(self, url: str) -> None:
        super().__init__(*board_from_url(url))
        self._inbox: SimpleQueue[bytes] = SimpleQueue()
        self._unread = bytearray()
        self._came = threading.Condition()
        self._cancelled = False

    @property
    def unread(self) -> int:
        """How many bytes wait."""
        return len(self._unread)

    def write(self, data: bytes) -> None:
        """Bytes for the board; it finds them with its next tick at the latest."""
        self._inbox.put(data)

    def read(self, size: int, timeout_s: float | None) -> bytes:
        """So many bytes; fewer when the time is over, or after ``cancel``."""
        with self._came:
            self._came.wait_for(lambda: len(self._unread) >= size or self._cancelled, timeout_s)
            self.check()
            self._cancelled = False
            data = bytes(self._unread[:size])
            del self._unread[:size]
            return data

    def cancel(self) -> None:
        """Have the ``read`` that waits, or else the next one, return at once."""
        with self._came:
            self._cancelled = True
            self._came.notify_all()

    def _receive(self, timeout_s: float) -> bytes:
        try:
            return self._inbox.get(timeout=timeout_s)
        except Empty:
            return b""

    def _send(self, data: bytes) -> int:
        with self._came:
            taken = data[: UNREAD_LIMIT - len(self._unread)]
            self._unread += taken
            self._came.notify_all()
        return len(taken)


class Serial(SerialBase):
    """What pyserial opens for ``sim://``. Speed, parity and control lines are without effect."""

    _board: InProcessBoard | None = None

    def open(self) -> None:
        """Power the board up. Raises LinkError where the URL is wrong."""
        try:
            self._board = InProcessBoard(str(self.port))
        except OptionError as error:
            raise LinkError(
                f"port '{self.port}' is not understood: {error}; the options are those of"
                " `ros2 run omnibot_driver simulator --help`, as in sim://?imu_only&seed=1"
            ) from error
        self._board.start()
        self.is_open = True

    def close(self) -> None:
        """Power the board off; harmless to repeat."""
        board, self._board = self._board, None
        self.is_open = False
        if board is not None:
            board.cancel()
            board.stop()

    @property
    def in_waiting(self) -> int:
        """How many bytes ``read`` has at hand."""
        return self._opened.unread

    def read(self, size: int = 1, /) -> bytes:
        """So many bytes; fewer when the time is over."""
        return self._opened.read(size, self.timeout)

    def write(self, data: Any, /) -> int:
        """All of it, at once."""
        self._opened.write(bytes(data))
        return len(data)

    def cancel_read(self) -> None:
        """End a ``read`` that waits in another thread."""
        self._opened.cancel()

    def reset_output_buffer(self) -> None:
        """Nothing waits to be sent."""

    @property
    def _opened(self) -> InProcessBoard:
        if self._board is None:
            raise PortNotOpenError
        return self._board

    def _reconfigure_port(self) -> None:
        pass
