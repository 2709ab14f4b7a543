# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The time at which a reply was true, as far as the network lets it be known. Values only."""

from dataclasses import dataclass
from typing import Final

UNCERTAIN_S: Final = 0.1
"""A reply of which no more is known may be one to an earlier question."""


@dataclass(frozen=True, slots=True)
class Moment:
    """``at_s``: probably; ``from_s``, ``until_s``: between these. ``doubtful``: the reply may
    be the answer to another question.
    """

    at_s: float
    from_s: float
    until_s: float
    doubtful: bool = False

    @property
    def spread_s(self) -> float:
        """How uncertain it is."""
        return self.until_s - self.from_s

    @property
    def is_uncertain(self) -> bool:
        """Whether it may be of an earlier time, or another number."""
        return self.doubtful or self.spread_s >= UNCERTAIN_S
