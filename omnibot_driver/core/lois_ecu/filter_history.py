# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""History of the states of a filter.

After a late detection of a restart, the filter returns to its state before the restart.
"""

from collections import deque
from typing import Final

from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter

KEPT: Final = 32
"""Number of stored states, one for each report. It is larger than the number of reports that can
arrive between a restart of the board and its detection."""


class FilterHistory:
    """History of the states of a single filter."""

    def __init__(self, estimate: SparseFilter) -> None:
        self._filter = estimate
        self._kept: deque[tuple[float, list[float], list[list[float]]]] = deque(maxlen=KEPT)

    def forget(self) -> None:
        """Discard all stored states. They are in an odometry frame that is not valid any more."""
        self._kept.clear()

    def keep(self, now: float) -> None:
        """Store the filter's current state."""
        covariance = [list(row) for row in self._filter.covariance]
        self._kept.append((now, list(self._filter.mean), covariance))

    def go_back(self, then_s: float) -> float | None:
        """Restore the last state stored at ``then_s`` or earlier, or else the oldest state.

        Return the time in s of this state; None if no state is stored.
        """
        if not self._kept:
            return None
        while len(self._kept) > 1 and self._kept[-1][0] > then_s:
            self._kept.pop()
        kept_s, self._filter.mean, self._filter.covariance = self._kept.pop()
        return kept_s
