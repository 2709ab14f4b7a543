# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""History of a filter's states, for a restart of the board that is noticed late.

This module works on states and times. It does not know what a state means.
"""

from collections import deque
from typing import Final

from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter

KEPT: Final = 32
"""Number of stored states: more than the groups that can arrive before a restart is noticed."""


class FilterHistory:
    """History of the states of one filter."""

    def __init__(self, estimate: SparseFilter) -> None:
        self._filter = estimate
        self._kept: deque[tuple[float, list[float], list[list[float]]]] = deque(maxlen=KEPT)

    def forget(self) -> None:
        """Discard all stored states, because the odometry frame has changed."""
        self._kept.clear()

    def keep(self, now: float) -> None:
        """Store the filter's present state."""
        covariance = [list(row) for row in self._filter.covariance]
        self._kept.append((now, list(self._filter.mean), covariance))

    def go_back(self, then_s: float) -> float | None:
        """Restore the last stored state from ``then_s`` or earlier, else the oldest one.

        Return the time of the restored state in s. None if no state is stored.
        """
        if not self._kept:
            return None
        while len(self._kept) > 1 and self._kept[-1][0] > then_s:
            self._kept.pop()
        kept_s, self._filter.mean, self._filter.covariance = self._kept.pop()
        return kept_s
