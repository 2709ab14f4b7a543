# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART motion controller, a server that the driver commands by UDP datagrams.

The server answers one request at a time. This package knows bytes and times; it does not know
sockets or ROS.
"""

from omnibot_driver.core.mart.replies import Fail, MartDecoder, Ok, Other, parse
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.mart.words import WORDS, Form, Kind, Request, Word

__all__ = [
    "WORDS",
    "Fail",
    "Form",
    "Kind",
    "MartDecoder",
    "MartSettings",
    "Motion",
    "Ok",
    "Other",
    "Request",
    "State",
    "Word",
    "parse",
]
