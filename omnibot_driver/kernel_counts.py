# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Figures of the Linux kernel: losses of a serial port, and the time a thread waited to run."""

import fcntl
import struct
from pathlib import Path
from typing import Final

TIOCGICOUNT: Final = 0x545D
"""Number of the ioctl request that reads the counts, from asm-generic/ioctls.h. Python's
``termios`` does not have it on every platform."""
_COUNTS: Final = struct.Struct("20i")
_OVERRUN, _BUFFER_OVERRUN = 7, 10
"""Positions of two counts in the kernel's struct ``serial_icounter_struct``: overruns of the
receiver, and of the tty's buffer."""


def overruns(descriptor: int) -> int | None:
    """Return how often the kernel has lost bytes of the port; None if the kernel does not count.

    Pseudo-terminals and sockets have no count.
    """
    try:
        counts = _COUNTS.unpack(fcntl.ioctl(descriptor, TIOCGICOUNT, bytes(_COUNTS.size)))
    except OSError:
        return None
    return int(counts[_OVERRUN] + counts[_BUFFER_OVERRUN])


def waited_s(thread_id: int) -> float | None:
    """Return how long this thread was ready to run but did not run, in s; None if unknown."""
    try:
        words = Path(f"/proc/self/task/{thread_id}/schedstat").read_text().split()
        return int(words[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        return None
