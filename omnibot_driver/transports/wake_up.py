# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What ends a wait for arrivals: a pipe that another thread writes into.

Knows one pair of descriptors; not what is waited for.
"""

import contextlib
import os


class WakeUp:
    """``descriptor`` is to be waited for beside the others. Raises OSError where none is left."""

    def __init__(self) -> None:
        self.descriptor, self._far = os.pipe()
        os.set_blocking(self._far, False)

    def ring(self) -> None:
        """Wake who waits, or else who waits next; from any thread."""
        with contextlib.suppress(OSError):  # full: it rings already; or closed
            os.write(self._far, b"\0")

    def answer(self) -> None:
        """Note that the wake-up was received."""
        os.read(self.descriptor, 1000)

    def close(self) -> None:
        """Close it. A second call does nothing."""
        for descriptor in (self.descriptor, self._far):
            if descriptor >= 0:
                os.close(descriptor)
        self.descriptor = self._far = -1
