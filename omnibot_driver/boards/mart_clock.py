# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Decides when the command TIME may set the controller's clock.

TIME sets the clock to a full minute, and ignores the seconds, so it can set the clock back. If this
happens between two motions, the controller computes a wrong heading.
"""

import time
from typing import Final

ENDS_S: Final = range(56, 59)
"""Seconds of a minute, 56 to 58, in which the driver sends TIME with the next full minute.

The controller's clock is then up to 4 s fast.
"""


def clock_fields(now_s: float, *, may_set_back: bool) -> tuple[int, ...] | None:
    """Return the six UTC fields of the command TIME, or None.

    ``now_s``: present time in s since 1970.

    ``may_set_back``: whether TIME may set the clock back. If not, TIME is allowed only in the
    seconds ``ENDS_S`` of a minute, with the next full minute; at other times, the result is None.
    """
    ends = time.gmtime(now_s).tm_sec in ENDS_S
    if not (ends or may_set_back):
        return None
    utc = time.gmtime(now_s + 60 - ENDS_S.start if ends else now_s)
    return utc.tm_mon, utc.tm_mday, utc.tm_year, utc.tm_hour, utc.tm_min, utc.tm_sec
