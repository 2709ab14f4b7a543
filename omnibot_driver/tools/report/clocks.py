# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Finds the time during a recording at which a computer's clock stepped (changed suddenly).

A clock steps, for example, if the computer starts with the wrong time and corrects it later.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from omnibot_driver.tools.report.findings import Finding, Level, span
from omnibot_driver.tools.report.log import Log, Series

LEAST_STEP_S: Final = 0.3
"""Smallest lasting change of the least delay, in s, that is regarded as a step of a clock."""
FEWEST: Final = 10
"""Smallest number of messages that must lie on each side of a step of a clock.

With fewer messages on one side, the change of the delay is not regarded as lasting.
"""


@dataclass(frozen=True, slots=True)
class ClockStep:
    """A step (sudden change) of a clock during the recording.

    * ``by_s``: change, at the step, of the messages' delay (arrival time minus timestamp).
    * ``after_s``: time from the first message to the step.
    * ``recorders``: True if the recorder's clock stepped, False if the driver's clock stepped.
    """

    by_s: float
    after_s: float
    recorders: bool


def step(log: Log) -> ClockStep | None:
    """Return the largest step of a clock in the log; None if there is none."""
    found = [one for series in (log.imu, log.odom) if (one := _step(series))]
    return max(found, key=lambda one: abs(one.by_s), default=None)


def _step(series: Series) -> ClockStep | None:
    """Return the largest sudden and lasting change of the messages' delays; None if there is none.

    Only the smallest delays count, because a busy computer increases delays for a time.
    """
    rows = series.only(np.isfinite(series.stamp_s))
    rows = _by_stamp(rows)
    late_s = rows.arrived_s - rows.stamp_s
    edges = np.flatnonzero(np.abs(np.diff(late_s)) > LEAST_STEP_S) + 1
    edges = np.concatenate([[0], edges, [len(rows)]])
    parts = [(a, b) for a, b in pairwise(edges) if b - a >= FEWEST]
    least_s = np.array([late_s[a:b].min() for a, b in parts])
    before_s = np.minimum.accumulate(least_s)[:-1]
    after_s = np.minimum.accumulate(least_s[::-1])[::-1][1:]
    steps_s = after_s - before_s
    if not len(steps_s) or np.abs(steps_s).max() < LEAST_STEP_S:
        return None
    largest = int(np.abs(steps_s).argmax())
    last, first = parts[largest][1] - 1, parts[largest + 1][0]
    waited_s, stamped_s = (
        abs(float(column[first] - column[last])) for column in (rows.arrived_s, rows.stamp_s)
    )
    return ClockStep(
        float(steps_s[largest]), float(rows.stamp_s[last] - rows.stamp_s[0]), waited_s > stamped_s
    )


def by_stamp(log: Log) -> Log:
    """Return the log with IMU and odometry in the order of their timestamps.

    In the order of arrival, messages from before and after a step of the clock may be mixed.
    """
    return replace(log, imu=_by_stamp(log.imu), odom=_by_stamp(log.odom))


def _by_stamp(series: Series) -> Series:
    return series.only(np.argsort(series.stamp_s, kind="stable"))


def judge(found: ClockStep) -> Iterator[Finding]:
    """Report a step of a clock, and what the report cannot say because of the step."""
    forward = (found.by_s > 0.0) is found.recorders
    yield Finding(
        Level.WARN,
        "Recording",
        f"The {'recorder' if found.recorders else 'driver'}'s clock stepped"
        f" {'forward' if forward else 'back'} by {span(abs(found.by_s))}, {found.after_s:.1f} s"
        " after the first message. So the report does not judge delays, and does not compare"
        " commands and e-stops with the motion. Times and durations may be wrong by this step.",
        "Start to record when the computer has set its clock (chronyc waitsync).",
    )
