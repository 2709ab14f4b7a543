# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A record that is asked for: said more than once, as lines are lost, until it begins to come.

Saying it again makes the board begin anew, so all is said within a short time. Knows times and
counts, no lines.
"""

import math
from typing import Final

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.lois_ecu.messages import (
    MOST_SAMPLES,
    Command,
    RecordHeading,
    RecordKind,
    RecordRpm,
    RecordTorque,
)

SAID_AFTER_S: Final = (0.0, 0.13, 0.29)
"""Apart by more than the board is deaf for, and by no multiple of its usual periods."""


def command_of(kind: RecordKind, samples: int) -> Command:
    """What asks for it. Raises RequestRefused where it could not complete."""
    if not 0 < samples <= MOST_SAMPLES:
        raise RequestRefused(
            f"record refused: {samples} samples; the board completes 1 to {MOST_SAMPLES}"
        )
    match kind:
        case RecordKind.RPM:
            return RecordRpm(samples, samples)
        case RecordKind.TORQUE:
            return RecordTorque(samples, samples)
        case RecordKind.HEADING:
            return RecordHeading(samples)


class RecordRequest:
    """``kind``: what is awaited; None while nothing is."""

    def __init__(self) -> None:
        self.kind: RecordKind | None = None
        self._command: Command | None = None
        self._begun_s = math.inf
        self._said = 0

    def begin(self, kind: RecordKind, samples: int) -> None:
        """From the next ``due`` on; what was awaited before is not awaited any more."""
        self._command, self.kind = command_of(kind, samples), kind
        self._begun_s, self._said = math.inf, 0

    def end(self) -> None:
        """It came, or failed."""
        self.kind = self._command = None

    def arrives(self) -> None:
        """Its first lines are here: it is not to begin anew."""
        self._command = None

    @property
    def wake_at(self) -> float:
        """When ``due`` has something."""
        if self._command is None or self._said == len(SAID_AFTER_S):
            return math.inf
        if self._begun_s == math.inf:
            return -math.inf
        return self._begun_s + SAID_AFTER_S[self._said]

    def due(self, now: float) -> Command | None:
        """What to say now."""
        if now < self.wake_at:
            return None
        self._begun_s = min(self._begun_s, now)
        self._said += 1
        return self._command
