# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The messages received from one robot, as columns. Times are seconds since the log began."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COMMAND_TIMEOUT_S: Final = 0.5
"""The driver's default of ``cmd_vel_timeout``, in s; an older command has no effect."""
SETTLING_S: Final = 0.2
"""Time before and after a change of state, in s, in which a gap in a stream is normal."""


@dataclass(frozen=True, slots=True)
class Series:
    """The messages of one topic in the order of arrival, one row for each message.

    ``arrived_s``: times of arrival; ``stamp_s``: timestamps; ``values``: the values.
    """

    arrived_s: Array
    stamp_s: Array
    values: Array

    def __len__(self) -> int:
        return len(self.arrived_s)

    @property
    def finite(self) -> Mask:
        """Mask of the rows without NaN and infinity."""
        return np.asarray(np.isfinite(self.values).all(axis=1))

    def only(self, rows: Mask) -> "Series":
        """Return the series with the selected rows only."""
        return Series(self.arrived_s[rows], self.stamp_s[rows], self.values[rows])

    def held(self, at_s: Array, timeout_s: float = COMMAND_TIMEOUT_S) -> Array:
        """Return the newest row at each of these times.

        A row that is older than the timeout is replaced by zeros.
        """
        held = np.zeros((len(at_s), self.values.shape[1]))
        if len(self):
            newest = np.searchsorted(self.arrived_s, at_s, "right") - 1
            known = (newest >= 0) & (at_s - self.arrived_s[newest] <= timeout_s)
            held[known] = self.values[newest[known]]
        return held


@dataclass(frozen=True, slots=True)
class Span:
    """A span of time from ``begin_s`` to ``end_s``, and the state ``what`` during this time.

    ``what`` is empty if the span is not that of a state.
    """

    begin_s: float
    end_s: float
    what: str

    @property
    def length_s(self) -> float:
        return self.end_s - self.begin_s


@dataclass(frozen=True, slots=True)
class Status:
    """One status of a /diagnostics message; ``level`` has the values of diagnostic_msgs."""

    at_s: float
    hardware_id: str
    name: str
    level: int
    message: str
    values: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """The messages of one robot; ``start_ns``: the time of day at which the log began.

    ``troubles``: what could not be read. ``alone``: whether this is the only robot, so that all of
    the shared /diagnostics are this robot's.

    Values, in SI units: ``imu`` angular velocity and specific force (6); ``odom`` x, y, yaw, and
    the twist (6); ``joint_states`` and ``wheel_cmd`` rates of the ``wheels``, which are names of
    joints; ``cmd_vel`` the twist (3).
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
    troubles: tuple[str, ...] = ()
    alone: bool = True

    @property
    def latched(self) -> list[Span]:
        """Spans in which the e-stop was latched."""
        return [span for span in self.estops if span.what == "latched"]

    def within(self, spans: list[Span], at_s: Array) -> Mask:
        """Return which of these times lie in a span."""
        inside = np.zeros(len(at_s), dtype=bool)
        for span in spans:
            inside |= (at_s >= span.begin_s) & (at_s < span.end_s)
        return inside

    def interrupted(self, begin_s: float, end_s: float, running: tuple[str, ...]) -> bool:
        """Whether the driver's state explains a gap in a stream from ``begin_s`` to ``end_s``.

        ``running``: states in which the driver publishes the stream.
        """
        begin_s, end_s = begin_s - SETTLING_S, end_s + SETTLING_S
        touched = [span for span in self.states if span.begin_s < end_s and span.end_s > begin_s]
        return len(touched) > 1 or any(span.what not in running for span in touched)
