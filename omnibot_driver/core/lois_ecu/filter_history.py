# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How a filter was some groups ago, for what turns out to have ended before it was noticed.

Knows states and times; not what they mean.
"""

from collections import deque
from typing import Final

from omnibot_driver.core.lois_ecu.sparse_filter import SparseFilter

KEPT: Final = 32
"""Groups that may come until a restart is noticed."""


class FilterHistory:
    """Of one filter."""

    def __init__(self, estimate: SparseFilter) -> None:
        self._filter = estimate
        self._kept: deque[tuple[float, list[float], list[list[float]]]] = deque(maxlen=KEPT)

    def forget(self) -> None:
        """What was remembered is in another frame."""
        self._kept.clear()

    def keep(self, now: float) -> None:
        """Remember how it is now."""
        covariance = [list(row) for row in self._filter.covariance]
        self._kept.append((now, list(self._filter.mean), covariance))

    def go_back(self, then_s: float) -> float | None:
        """The filter as it was last before then, or at first. When that was; None: never kept."""
        if not self._kept:
            return None
        while len(self._kept) > 1 and self._kept[-1][0] > then_s:
            self._kept.pop()
        kept_s, self._filter.mean, self._filter.covariance = self._kept.pop()
        return kept_s
