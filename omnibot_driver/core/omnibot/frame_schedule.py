# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The order in which a running board sends frames, and an estimate of the frames that were lost.

At 25 Hz, the board sends a delta after every fourth IMU frame, and a pose after every fifth delta.
The driver assumes that discarded bytes were the next frames in this order, so the number of bytes
shows which frames were lost. The counters in the frames and the arrival times correct this
estimate.
"""

from functools import cache
from typing import Final

from omnibot_driver.core.omnibot.frames import DeltaFrame, Frame, ImuFrame, PoseFrame
from omnibot_driver.core.omnibot.schedule import USUAL, Schedule

Kind = type[Frame]

LENGTH: Final[dict[Kind, int]] = {ImuFrame: 14, DeltaFrame: 9, PoseFrame: 15}


class Cycle:
    """A repeating sequence of frame kinds.

    A position is the index of the frame that is due next. ``after[kind][at]``: the next position if
    a frame of ``kind`` arrives at the position ``at``. Frames that were due before it count as
    lost.
    """

    def __init__(self, *kinds: Kind) -> None:
        self.kinds = kinds
        size = len(kinds)
        self.after = {
            kind: [
                next((at + n + 1) % size for n in range(size) if kinds[(at + n) % size] is kind)
                for at in range(size)
            ]
            for kind in set(kinds)
        }


IMU_ONLY: Final = Cycle(ImuFrame)


@cache
def _nominal(imus_per_delta: int, deltas_per_pose: int) -> Cycle:
    delta_period: tuple[Kind, ...] = (*(ImuFrame,) * imus_per_delta, DeltaFrame)
    return Cycle(*delta_period * deltas_per_pose, PoseFrame)


class FrameSchedule:
    """The position of a running board in its cycle of frames."""

    def __init__(self, schedule: Schedule = USUAL) -> None:
        self._nominal = _nominal(schedule.imus_per_delta, schedule.deltas_per_pose)
        self._imus_alone = schedule.imus_alone
        self._cycle = IMU_ONLY
        self._next = 0
        self._imus = self._lost = 0

    def hear(self, kind: Kind, skipped: int) -> int:
        """Record that a frame of ``kind`` arrived; return how many IMU frames were lost before it.

        ``skipped``: number of discarded bytes before the frame. For a pose, the result is 0; the
        next frame of another kind gives the losses.
        """
        cycle = self._cycle
        while skipped and skipped >= LENGTH[cycle.kinds[self._next]] / 2:
            passed = cycle.kinds[self._next]
            skipped -= LENGTH[passed]
            self._lost += passed is ImuFrame
            self._next = (self._next + 1) % len(cycle.kinds)
        if kind is ImuFrame:
            self.hear_imus(1)
        else:
            self._imus, self._cycle = 0, self._nominal
            self._next = self._nominal.after[kind][self._next]
            if kind is PoseFrame:
                return 0
        lost, self._lost = self._lost, 0
        return lost

    def hear_imus(self, count: int) -> None:
        """Record ``count`` IMU frames that the board has sent without other frames between them."""
        self._imus += count
        if self._imus >= self._imus_alone:
            self._cycle, self._next = IMU_ONLY, 0
        after = self._cycle.after[ImuFrame]
        for _ in range(count):
            self._next = after[self._next]
