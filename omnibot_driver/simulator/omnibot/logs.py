# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The entries of the board's logs: commands that it obeyed, and frames that it sent."""

from dataclasses import dataclass
from typing import Literal

from omnibot_driver.simulator.omnibot.wire import Triple

CommandKind = Literal["velocity", "pose", "wheels", "estop", "start", "pause", "reset"]


@dataclass(frozen=True, slots=True)
class ReceivedCommand:
    """A command that the board obeyed.

    * ``tick``: number of ticks that the simulation had made when the board obeyed the command.
    * ``values``: the three words of a control frame; zeros for a state letter.
    """

    tick: int
    kind: CommandKind
    values: Triple = (0, 0, 0)


@dataclass(frozen=True, slots=True)
class SentFrame:
    """A frame or text that the board sent in tick number ``tick``."""

    tick: int
    data: bytes
