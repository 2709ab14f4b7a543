# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated MART motion controller that follows its manual or its public server.

The package shares no code with the driver. ``MartServer`` uses no sockets, threads or real time.
"""

from omnibot_driver.simulator.mart.board import CHANNELS, SimulatedMart
from omnibot_driver.simulator.mart.motion import Kind
from omnibot_driver.simulator.mart.options import add_options, from_arguments
from omnibot_driver.simulator.mart.server import MartServer, Reply
from omnibot_driver.simulator.mart.settings import (
    DOCUMENTED,
    FIRMWARE,
    QUIRKS,
    SOURCE,
    Firmware,
    MartSettings,
    Quirks,
)
from omnibot_driver.simulator.mart.state import COMMAND, STOP

TITLE = "MART motion controller"

__all__ = [
    "CHANNELS",
    "COMMAND",
    "DOCUMENTED",
    "FIRMWARE",
    "QUIRKS",
    "SOURCE",
    "STOP",
    "TITLE",
    "Firmware",
    "Kind",
    "MartServer",
    "MartSettings",
    "Quirks",
    "Reply",
    "SimulatedMart",
    "add_options",
    "from_arguments",
]
