# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What tests do to terminals."""

import contextlib
import os
import time


def fill(descriptor: int, words: bytes = b"x") -> None:
    """With these, until the kernel takes no more, not even after moving it to the next buffer.

    The descriptor must not block. When the kernel moves it nobody says, hence the pauses.
    """
    taken, full = 0, 0
    while full < 5:
        full += 1
        with contextlib.suppress(BlockingIOError):
            while True:
                taken += os.write(descriptor, words[taken % len(words) :])
                full = 0
        time.sleep(0.01)
