# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's modes as a table: how the letters S, P and R and the board's data change the mode.

Source: the manual's "Operation State Machine" and "System state command". A sent letter proves
nothing; only *received* data shows the mode. P toggles, so it is sent only to a running board.
"""

from enum import Enum
from typing import Final

from omnibot_driver.core.board import Mode
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.omnibot.frames import Frame, ImuFrame, PausedFrame
from omnibot_driver.core.omnibot.schedule import USUAL, Schedule


class Happening(Enum):
    """The events of the mode table: data received from the board, or letters sent to it."""

    HEARD_PAUSED = "heard «Paused»"
    HEARD_MOTION = "heard deltas or poses"
    HEARD_IMU_ALONE = "heard IMU frames without deltas"
    HEARD_NOTHING = "heard nothing"
    SENT_START = "sent S"
    SENT_PAUSE = "sent P"
    SENT_RESET = "sent R"


_U, _P, _N, _I = Mode.UNKNOWN, Mode.PAUSED, Mode.NOMINAL, Mode.IMU_ONLY

TRANSITIONS: Final[dict[Happening, dict[Mode, Mode]]] = {
    Happening.HEARD_PAUSED: {_U: _P, _P: _P, _N: _P, _I: _P},
    Happening.HEARD_MOTION: {_U: _N, _P: _N, _N: _N, _I: _N},
    Happening.HEARD_IMU_ALONE: {_U: _I, _P: _I, _N: _I, _I: _I},
    Happening.HEARD_NOTHING: {_U: _U, _P: _U, _N: _U, _I: _U},
    Happening.SENT_START: {_U: _U, _P: _P, _N: _N, _I: _I},
    Happening.SENT_PAUSE: {_N: _N, _I: _I},
    Happening.SENT_RESET: {_U: _U, _P: _U, _N: _U, _I: _U},
}
"""The mode after an event, by event and previous mode. An event without an entry is refused."""


class ModeTracker:
    """The mode of the board, inferred from events by the table ``TRANSITIONS``.

    An event that the table does not allow raises RequestRefused and changes nothing.
    """

    def __init__(self, schedule: Schedule = USUAL) -> None:
        self.mode = Mode.UNKNOWN
        self._imus_alone = self.imus_to_come = schedule.imus_alone
        """``_imus_alone``: number of IMU frames in a row, without a delta, after which the driver
        assumes IMU-only mode. ``imus_to_come``: how many of these IMU frames have not arrived
        yet."""

    def apply(self, happening: Happening) -> None:
        """Change the mode as ``TRANSITIONS`` says for this event.

        Raises RequestRefused if the event is not allowed in the present mode.
        """
        try:
            self.mode = TRANSITIONS[happening][self.mode]
        except KeyError:
            raise RequestRefused(
                f"the board is {self.mode.value}: «{happening.value}» is not allowed in this mode"
            ) from None
        if happening is not Happening.SENT_START:  # a repeated S must not restart the count
            self.imus_to_come = self._imus_alone

    def hear(self, frame: Frame) -> None:
        """Update the mode: a received frame shows in which mode the board is."""
        if isinstance(frame, ImuFrame):
            self.hear_imus(1)
        elif isinstance(frame, PausedFrame):
            self.apply(Happening.HEARD_PAUSED)
        elif self.mode is _N:
            self.imus_to_come = self._imus_alone
        else:
            self.apply(Happening.HEARD_MOTION)

    def hear_imus(self, count: int) -> None:
        """Update the mode after a row of IMU frames without a delta between them.

        ``count``: number of these frames. It must not exceed ``imus_to_come``.
        """
        self.imus_to_come -= count
        if not self.imus_to_come:
            self.apply(Happening.HEARD_IMU_ALONE)
