# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Plausibility of a complete report: its values, and their change since the last report.

Two successive reports that fit each other, but not the last accepted report, show a restart or a
reset of the board. This module works on values and arrival times.
"""

import math
from collections.abc import Callable
from typing import Final, Generic, Literal, TypeVar

from omnibot_driver.core.lois_ecu.messages import BoardOdometry, GpsPosition, Ticks

# A limit of a count consists of turns of the wheel and of ticks. Its ticks allow for the counts'
# rounding, which matters with few ticks per turn.
FASTEST_TURNS_PER_S: Final = 5.0
"""Largest plausible speed of a wheel. The firmware's highest speed is a sixth of this."""
TURNS_MARGIN: Final = 0.45
TICKS_MARGIN: Final = 3
FASTEST_MPS: Final = 5.0
FASTEST_RADPS: Final = 20.0
POSE_MARGIN_M: Final = 0.5
POSE_MARGIN_RAD: Final = 1.0
FARTHEST: Final = 1e5
"""Largest position in m, and largest yaw in rad, that a robot can reach on one battery charge."""
LATEST_S: Final = 0.3
"""Longest plausible time in s from the sending of a report to its arrival."""
SLOWEST_CLOCK: Final = 0.5
"""Lowest plausible rate of the board's clock, as a fraction of real time. The rate can be below 1,
because the clock of the public firmware stops while the board sends."""
SURE_AFTER: Final = 2
"""Number of pairs of tick reports that must confirm the unit of the board's clock, after a first
pair has shown it. Until then, the unit is unknown."""
LEARNT_FROM_S: Final = 0.15
"""Shortest time in s between two tick reports from which the unit of the board's clock is inferred.
Over a shorter time, the errors of the arrival times are too large."""
ROLLED_OUT_TURNS: Final = 0.15
ROLLED_OUT_TICKS: Final = 1
STARTING_TURNS_PER_S: Final = 1 / 3
"""Terms of a limit for a wheel's count, which starts at zero. At ``age`` s after a restart of the
board, the count is at most ``ROLLED_OUT_TURNS + STARTING_TURNS_PER_S * age`` turns, plus
``ROLLED_OUT_TICKS`` ticks."""

ClockUnit = Literal["ms", "ns"]

_WRAP: Final = 1 << 32
_HALF: Final = 1 << 31

Group = TypeVar("Group")


def wrapped(difference: int) -> int:
    """Return the difference of two 32-bit counters as a signed number, -2³¹..2³¹-1."""
    return (difference + _HALF) % _WRAP - _HALF


def began_within(duration_s: float, ticks: Ticks, ticks_per_revolution: int) -> bool:
    """Return whether the board may have restarted in the last ``duration_s``.

    A restart sets the board's clock (in ns) and its tick counts to zero.
    """
    age_s = ticks.time_counts * 1e-9
    most = ROLLED_OUT_TURNS * ticks_per_revolution + ROLLED_OUT_TICKS
    most += STARTING_TURNS_PER_S * ticks_per_revolution * age_s
    return age_s <= duration_s and max(abs(ticks.left), abs(ticks.right)) <= most


class Gate(Generic[Group]):
    """Check of each report against the last accepted report of the same kind.

    ``reachable(before, after, duration_s)``: whether the report ``after`` is possible
    ``duration_s`` after the report ``before``.
    """

    def __init__(self, reachable: Callable[[Group, Group, float], bool]) -> None:
        self._reachable = reachable
        self._last: tuple[Group, float] | None = None
        self._aside: tuple[Group, float] | None = None

    def passes(self, group: Group, now: float) -> bool:
        """Return whether to accept the report ``group``. Store the report to check the next one."""
        aside = self._aside
        if self._last is not None and not self.would_pass(group, now):
            if aside is None or not self._reachable(aside[0], group, now - aside[1]):
                self._aside = group, now
                return False
            self._begins_anew()
        self._last, self._aside = (group, now), None
        return True

    def would_pass(self, group: Group, now: float) -> bool:
        """Return whether the report can follow the last accepted report. Nothing is stored."""
        last = self._last
        return last is not None and self._reachable(last[0], group, now - last[1])

    def forget(self) -> None:
        """Forget the last reports. The next report is then accepted without a check."""
        self._last = self._aside = None
        self._begins_anew()

    def _begins_anew(self) -> None:
        """Forget what a subclass has inferred from reports before a restart or a reset."""


class TicksGate(Gate[Ticks]):
    """Check of the reports of encoder ticks.

    * ``ticks_per_revolution``: may be replaced at any time.
    * ``too_fast``: number of reports in a row that were rejected for an impossible speed, although
      their clock is plausible.
    """

    def __init__(self, ticks_per_revolution: int) -> None:
        super().__init__(self._follow)
        self.ticks_per_revolution = ticks_per_revolution
        self.too_fast = 0
        self._fits: ClockUnit | None = None
        self._steps = 0

    def passes(self, group: Ticks, now: float) -> bool:
        """Return whether to accept these ticks.

        Store them, and infer the unit of the board's clock.
        """
        last = self._last
        passed = super().passes(group, now)
        if passed:
            self.too_fast = 0
        elif last is not None and last[0].time_counts != group.time_counts:
            self.too_fast += _unit_of(last[0], group, now - last[1]) is not None
        if passed and last is not None and now - last[1] > LEARNT_FROM_S:
            fits = _unit_of(last[0], group, now - last[1])
            self._steps = min(self._steps + 1, SURE_AFTER) if fits == self._fits else 0
            self._fits = fits
        return passed

    def would_pass(self, group: Ticks, now: float) -> bool:
        """Return whether the ticks can follow the last accepted ones. Nothing is stored."""
        last, unit = self._last, self.unit
        return super().would_pass(group, now) and (
            last is None
            or unit is None
            or now - last[1] <= LEARNT_FROM_S
            or _unit_of(last[0], group, now - last[1]) == unit
        )

    @property
    def unit(self) -> ClockUnit | None:
        """Unit of the board's clock; None while unknown."""
        return self._fits if self._steps >= SURE_AFTER else None

    def _begins_anew(self) -> None:
        self._fits, self._steps = None, 0

    def _follow(self, before: Ticks, after: Ticks, duration_s: float) -> bool:
        per_turn = self.ticks_per_revolution
        most = FASTEST_TURNS_PER_S * per_turn * duration_s
        most += TURNS_MARGIN * per_turn + TICKS_MARGIN
        return (
            before.time_counts != after.time_counts
            and abs(wrapped(after.left - before.left)) <= most
            and abs(wrapped(after.right - before.right)) <= most
        )


def _unit_of(before: Ticks, after: Ticks, duration_s: float) -> ClockUnit | None:
    step = after.time_counts - before.time_counts
    slowest_s = SLOWEST_CLOCK * (duration_s - LATEST_S)
    if slowest_s <= step % _WRAP / 1e3 <= 1.05 * (duration_s + LATEST_S):
        return "ms"
    if abs(wrapped(step - round(duration_s * 1e9))) <= LATEST_S * 1e9:
        return "ns"
    return None


def odometry_gate() -> Gate[BoardOdometry]:
    """Return a gate that checks the pose in the board's odometry, but not the velocities."""
    return Gate(_odometry_follows)


def _odometry_follows(before: BoardOdometry, after: BoardOdometry, duration_s: float) -> bool:
    way_m = math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
    return (
        way_m <= FASTEST_MPS * duration_s + POSE_MARGIN_M
        and abs(after.yaw_rad - before.yaw_rad) <= FASTEST_RADPS * duration_s + POSE_MARGIN_RAD
    )


def in_range(group: Ticks | BoardOdometry | GpsPosition) -> bool:
    """Return whether the position in a report is finite and in range.

    The result for a report of ticks is True, because it has no position. Velocities are not
    checked.
    """
    match group:
        case GpsPosition(latitude, longitude):
            return abs(latitude) <= 90.0 and abs(longitude) <= 180.0
        case BoardOdometry(x_m, y_m, yaw_rad):
            return all(abs(number) <= FARTHEST for number in (x_m, y_m, yaw_rad))
    return True
