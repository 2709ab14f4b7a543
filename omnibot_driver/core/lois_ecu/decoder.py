# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Decoder that turns a stream of bytes into reports.

A line begins at the last ``:`` before its line feed. No input raises an error.
"""

from dataclasses import dataclass, field
from typing import Final

from omnibot_driver.core.lois_ecu.groups import Assembler, Timed
from omnibot_driver.core.lois_ecu.lines import BEGIN, END, LENGTH, Line, line_of
from omnibot_driver.core.lois_ecu.messages import RecordKind, Report, TerminalLine
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit, TicksGate
from omnibot_driver.core.lois_ecu.record_lines import GroupStatistics

LONGEST_LINE: Final = 256
"""Largest accepted length of a line in bytes. Lines of the board's sensors, such as the GPS, are
shorter than this."""
SURE_AFTER: Final = 8
"""Number of lines without a checksum that the decoder discards after a line with a checksum.

The decoder then accepts lines without a checksum again.
"""


@dataclass(slots=True)
class DecoderStatistics:
    """Counters of a decoder, which continue after a reconnection.

    * ``lines``: number of valid lines.
    * ``faults``: number of discarded pieces of input.
    """

    lines: int = 0
    faults: int = 0
    discarded_bytes: int = 0
    groups: GroupStatistics = field(default_factory=GroupStatistics)


class LoisDecoder:
    """Decoder of the bytes from one serial port.

    * ``sum_required``: whether to discard lines without a checksum even while the board sends no
      checksums.
    * ``terminal``: whether text outside the protocol is regarded as a sensor's line, not as damage.
    * ``times``: for each report of the last call, the arrival time of its last line, in s.
    """

    def __init__(self, *, sum_required: bool = True, ticks_per_revolution: int = 60) -> None:
        self.sum_required = sum_required
        self.ticks_gate = TicksGate(ticks_per_revolution)
        self.terminal = False
        self.times: list[float] = []
        self.statistics = DecoderStatistics()
        self._held = b""
        self._cut_bytes = 0
        """Number of bytes of the current line that were already discarded."""
        self._doubted = 0
        """How many of the next lines without a checksum will be discarded."""

    @property
    def statistics(self) -> DecoderStatistics:
        """Counters of lines, faults and groups.

        To continue the counters of an earlier decoder, assign them before the first ``feed``.
        """
        return self._statistics

    @statistics.setter
    def statistics(self, statistics: DecoderStatistics) -> None:
        self._statistics = statistics
        self._assembler = Assembler(statistics.groups, self.ticks_gate)

    @property
    def group_statistics(self) -> GroupStatistics:
        """Counters of groups of lines. Each group encodes one report."""
        return self._statistics.groups

    @property
    def clock_unit(self) -> ClockUnit | None:
        """Unit of ``Ticks.time_counts``; None while unknown."""
        return self.ticks_gate.unit

    @property
    def resolves_at(self) -> float:
        """Time in s at which ``feed`` must be called again, even without bytes."""
        return self._assembler.resolves_at

    @property
    def in_record(self) -> bool:
        """Whether a record has begun to arrive and is not complete yet.

        A record consists of the samples that the user requested, such as times between ticks.
        """
        return self._assembler.in_record

    def expect_record(self, kind: RecordKind, left: int, right: int = 0) -> None:
        """Expect a record, and discard all other records.

        ``left``, ``right``: number of samples of each wheel; for headings, ``left`` is their
        number, and ``right`` is 0.
        """
        self._assembler.expect_record(kind, left, right)

    def forget_counters(self) -> None:
        """Accept any counts in the next report, because a reset may have cleared the counters."""
        self._assembler.forget()

    def feed(self, data: bytes, now: float) -> list[Report]:
        """Return the reports that ``data`` completes, in the order in which the board sent them.

        A report that may be incomplete waits for the next line, or for a call with empty ``data``.
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
        """Return the report that ``feed`` holds back, if it is complete.

        Called when the port closes.
        """
        if self._held or self._cut_bytes:
            self._damaged(len(self._held) + self._cut_bytes)
        self._held, self._cut_bytes = b"", 0
        return self._untimed(self._assembler.finish(now))

    def _untimed(self, found: list[Timed]) -> list[Report]:
        self.times = [at for at, _ in found]
        return [report for _, report in found]

    def _take(self, text: bytes, now: float) -> list[Timed]:
        before, self._cut_bytes = self._cut_bytes, 0
        at = text.rfind(BEGIN)
        line = None
        if at >= 0:
            # A line that lost characters is too short. Two lines become one only if fourteen
            # characters in a row are lost.
            line = self._line(text[at:] + END)
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

    def _line(self, text: bytes) -> Line | None:
        line = line_of(text)
        if line is not None:
            self._doubted = SURE_AFTER
        elif not self.sum_required:
            line = line_of(text, sum_required=False)
            # A line that has lost two characters looks like a line without a checksum.
            if line is not None and self._doubted:
                self._doubted -= 1
                return None
        return line

    def _damaged(self, length: int) -> None:
        self.statistics.faults += 1
        self.statistics.discarded_bytes += length
        self._assembler.damage()


def _is_text(text: bytes) -> bool:
    text = text.strip()
    return 0 < len(text) < LONGEST_LINE and text.isascii() and text.decode("ascii").isprintable()
