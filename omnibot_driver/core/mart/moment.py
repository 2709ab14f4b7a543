# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The time at which a reply was true, with the uncertainty that the network adds.

This module holds values only.
"""

from dataclasses import dataclass
from typing import Final

UNCERTAIN_S: Final = 0.1
"""Uncertainty in s from which on a reply may answer an earlier question."""


@dataclass(frozen=True, slots=True)
class Moment:
    """The time at which a reply was true.

    ``at_s``: the most probable time; ``from_s``, ``until_s``: the earliest and the latest one.
    ``doubtful``: whether the reply may answer another question.
    """

    at_s: float
    from_s: float
    until_s: float
    doubtful: bool = False

    @property
    def spread_s(self) -> float:
        """Width of the interval that contains the time, in s."""
        return self.until_s - self.from_s

    @property
    def is_uncertain(self) -> bool:
        """Whether the reply may be of an earlier time, or answer another question."""
        return self.doubtful or self.spread_s >= UNCERTAIN_S
