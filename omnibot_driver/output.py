# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Standard output and standard error that never block the process.

After ctrl-S on the terminal, a blocked log line would stop all Python threads. So output passes
through a pipe, and is lost if the pipe is full. This module does not know what is printed.
"""

import contextlib
import os
import select
import sys
import threading
from types import TracebackType
from typing import Final, Self

STANDARD: Final = (1, 2)
LAST_WORDS_S: Final = 0.5
CHUNK_BYTES: Final = 4096


class UnblockedOutput:
    """A context in which writes to standard output and standard error never block."""

    def __enter__(self) -> Self:
        fill_gaps()
        if os.isatty(2):
            os.environ.setdefault("RCUTILS_COLORIZED_OUTPUT", "1")  # rcutils sees no terminal
        self._originals = [os.dup(descriptor) for descriptor in STANDARD]
        self._copiers = [
            threading.Thread(target=_copy, args=(_redirect(descriptor), original), daemon=True)
            for descriptor, original in zip(STANDARD, self._originals, strict=True)
        ]
        for copier in self._copiers:
            copier.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if sys.stdout is not None:  # a closed output is None
            with contextlib.suppress(BlockingIOError):
                sys.stdout.flush()
        nothing = os.open(os.devnull, os.O_WRONLY)
        for descriptor in STANDARD:
            os.dup2(nothing, descriptor)  # closes the pipe's last writing end
        os.close(nothing)
        for descriptor, copier, original in zip(
            STANDARD, self._copiers, self._originals, strict=True
        ):
            copier.join(LAST_WORDS_S)
            if copier.is_alive():
                continue
            if select.select([], [original], [], 0)[1]:  # else Python's own last output would block
                os.dup2(original, descriptor)
            os.close(original)


def fill_gaps() -> None:
    """Open /dev/null on each of the descriptors 0 to 2 that is closed.

    Otherwise the serial port might get the descriptor of standard output, and receive the log.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= max(STANDARD):
        pass
    os.close(descriptor)


def _redirect(descriptor: int) -> int:
    """Replace this descriptor with the writing end of a new pipe, and return the reading end."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    os.dup2(writing, descriptor)
    os.close(writing)
    return reading


def _copy(reading: int, writing: int) -> None:
    with open(reading, "rb", buffering=0) as source:
        while data := source.read(CHUNK_BYTES):
            with contextlib.suppress(OSError):  # a full disk may have room later
                while data:
                    data = data[os.write(writing, data) :]
