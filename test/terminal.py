# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pseudo-terminals that a test fills and reads, without a program at the other end."""

import contextlib
import os
import select
import time
import tty

PATIENCE_S = 60.0


def fill(descriptor: int, words: bytes = b"x", *, full_s: float = 0.2) -> None:
    """Write ``words`` again and again until the descriptor has accepted nothing for ``full_s``.

    The descriptor must not block. After a refused write, the descriptor may accept more data,
    because the kernel still moves earlier data.
    """
    taken, full = 0, 0
    while full < 100 * full_s:
        full += 1
        with contextlib.suppress(BlockingIOError):
            while True:
                taken += os.write(descriptor, words[taken % len(words) :])
                full = 0
        time.sleep(0.01)  # no event says that the kernel has moved data


class Terminal:
    """A pseudo-terminal without a reader at the other end."""

    def __init__(self) -> None:
        self.far, self._near = os.openpty()
        tty.setraw(self._near)
        os.set_blocking(self._near, False)
        os.set_blocking(self.far, False)
        self.path = os.ttyname(self._near)

    def fill(self) -> None:
        fill(self._near)

    def read_until(self, words: bytes) -> bytes:
        """Read until ``words`` has arrived, and return all that was read."""
        heard, end = b"", time.monotonic() + PATIENCE_S
        while words not in heard:
            assert select.select([self.far], [], [], end - time.monotonic())[0], heard
            heard += os.read(self.far, 4096)
        return heard

    def close(self) -> None:
        os.close(self.far)
        os.close(self._near)
