# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated board that runs its short ticks in groups, so the computer wakes up less often."""

from typing import Final

from omnibot_driver.simulator.common.running import RunningBoard
from omnibot_driver.simulator.common.wired import B

BATCH: Final = 5


class InBatches(RunningBoard[B]):
    """A running board that waits for ``BATCH`` ticks, and then runs them at once.

    A packet from the host ends the wait early. The output of the ticks arrives together, as through
    a USB adapter.
    """

    def _due(self, due_s: float) -> tuple[int, float]:
        wait_s = (BATCH - 1) * self.board.tick_s
        ticks, next_s = super()._due(due_s - wait_s)
        return ticks, next_s + wait_s
