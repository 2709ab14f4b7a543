# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The order in which a running board sends, and what it tells of bytes that made no frame.

In nominal mode a delta follows every fourth IMU frame, and a pose every fifth delta; in IMU-only
mode there are IMU frames alone. So the number of bytes between two frames tells which frames they
were, also when a few of them are missing. It is soft knowledge: SEQ and arrival times correct it.
"""

from typing import Final

from omnibot_driver.core.omnibot.frames import DeltaFrame, Frame, ImuFrame, PoseFrame
from omnibot_driver.core.omnibot.modes import IMU_FRAMES_ALONE

Kind = type[Frame]

LENGTH: Final[dict[Kind, int]] = {ImuFrame: 14, DeltaFrame: 9, PoseFrame: 15}
_DELTA_PERIOD: Final[tuple[Kind, ...]] = (*(ImuFrame,) * 4, DeltaFrame)
NOMINAL: Final[tuple[Kind, ...]] = (*_DELTA_PERIOD * 5, PoseFrame)
IMU_ONLY: Final[tuple[Kind, ...]] = (ImuFrame,)


class Rhythm:
    """Where in its cycle a board is; one for each stretch in which it runs."""

    def __init__(self) -> None:
        self._cycle = IMU_ONLY
        self._next = 0
        self._imus = self._lost = 0

    def hear(self, kind: Kind, skipped: int) -> int:
        """A frame came in after so many bytes that made none: how many IMU frames they were.

        With those that a pose came after, but not beyond a delta: its SEQ counts what is before it.
        """
        while skipped >= LENGTH[self._cycle[self._next]] / 2:
            passed = self._cycle[self._next]
            skipped -= LENGTH[passed]
            self._lost += passed is ImuFrame
            self._next = (self._next + 1) % len(self._cycle)
        self._imus = self._imus + 1 if kind is ImuFrame else 0
        if kind is not ImuFrame:
            self._cycle = NOMINAL
        elif self._imus >= IMU_FRAMES_ALONE:
            self._cycle, self._next = IMU_ONLY, 0
        cycle, at = self._cycle, self._next
        while cycle[at] is not kind:
            at = (at + 1) % len(cycle)
        self._next = (at + 1) % len(cycle)
        if kind is PoseFrame:
            return 0
        lost, self._lost = self._lost, 0
        return lost
