# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The result of a calibration: values with uncertainties.

This module knows values; it does not know a terminal, files or ROS.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from omnibot_driver.parameters import Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One row of the table of results.

    ``sigma``: standard deviation of ``value``, or None if unknown.

    ``before``: the driver's current value, or None.
    """

    name: str
    value: float | str
    sigma: float | None = None
    unit: str = ""
    before: float | str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The result of a calibration.

    * ``parameters``: values that the driver loads, by name.
    * ``record``: further content of the calibration file, which the driver ignores.
    * ``notes``: sentences for the user.
    * ``draw``: draws the result into a figure of 9 by 6 inches.
    """

    findings: list[Finding]
    parameters: Mapping[str, Value]
    record: Mapping[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    draw: "Callable[[Figure], None]"
