# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From a stream of bytes to reports.

A line ends with a line feed and begins at the last ``:`` before it, so a line that lost its end
costs no other one. Anything that is not a line is counted and dropped. A line that lost or gained
characters has another length; two lines that became one would have to lose fourteen characters
between them, and pass the checksum besides.

This module reads no clock and never raises on input. It holds less than ``LONGEST_LINE`` bytes
between calls, and looks at each byte a bounded number of times.
"""

from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.lois_ecu.groups import Assembler, Timed
from omnibot_driver.core.lois_ecu.lines import BEGIN, END, LENGTH, line_of
from omnibot_driver.core.lois_ecu.messages import RecordKind, Report, TerminalLine
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit
from omnibot_driver.core.lois_ecu.record_lines import GroupStatistics

LONGEST_LINE: Final = 256
"""Longer than any line of a serial sensor."""


@dataclass(slots=True)
class DecoderStatistics:
    """Counts since they were made. ``lines``: right ones; ``faults``: pieces that were not a
    line."""

    lines: int = 0
    faults: int = 0
    discarded_bytes: int = 0


class LoisDecoder:
    """``terminal``: whether lines of a sensor are expected, and text is not damage. ``times``: when
    the last line of each report of the last call arrived, which may have waited for what follows.

    Without ``sum_required`` lines that have no checksum are taken as well.
    """

    def __init__(self, *, sum_required: bool = True) -> None:
        self.sum_required = sum_required
        self.terminal = False
        self.times: list[float] = []
        self.statistics = DecoderStatistics()
        self._assembler = Assembler()
        self._held = b""
        self._cut_bytes = 0
        """Of the line in hand, already given up."""

    @property
    def group_statistics(self) -> GroupStatistics:
        """Counters of groups of lines."""
        return self._assembler.statistics

    @property
    def clock_unit(self) -> ClockUnit | None:
        """The unit of ``Ticks.time_counts``; None while unknown."""
        return self._assembler.clock_unit

    @property
    def resolves_at(self) -> float:
        """The latest time for the next ``feed``, with or without bytes."""
        return self._assembler.resolves_at

    @property
    def in_record(self) -> bool:
        """Whether the lines of a record are coming."""
        return self._assembler.in_record

    def expect_record(self, kind: RecordKind, left: int, right: int = 0) -> None:
        """A record of this many samples was requested; others are dropped."""
        self._assembler.expect_record(kind, left, right)

    def forget_counters(self) -> None:
        """The board was asked to set its counters to zero."""
        self._assembler.forget()

    def feed(self, data: bytes, now: float) -> list[Report]:
        """The reports that these bytes complete, in the order of the line.

        Without bytes: those that waited for what might follow, if nothing did for some time.
        """
        if not data:
            return self._untimed(self._assembler.rest(now))
        *lines, rest = (self._held + data).split(END)
        found: list[Timed] = []
        for text in lines:
            found += self._take(text, now)
        if len(rest) >= LONGEST_LINE:
            at = rest.rfind(BEGIN, -LENGTH - 1)
            kept = rest[at:] if at >= 0 else b""
            self._cut_bytes += len(rest) - len(kept)
            rest = kept
        self._held = rest
        return self._untimed(found)

    def flush(self, now: float) -> list[Report]:
        """The line is closed: what was held is all there will be."""
        if self._held or self._cut_bytes:
            self._damaged(len(self._held) + self._cut_bytes)
        self._held, self._cut_bytes = b"", 0
        return self._untimed(self._assembler.finish(now))

    def _untimed(self, found: list[Timed]) -> list[Report]:
        self.times = [at for at, _ in found]
        return [report for _, report in found]

    def _take(self, text: bytes, now: float) -> list[Timed]:
        """Decode the characters between two line feeds."""
        before, self._cut_bytes = self._cut_bytes, 0
        at = text.rfind(BEGIN)
        line = None
        if at >= 0:
            line = line_of(text[at:] + END, sum_required=self.sum_required)
        if line is None:
            length = len(text) + 1 + before
            if self.terminal and not before and at < 0 and _is_text(text):
                return [(now, TerminalLine(text.decode("ascii").rstrip("\r")))]
            self._damaged(length)
            return []
        if at + before:
            self._damaged(at + before)
        self.statistics.lines += 1
        return self._assembler.add(line, now)

    def _damaged(self, length: int) -> None:
        self.statistics.faults += 1
        self.statistics.discarded_bytes += length
        self._assembler.damage()


def _is_text(text: bytes) -> bool:
    text = text.strip()
    return 0 < len(text) < LONGEST_LINE and text.isascii() and text.decode("ascii").isprintable()
