# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The messages from one robot, in arrays with one column for each value.

Times are in seconds since the beginning of the log.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COMMAND_TIMEOUT_S: Final = 0.5
"""Time in s after which a command has no effect: the driver's default of ``cmd_vel_timeout``."""
OTHER_CLOCK_S: Final = 1.0
"""Limit, in s, for the median difference between timestamp and arrival of a topic's messages. Up to
this limit, the difference can be a delay. If it is larger, the recorder's clock differs from the
driver's clock."""
SETTLING_S: Final = 0.2
"""For this time in s before and after a change of state, a gap between messages is normal."""


@dataclass(frozen=True, slots=True)
class Series:
    """The messages of one topic in the order of arrival, one row for each message.

    ``arrived_s``: the time of arrival. ``stamp_s``: the timestamp in each message.
    """

    arrived_s: Array
    stamp_s: Array
    values: Array

    def __len__(self) -> int:
        return len(self.arrived_s)

    @property
    def finite(self) -> Mask:
        """For each row, whether it contains neither NaN nor infinity."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    def only(self, rows: Mask | NDArray[np.intp]) -> "Series":
        """Return a series that contains only the selected rows, given by a mask or by indices."""
        return Series(self.arrived_s[rows], self.stamp_s[rows], self.values[rows])

    @property
    def other_clock_s(self) -> float:
        """How far the recorder's clock is ahead of the timestamps' clock, in s.

        A difference of at most 1 s (``OTHER_CLOCK_S``) can be a delay of the messages, and gives 0.
        """
        late_s = (self.arrived_s - self.stamp_s)[np.isfinite(self.stamp_s)]
        ahead_s = float(np.median(late_s)) if len(late_s) else 0.0
        return ahead_s if abs(ahead_s) > OTHER_CLOCK_S else 0.0

    def held(self, at_s: Array, timeout_s: float = COMMAND_TIMEOUT_S) -> Array:
        """Return, for each time in ``at_s``, the last row that had arrived by then.

        The result is a row of zeros if no row had arrived, or if the row was older than
        ``timeout_s``.
        """
        held = np.zeros((len(at_s), self.values.shape[1]))
        if len(self):
            newest = np.searchsorted(self.arrived_s, at_s, "right") - 1
            known = (newest >= 0) & (at_s - self.arrived_s[newest] <= timeout_s)
            held[known] = self.values[newest[known]]
        return held


@dataclass(frozen=True, slots=True)
class Span:
    """A span of time.

    ``what``: the state of the driver or of its e-stop during this time; empty if the span does not
    stand for a state.
    """

    begin_s: float
    end_s: float
    what: str

    @property
    def length_s(self) -> float:
        return self.end_s - self.begin_s


@dataclass(frozen=True, slots=True)
class Status:
    """One status of a /diagnostics message.

    ``level``: the level, as numbered in diagnostic_msgs.
    """

    at_s: float
    hardware_id: str
    name: str
    level: int
    message: str
    values: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """The messages of one robot. All values are in SI units.

    ``start_ns``: Unix time at the beginning, in ns.

    ``imu``: angular velocity and specific force, 6 columns.

    ``odom``: x, y, yaw, and the twist, 6 columns.

    ``joint_states``, ``wheel_cmd``: rates, one column for each name in ``wheels``.

    ``cmd_vel``: the twist, 3 columns.

    ``absent``: topics without a message.

    ``topics``: topics that exist, with or without messages; empty if unknown.

    ``alone``: whether /diagnostics has data of this robot only.
    """

    robot: str
    start_ns: int
    duration_s: float
    imu: Series
    odom: Series
    joint_states: Series
    cmd_vel: Series
    wheel_cmd: Series
    wheels: tuple[str, ...] = ()
    states: tuple[Span, ...] = ()
    estops: tuple[Span, ...] = ()
    diagnostics: tuple[Status, ...] = ()
    absent: tuple[str, ...] = ()
    topics: tuple[str, ...] = ()
    troubles: tuple[str, ...] = ()
    alone: bool = True

    @property
    def two_wheels(self) -> bool:
        """Whether the robot has two driving wheels; False without joint_states.

        With two driving wheels (Fejemis), the report expects an upright IMU; otherwise (OmniBot),
        an IMU that hangs upside down.
        """
        return len(self.wheels) == 2

    @property
    def latched(self) -> list[Span]:
        """The spans of time in which the e-stop was latched."""
        return [span for span in self.estops if span.what == "latched"]

    def within(self, spans: list[Span], at_s: Array) -> Mask:
        """Return, for each time in ``at_s``, whether it lies in one of the ``spans``."""
        inside = np.zeros(len(at_s), dtype=bool)
        for span in spans:
            inside |= (at_s >= span.begin_s) & (at_s < span.end_s)
        return inside

    def interrupted(self, begin_s: float, end_s: float, running: tuple[str, ...]) -> bool:
        """Return whether the driver's state explains why a topic has no messages in this period.

        ``running``: the states in which the driver publishes the topic.
        """
        begin_s, end_s = begin_s - SETTLING_S, end_s + SETTLING_S
        touched = [span for span in self.states if span.begin_s < end_s and span.end_s > begin_s]
        return len(touched) > 1 or any(span.what not in running for span in touched)
