# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What can be asked of a board besides motion, and the answer: values only."""

from dataclasses import dataclass
from enum import Enum
from typing import Literal

OnExit = Literal["stop", "pause", "reset"]


class Request(Enum):
    """What can be asked of a board; the value reads well after "a"."""

    START = "start"
    PAUSE = "pause"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class RequestDone:
    """The answer to a request; ``token`` is what the asker handed in."""

    token: object
    success: bool
    message: str
