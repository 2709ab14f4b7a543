# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reset of a LOIS ECU. It is repeated until the tick counts prove it, because lines may be lost."""

import math
from typing import Final

from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.messages import Ticks
from omnibot_driver.core.lois_ecu.reset_proof import ResetProof
from omnibot_driver.core.readings import Reading, ResetReading

RESETS: Final = 8
RESET_AGAIN_S: Final = 1.1
"""Time in s after which a reset is repeated. Stopped wheels come to rest in this time, and two tick
reports arrive.
"""
STEADY_S: Final = 0.3
"""Time in s without a change of the tick counts after which the wheels are regarded as at rest.
After a boot, the report period is 0.4 s, so one unchanged report is enough.
"""


class RepeatedReset:
    """A reset of the board with which ``ecu`` converses. It is sent at most ``RESETS`` times.

    * ``left``: how many times the reset can still be sent; ``begin`` sets it to ``RESETS``.
    * ``again_at_s``: time in s at which to call ``again``; infinity if no repetition is planned.
    """

    def __init__(self, ecu: LoisConversation) -> None:
        self._ecu = ecu
        self.connect()

    def connect(self) -> None:
        """Begin a new connection. The earlier reset is forgotten."""
        self._proof: ResetProof | None = None
        self._seen: Ticks | None = None
        self.left = 0
        self.again_at_s = math.inf
        self._shown = False

    def configure(self, ticks_per_revolution: int) -> None:
        """Use another number of encoder ticks for one turn of a wheel."""
        if self._proof is not None:
            self._proof.ticks_per_revolution = ticks_per_revolution

    @property
    def pending(self) -> bool:
        """Whether the driver still waits for tick counts that prove a reset."""
        return self._proof is not None and not self._shown

    def begin(self) -> bytes:
        """Return the lines of a new reset, which needs a proof of its own."""
        self._proof = None
        self.left, self._shown = RESETS, False
        return self._lines()

    def plan(self, now: float) -> None:
        """Plan the next repetition, because the reset was sent at ``now``."""
        self.left -= 1
        self.again_at_s = now + RESET_AGAIN_S if self.left else math.inf

    def again(self, now: float) -> bytes:
        """Return the lines that repeat the reset. Called at the time ``again_at_s``."""
        data = self._lines()
        self.plan(now)
        return data

    def give_up(self) -> None:
        """End the reset of the board: do not repeat it, and do not return a ResetReading for it."""
        self._proof, self.left, self.again_at_s = None, 0, math.inf

    def readings(self) -> list[Reading]:
        """Return a ResetReading if new tick counts show that the board was reset; otherwise none.

        When tick counts show this reset for the first time, also write the settings again.
        """
        proof, known = self._proof, self._ecu.translation.counts
        if proof is None or known.last is None or known.last is self._seen:
            return []
        self._seen, now = known.last, known.came_at_s
        if not proof.look(known.last, now):
            return []
        if not self._shown:
            self._shown, self.again_at_s = True, math.inf
            self._ecu.write_settings(now)
        return [ResetReading(proof.remark)]

    def _lines(self) -> bytes:
        known = self._ecu.translation.counts
        steady = known.came_at_s - known.changed_at_s >= STEADY_S
        if self._proof is None:
            per_turn = self._ecu.settings.ticks_per_revolution
            self._proof = ResetProof(known.last, per_turn, steady=steady)
        else:
            self._proof.again(known.last, steady=steady)
        return self._ecu.reset()
