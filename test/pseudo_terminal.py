# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A program on its own terminal of 80x24: the test types keys and reads the program's screen."""

import contextlib
import fcntl
import os
import select
import struct
import subprocess
import termios
import threading
from collections.abc import Iterator, Sequence
from typing import Self

PATIENCE_S = 60.0


class PseudoTerminal:
    """A terminal on which a program runs. The program is killed at the end of the context."""

    def __init__(self, command: Sequence[str]) -> None:
        self._far, near = os.openpty()
        fcntl.ioctl(near, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            command,
            stdin=near,
            stdout=near,
            stderr=near,
            env={**os.environ, "TERM": "xterm-256color"},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(near)
        self._drawn = b""
        self._changed = threading.Condition()
        self._hung_up = threading.Event()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self.hang_up()

    def hang_up(self) -> None:
        """Close the terminal, as if the user closed its window."""
        self._hung_up.set()
        self._reader.join()

    def type(self, keys: str) -> None:
        """Send keys as if they were pressed one after the other.

        A surrogate escape such as "\\udce4" is sent as one byte that is not UTF-8.
        """
        with self._changed:
            os.write(self._far, keys.encode(errors="surrogateescape"))

    @contextlib.contextmanager
    def holding(self, key: str) -> Iterator[None]:
        """Repeat a key every 0.1 s while the context lasts, or until the terminal is closed."""
        released = threading.Event()

        def repeat() -> None:
            with contextlib.suppress(OSError):  # the terminal is closed
                while not released.wait(0.1):
                    self.type(key)

        keyboard = threading.Thread(target=repeat)
        keyboard.start()
        try:
            yield
        finally:
            released.set()
            keyboard.join()

    def wait_for(self, text: str) -> None:
        """Wait until the program shows ``text``.

        The search begins after the text that the previous call found.
        """
        with self._changed:
            found = self._changed.wait_for(lambda: text.encode() in self._drawn, PATIENCE_S)
            assert found, f"{text!r} is not in {self._drawn[-2000:]!r}"
            self._drawn = self._drawn.partition(text.encode())[2]

    def end(self) -> int:
        """Wait until the program ends, and return its exit code."""
        return self.process.wait(PATIENCE_S)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the program has closed its end
            while not self._hung_up.is_set():
                if not select.select([self._far], [], [], 0.05)[0]:
                    continue
                data = os.read(self._far, 65536)
                with self._changed:
                    self._drawn += data
                    self._changed.notify_all()
        with self._changed:
            os.close(self._far)
            self._far = -1
