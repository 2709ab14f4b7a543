# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Assembly of reports from groups of lines: a marker line, then lines with values.

``record_lines`` assembles records. This module works on lines and arrival times.
"""

import math
from operator import eq
from typing import Final

from omnibot_driver.core.lois_ecu.codec import single_report
from omnibot_driver.core.lois_ecu.lines import MARKER, Line, to_float
from omnibot_driver.core.lois_ecu.messages import (
    BoardOdometry,
    Code,
    GpsPosition,
    RecordKind,
    Report,
    Ticks,
)
from omnibot_driver.core.lois_ecu.plausibility import (
    Gate,
    TicksGate,
    in_range,
    odometry_gate,
    wrapped,
)
from omnibot_driver.core.lois_ecu.record_lines import (
    RECORD_CODES,
    GroupStatistics,
    RecordAssembler,
)

QUIET_S: Final = 0.05
"""Silence in s after which a group ends if it has as many lines as a complete report. The board
sends the lines of a group 1.2 ms apart.
"""
LATE_S: Final = 0.15
LATE_PART: Final = 0.75
"""Longest allowed time between two lines of a group, as a fraction of the group's period.

The allowed time is at least ``QUIET_S``, and at most ``LATE_S``.
"""

# Numbers of lines after the marker line. The public firmware sends odometry (6 lines) with the
# command byte of the ticks (3 lines).
_LENGTHS: Final = {
    Code.GPS_POSITION: (2,),
    Code.TICKS: (3, 6),
    Code.ODOMETRY: (6,),
}
_LONGEST: Final = 10

GroupReport = Ticks | BoardOdometry | GpsPosition
Timed = tuple[float, Report]
"""Arrival time of a report's last line in s, and the report."""


class Assembler:
    """Assembler of reports from lines.

    Call ``add`` for each line, ``damage`` for characters that form no line, and ``rest`` at times
    when no line has arrived.
    """

    def __init__(self, statistics: GroupStatistics, ticks_gate: TicksGate) -> None:
        self.statistics = statistics
        self._ticks_gate = ticks_gate
        self._odometry_gates: dict[bool, Gate[BoardOdometry]] = {
            False: odometry_gate(),
            True: odometry_gate(),
        }
        self._record = RecordAssembler(statistics)
        self._code: int | None = None
        self._payloads: list[int] = []
        self._done = False
        self._begun_at: dict[int, float] = {}
        """Arrival time of the last marker line, by command byte."""
        self._late_s: dict[int, float] = {}
        """Longest allowed time between two lines of a group, in s, by command byte."""
        self._astray = False
        self._after_ticks = False
        self._appends = True
        """Whether the board probably sends odometry directly after its ticks."""
        self._at = -math.inf

    @property
    def resolves_at(self) -> float:
        """Time in s at which the held group of lines is returned if no further line comes.

        Infinity if no group is held, or if further lines must come to complete the group.
        """
        return self._at + QUIET_S if self._may_be_complete() else math.inf

    @property
    def in_record(self) -> bool:
        """Whether lines of a record are arriving."""
        return self._record.begun

    def expect_record(self, kind: RecordKind, left: int, right: int = 0) -> None:
        """Expect a record with ``left`` and ``right`` samples, and discard all other records."""
        self._record.expect(kind, left, right)

    def forget(self) -> None:
        """Forget the last counts and poses, because a reset may have cleared them."""
        self._ticks_gate.forget()
        for gate in self._odometry_gates.values():
            gate.forget()

    def add(self, line: Line, now: float) -> list[Timed]:
        """Return the reports that ``line`` completes."""
        code, payload = line.command, line.payload
        if code in _LENGTHS:
            found = self._cut_off(now)
            # If the time before the line is too long, the line may belong to the next group.
            late = now - self._at > self._late_s.get(code, LATE_S)
            found += self._end(now) if late else []
            if payload == MARKER and not self._may_be_minus_one(code):
                found += self._end(now)
                self._begin(code, now)
                return found
            return found + self._value(code, payload, now)
        found = self._end(now)
        if code in RECORD_CODES:
            return found + [(now, record) for record in self._record.add(code, payload)]
        found += self._cut_off(now)
        self._astray = self._after_ticks = False
        report = single_report(line)
        if report is None:
            self.statistics.unknown_lines += 1
            return found
        return [*found, (now, report)]

    def damage(self) -> None:
        """Record that characters were received that do not form a line."""
        if self._code is not None and not self._done:
            self._drop()
        self._record.damage()

    def rest(self, now: float) -> list[Timed]:
        """Return the held group if it may be complete and no line has come for ``QUIET_S``."""
        return self._end(now) if now >= self.resolves_at else []

    def finish(self, now: float) -> list[Timed]:
        """Return the held group if it is complete. Called when the port closes."""
        return self._end(now) + self._cut_off(now)

    def _cut_off(self, now: float) -> list[Timed]:
        """Discard a record that is not complete, because another message has interrupted it."""
        return [(now, self._record.drop())] if self._record.begun else []

    # Groups

    def _begin(self, code: int, now: float) -> None:
        """Begin a group, and set the longest allowed time between two of its lines."""
        since_s = now - self._begun_at.get(code, -math.inf)
        if since_s > QUIET_S and not self._after_ticks:  # the groups came separately
            self._late_s[code] = max(QUIET_S, min(LATE_S, LATE_PART * since_s))
        self._begun_at[code] = self._at = now
        self._code, self._payloads, self._done, self._astray = code, [], False, False

    def _may_be_minus_one(self, code: int) -> bool:
        """Return whether a line that looks like a marker may be a value of the current group.

        A marker and the value -1 have the same payload.
        """
        return code == self._code == Code.TICKS and not self._done and 0 < len(self._payloads) < 3

    def _may_be_complete(self) -> bool:
        """Return whether the lines of the current group may form a complete report.

        The number of lines decides.
        """
        if self._code is None or self._done:
            return False
        if len(self._payloads) not in _LENGTHS[Code(self._code)]:
            return False
        return not (self._after_ticks and self._appends and len(self._payloads) == 3)

    def _value(self, code: int, payload: int, now: float) -> list[Timed]:
        if code != self._code:
            found = self._end(now)
            if not self._astray:
                self.statistics.damaged_groups += 1
            self._astray, self._after_ticks = True, code == Code.TICKS
            return found
        self._at = now
        if self._done:  # the group is longer than it seemed
            self._drop()
            return []
        if len(self._payloads) < _LONGEST:
            self._payloads.append(payload)
        if not self._may_be_complete():
            return []
        # A group is complete at its last line if no line came twice and its values can follow the
        # last group. Any other group waits for the next line or for ``QUIET_S``: a line may be lost
        # or repeated.
        if any(map(eq, self._payloads, self._payloads[1:])) or MARKER in self._payloads:
            return []
        group = _group(code, self._payloads)
        if group is None or not in_range(group) or not self._goes_on(group, now):
            return []
        self._done = True
        return self._believed(group, now)

    def _end(self, now: float) -> list[Timed]:
        """End the current group. Return it if it is complete and plausible."""
        code = self._code
        if code is None:
            return []
        self._code = None
        was_after_ticks, self._after_ticks = self._after_ticks, False
        if code == Code.TICKS:
            self._after_ticks = 0 < len(self._payloads) < 4 and not was_after_ticks
        if self._done:
            return []
        payloads = self._payloads
        if MARKER in payloads and len(payloads) != 3:  # it was a marker, not a count of -1
            self.statistics.damaged_groups += 1
            payloads = payloads[payloads.index(MARKER) + 1 :]
        group = _group(code, payloads)
        if group is None:
            self.statistics.damaged_groups += 1
            return []
        if isinstance(group, Ticks) and was_after_ticks:
            # Half an odometry group consists of zeros if the robot has not driven yet.
            half = not any(payloads) or not self._ticks_gate.would_pass(group, self._at)
            if self._appends and half:
                self.statistics.damaged_groups += 1
                return []
            self._appends = False
        if not in_range(group):
            self.statistics.implausible += 1
            return []
        return self._believed(group, self._at)

    def _drop(self) -> None:
        self.statistics.damaged_groups += 1
        self._after_ticks = self._code == Code.TICKS and not self._after_ticks
        self._code, self._astray = None, True

    def _goes_on(self, group: GroupReport, now: float) -> bool:
        match group:
            case Ticks():
                return self._ticks_gate.would_pass(group, now)
            case BoardOdometry():
                return self._odometry_gates[group.appended].would_pass(group, now)
        return False  # one GPS fix says little about the next

    def _believed(self, group: GroupReport, now: float) -> list[Timed]:
        match group:
            case Ticks():
                passes = self._ticks_gate.passes(group, now)
            case BoardOdometry():
                passes = self._odometry_gates[group.appended].passes(group, now)
            case _:
                passes = True
        if not passes:
            self.statistics.implausible += 1
            return []
        self._appends |= isinstance(group, BoardOdometry) and group.appended
        return [(now, group)]


def _group(code: int, payloads: list[int]) -> GroupReport | None:
    if len(payloads) not in _LENGTHS[Code(code)]:
        return None
    if len(payloads) == 3:
        time_counts, left, right = payloads
        return Ticks(time_counts, wrapped(left), wrapped(right))
    numbers = [to_float(payload) for payload in payloads]
    if code == Code.GPS_POSITION:
        return GpsPosition(*numbers)
    x_m, y_m, yaw_rad, dx_mps, dy_mps, yaw_rate_radps = numbers
    appended = code == Code.TICKS
    return BoardOdometry(x_m, y_m, yaw_rad, dx_mps, dy_mps, yaw_rate_radps, appended)
