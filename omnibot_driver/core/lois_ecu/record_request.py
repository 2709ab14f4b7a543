# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Request for a record. It is sent up to three times, because the board may lose lines.

The repetitions follow quickly, because each one restarts the record.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.lois_ecu.decoder import LoisDecoder
from omnibot_driver.core.lois_ecu.messages import (
    MOST_SAMPLES,
    Command,
    Record,
    RecordHeading,
    RecordKind,
    RecordRpm,
    RecordTorque,
)
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit
from omnibot_driver.core.lois_ecu.readings import (
    LoisReading,
    RecordComes,
    RecordFailed,
    RecordReading,
)

SAID_AFTER_S: Final = (0.0, 0.13, 0.29)
"""Times in s, from the first sending, at which the driver sends a request. Each interval is longer
than the longest time in which the board cannot receive, and not a multiple of a usual report
period."""
COUNT_S: Final[Mapping[ClockUnit, float]] = {"ms": 1e-4, "ns": 1e-7}
"""Unit, in s, of the times in an RPM record. It follows from the unit of the board's clock in its
tick reports (0x12)."""


def command_of(kind: RecordKind, samples: int) -> Command:
    """Return the command that requests a record.

    Raises RequestRefused if the board cannot complete the record.
    """
    if not 0 < samples <= MOST_SAMPLES:
        raise RequestRefused(
            f"record rejected: {samples} samples are requested, but the board can complete only 1"
            f" to {MOST_SAMPLES}"
        )
    match kind:
        case RecordKind.RPM:
            return RecordRpm(samples, samples)
        case RecordKind.TORQUE:
            return RecordTorque(samples, samples)
        case RecordKind.HEADING:
            return RecordHeading(samples)


class RecordRequest:
    """Request for a record. ``kind``: kind of this record; None while no record is requested."""

    def __init__(self) -> None:
        self.kind: RecordKind | None = None
        self._command: Command | None = None
        self._begun_s = math.inf
        self._said = self._damaged = 0

    def begin(self, kind: RecordKind, samples: int, decoder: LoisDecoder) -> None:
        """Make the next ``due`` return the request for a record.

        An earlier request is abandoned. Raises RequestRefused if the board cannot complete the
        record.
        """
        self._command, self.kind = command_of(kind, samples), kind
        self._begun_s, self._said = math.inf, 0
        decoder.expect_record(kind, samples, 0 if kind is RecordKind.HEADING else samples)
        self._damaged = decoder.group_statistics.damaged_records

    def look(
        self,
        found: list[LoisReading],
        decoder: LoisDecoder,
        prevented: str,
        ticks_per_revolution: int,
    ) -> list[LoisReading]:
        """Return ``found`` with the request's result, if known. Unrequested records are removed.

        While lines of a record arrive, return a RecordComes instead of an empty list.

        ``prevented``: why the board cannot send the record, as a sentence; empty if it can.
        """
        comes: list[LoisReading] = [RecordComes()] if decoder.in_record else []
        if self.kind is None:
            # The board also completes and sends a record that was given up.
            return [one for one in found if not isinstance(one, Record)] or comes
        if decoder.in_record:
            self._command = None  # a repetition would restart the record
        for place, reading in enumerate(found):
            if isinstance(reading, Record):
                self._end()
                unit = decoder.clock_unit
                count_s = None if unit is None else COUNT_S[unit]
                found[place] = RecordReading(reading, count_s, ticks_per_revolution)
                return found
        if not prevented and decoder.group_statistics.damaged_records != self._damaged:
            prevented = "a line of the record was lost; call again"
        if not prevented:
            return found or comes
        self._end()
        return [*found, RecordFailed(prevented)]

    def _end(self) -> None:
        self.kind = self._command = None

    @property
    def wake_at(self) -> float:
        """Time at which to call ``due`` next. It is infinity while nothing is left to send."""
        if self._command is None or self._said == len(SAID_AFTER_S):
            return math.inf
        if self._begun_s == math.inf:
            return -math.inf
        return self._begun_s + SAID_AFTER_S[self._said]

    def due(self, now: float) -> Command | None:
        """Return the command to send now, or None if nothing is due."""
        if now < self.wake_at:
            return None
        self._begun_s = min(self._begun_s, now)
        self._said += 1
        return self._command
