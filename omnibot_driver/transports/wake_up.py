# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A pipe with which one thread ends the wait of another thread.

This module knows one pair of descriptors; it does not know what the thread waits for.
"""

import contextlib
import os


class WakeUp:
    """A pipe. One thread waits for its ``descriptor``, and other threads can end this wait.

    Raises OSError if a pipe cannot be opened.
    """

    def __init__(self) -> None:
        self.descriptor, self._far = os.pipe()
        os.set_blocking(self._far, False)

    def ring(self) -> None:
        """Wake the waiting thread. If no thread waits, the next wait ends at once.

        Any thread may call this method.
        """
        with contextlib.suppress(OSError):  # full, so a wake-up is pending; or closed
            os.write(self._far, b"\0")

    def answer(self) -> None:
        """Remove the wake-up from the pipe. Otherwise the next wait would end at once, too."""
        os.read(self.descriptor, 1000)

    def close(self) -> None:
        """Close the pipe. A second call does nothing."""
        for descriptor in (self.descriptor, self._far):
            if descriptor >= 0:
                os.close(descriptor)
        self.descriptor = self._far = -1
