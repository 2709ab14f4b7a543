"""The order in which a running board sends, and what it tells of bytes that made no frame.

In nominal mode a delta follows every fourth IMU frame, and a pose every fifth delta; in IMU-only
mode there is nothing but IMU frames. So bytes that were thrown away between two frames tell by their
number which frames they were, also when a few of them are missing. This is soft knowledge: SEQ and
arrival times correct it.
"""

from typing import Final

from omnibot_driver.core.omnibot.frames import DeltaFrame, Frame, ImuFrame, PoseFrame

Kind = type[Frame]

LENGTH: Final[dict[Kind, int]] = {ImuFrame: 14, DeltaFrame: 9, PoseFrame: 15}
NOMINAL: Final[tuple[Kind, ...]] = (*(ImuFrame, ImuFrame, ImuFrame, ImuFrame, DeltaFrame) * 5, PoseFrame)
IMU_ONLY: Final[tuple[Kind, ...]] = (ImuFrame,)
IMUS_ALONE: Final = 25
"""So many IMU frames without a delta, and none is expected any more."""


class Rhythm:
    """Where in its cycle the board is."""

    def __init__(self) -> None:
        self._cycle = IMU_ONLY
        self._next = 0
        self._imus = 0
        self._lost = 0

    def hear(self, kind: Kind, skipped: int) -> int:
        """This frame came in after so many bytes that made none.

        How many IMU frames they were, since the last frame that was an IMU frame or a delta.
        """
        if kind not in LENGTH:
            self.__init__()
            return 0
        while skipped >= LENGTH[self._cycle[self._next]] / 2:
            passed = self._cycle[self._next]
            skipped -= LENGTH[passed]
            self._lost += passed is ImuFrame
            self._advance()
        self._imus = self._imus + 1 if kind is ImuFrame else 0
        if kind is not ImuFrame:
            self._cycle = NOMINAL
        elif self._imus > IMUS_ALONE:
            self._cycle, self._next = IMU_ONLY, 0
        while self._cycle[self._next] is not kind:
            self._advance()
        self._advance()
        if kind is PoseFrame:
            return 0
        lost, self._lost = self._lost, 0
        return lost

    def _advance(self) -> None:
        self._next = (self._next + 1) % len(self._cycle)
