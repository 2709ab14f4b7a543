# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Assembly of a requested record from its lines. An incomplete record is discarded.

This module works on text lines. It does not know characters or times.
"""

from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.lois_ecu.lines import signed, unsigned_pair
from omnibot_driver.core.lois_ecu.messages import (
    HEADING_END,
    HEADING_PADDING,
    RECORD_END,
    Code,
    LostRecord,
    Record,
    RecordKind,
)

RECORD_CODES: Final = (Code.RECORD_RPM, Code.RECORD_TORQUE, Code.RECORD_HEADING)


@dataclass(slots=True)
class GroupStatistics:
    """Counters of groups and records since this object was created.

    A group is the lines of one report.

    * ``damaged_groups``: discarded groups and records.
    * ``damaged_records``: discarded records alone.
    * ``implausible``: complete groups with values that are not plausible.
    * ``unknown_lines``: valid text lines that are not a report.
    """

    damaged_groups: int = 0
    damaged_records: int = 0
    implausible: int = 0
    unknown_lines: int = 0


class RecordAssembler:
    """Assembler of the lines of a record.

    Call ``add`` for each line of the record, ``drop`` when another message arrives, and ``damage``
    when characters arrive that are not a line.
    """

    def __init__(self, statistics: GroupStatistics) -> None:
        self._statistics = statistics
        self._expected: tuple[RecordKind, int, int] | None = None
        self._begin(None)

    def _begin(self, code: int | None) -> None:
        self._payloads: list[int] = []
        self._code, self._damaged, self._lines = code, False, 0

    @property
    def begun(self) -> bool:
        """Whether lines of an unfinished record have arrived."""
        return self._code is not None

    def expect(self, kind: RecordKind, left: int, right: int) -> None:
        """Expect a record with ``left`` and ``right`` samples, and discard all other records."""
        self._expected = kind, left, right
        self._begin(None)

    def damage(self) -> None:
        """Mark the unfinished record as damaged, because one of its lines may have been lost."""
        self._damaged = self.begun

    def add(self, code: int, payload: int) -> list[Record | LostRecord]:
        """Add a line. If it ends the record, return a list with the record, else an empty list.

        A LostRecord replaces a damaged or unexpected record.
        """
        if not self.begun:
            self._begin(code)
        self._lines += 1
        self._damaged |= code != self._code
        if not self._ends(code, payload):
            if self._expected is None or len(self._payloads) >= max(self._expected[1:]):
                self._damaged = True
            else:
                self._payloads.append(payload)
            return []
        record = None if self._damaged else self._whole(code)
        if record is None:
            return [self.drop()]
        self._begin(None)
        self._expected = None
        return [record]

    def _ends(self, code: int, payload: int) -> bool:
        """Return whether this line ends the record.

        The last line of a torque record looks like a sample of 0/0. Such a line ends the record
        only after all expected samples.
        """
        if code == Code.RECORD_HEADING:
            return payload == HEADING_END
        if payload != RECORD_END:
            return False
        if self._expected is None or self._expected[0] is not RecordKind.TORQUE:
            return True
        return len(self._payloads) >= max(self._expected[1:])

    def drop(self) -> LostRecord:
        """Discard the unfinished record."""
        self._statistics.damaged_groups += 1
        self._statistics.damaged_records += 1
        lost = LostRecord(self._lines)
        self._begin(None)
        return lost

    def _whole(self, code: int) -> Record | None:
        if self._expected is None:
            return None
        kind, left, right = self._expected
        if (kind is RecordKind.HEADING) != (code == Code.RECORD_HEADING):
            return None
        if kind is RecordKind.RPM and code == Code.RECORD_TORQUE:
            return None
        pairs = [unsigned_pair(payload) for payload in self._payloads]
        if kind is RecordKind.HEADING:
            headings = [signed(word) for pair in pairs for word in pair]
            padding = headings[left:]
            if len(headings) != left + left % 2 or padding not in ([], [HEADING_PADDING]):
                return None
            if not all(-180 <= heading < 360 for heading in headings[:left]):
                return None
            return Record(kind, tuple(headings[:left]), ())
        if len(pairs) != max(left, right):
            return None
        lefts, rights = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
        return Record(kind, tuple(lefts[:left]), tuple(rights[:right]))
