# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The numbers of the command TIME, and when they may be sent.

TIME sets the server's clock to a full minute. A clock that is set back between two motions makes
the heading wrong. This module knows times only.
"""

import time
from typing import Final

ENDS_S: Final = range(56, 59)
"""Seconds of a minute in which the driver sends TIME with the next minute. So the server's clock is
at most 4 s fast."""


def clock_fields(now_s: float, *, may_set_back: bool) -> tuple[int, ...] | None:
    """Return month, day, year, hour, minute and second (UTC) for TIME, or None if TIME must wait.

    ``now_s``: s since 1970. ``may_set_back``: whether TIME may set back the server's clock.
    """
    ends = time.gmtime(now_s).tm_sec in ENDS_S
    if not (ends or may_set_back):
        return None
    utc = time.gmtime(now_s + 60 - ENDS_S.start if ends else now_s)
    return utc.tm_mon, utc.tm_mday, utc.tm_year, utc.tm_hour, utc.tm_min, utc.tm_sec
