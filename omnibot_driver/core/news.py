"""What happens often is counted, and told seldom. Knows counts and times."""

import math
from typing import Final

NEWS_S: Final = 10.0
"""Nothing is told more often than this."""


class News:
    """What a count has grown by since that was last told."""

    def __init__(self) -> None:
        self._told = 0
        self._told_at = -math.inf

    def since_told(self, count: int, now: float) -> int:
        """0 while there is nothing new, or something was told just before."""
        if count == self._told or now - self._told_at < NEWS_S:
            return 0
        new, self._told, self._told_at = count - self._told, count, now
        return new
