# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A pipe that ends a thread's wait for arrivals when another thread writes into it.

This module knows one pair of descriptors, but not what the thread waits for.
"""

import contextlib
import os


class WakeUp:
    """A pipe whose ``descriptor`` a thread polls. Raises OSError if a pipe cannot be opened."""

    def __init__(self) -> None:
        self.descriptor, self._far = os.pipe()
        os.set_blocking(self._far, False)

    def ring(self) -> None:
        """Wake the waiting thread, or else end its next wait at once; any thread may call this."""
        with contextlib.suppress(OSError):  # full, so a wake-up is pending; or closed
            os.write(self._far, b"\0")

    def answer(self) -> None:
        """Consume the wake-up, so that the next wait does not end at once."""
        os.read(self.descriptor, 1000)

    def close(self) -> None:
        """Close the pipe. A second call does nothing."""
        for descriptor in (self.descriptor, self._far):
            if descriptor >= 0:
                os.close(descriptor)
        self.descriptor = self._far = -1
