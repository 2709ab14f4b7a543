# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Requests to a board other than motion commands, and their answers: values without behaviour."""

from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

OnExit = Literal["stop", "pause", "reset"]
LEAVING: Final = "the driver is shutting down; start it again"
"""Why requests and commands are refused, and pending requests fail, when the driver ends."""


class Request(Enum):
    """A kind of request to a board. The values are nouns for messages: "a start is under way"."""

    START = "start"
    PAUSE = "pause"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class RequestDone:
    """The answer to a request. ``token`` is what the caller passed with the request."""

    token: object
    success: bool
    message: str
