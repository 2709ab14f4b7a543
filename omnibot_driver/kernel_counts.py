# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the kernel counts: bytes that a serial port lost, and how long a thread waited to run.

Linux only; None where it does not count.
"""

import fcntl
import struct
from pathlib import Path
from typing import Final

TIOCGICOUNT: Final = 0x545D
"""Of asm-generic/ioctls.h; the ``termios`` of Python has no name for it everywhere."""
_COUNTS: Final = struct.Struct("20i")
_OVERRUN, _BUFFER_OVERRUN = 7, 10
"""Places in ``serial_icounter_struct``: the receiver was not emptied in time; the tty was not."""


def overruns(descriptor: int) -> int | None:
    """How often bytes were lost behind the line since the port exists.

    A pseudo-terminal and a socket lose none and count none; some USB adapters count none.
    """
    try:
        counts = _COUNTS.unpack(fcntl.ioctl(descriptor, TIOCGICOUNT, bytes(_COUNTS.size)))
    except OSError:
        return None
    return int(counts[_OVERRUN] + counts[_BUFFER_OVERRUN])


def waited_s(thread_id: int) -> float | None:
    """How long this thread of ours was ready to run, and another one ran."""
    try:
        words = Path(f"/proc/self/task/{thread_id}/schedstat").read_text().split()
        return int(words[1]) * 1e-9
    except (OSError, IndexError, ValueError):
        return None
