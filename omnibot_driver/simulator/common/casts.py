# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversions of numbers as the simulated boards' processors make them."""

import math


def to_int32(number: float) -> int:
    """Round towards zero, and limit to 32 bits, as an ARM Cortex-M does; NaN becomes 0."""
    if math.isnan(number):
        return 0
    return int(max(-(2.0**31), min(2.0**31 - 1.0, number)))
