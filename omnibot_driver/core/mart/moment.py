# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The time at which the value in a reply was measured, and the uncertainty of this time.

This module holds values only.
"""

from dataclasses import dataclass
from typing import Final

UNCERTAIN_S: Final = 0.1
"""Limit in s for ``Moment.spread_s``. If the spread is at least as large as this limit, the time is
regarded as uncertain."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The time at which the value in a reply was measured.

    ``at_s``: the most probable time.

    ``from_s``, ``until_s``: the earliest and the latest possible time.

    ``doubtful``: the reply may answer an earlier query.
    """

    at_s: float
    from_s: float
    until_s: float
    doubtful: bool = False

    @property
    def spread_s(self) -> float:
        """Time in s from the earliest to the latest possible time of the measurement."""
        return self.until_s - self.from_s

    @property
    def is_uncertain(self) -> bool:
        """Whether the time of the value is uncertain, or the reply may answer an earlier query."""
        return self.doubtful or self.spread_s >= UNCERTAIN_S
