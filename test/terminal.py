"""What tests do to terminals."""

import contextlib
import os
import time


def fill(descriptor: int) -> None:
    """Until the kernel takes no more, not even after moving it from one buffer to the next.

    The descriptor must not block. When the kernel moves it nobody says, hence the pauses.
    """
    taken = 1
    while taken:
        taken = 0
        with contextlib.suppress(BlockingIOError):
            while True:
                taken += os.write(descriptor, b"x")
        time.sleep(0.05)
