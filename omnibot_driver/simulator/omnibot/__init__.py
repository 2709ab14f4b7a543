# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated OmniBot board for tests of the driver, written from the manual of the real board.

The package shares no code with the driver.
"""

from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.common.serving import PtyBoard
from omnibot_driver.simulator.omnibot.firmware import CHANNELS, BoardMode, SimulatedBoard
from omnibot_driver.simulator.omnibot.logs import ReceivedCommand, SentFrame
from omnibot_driver.simulator.omnibot.options import add_options, from_arguments
from omnibot_driver.simulator.omnibot.receivers import ReceiverKind
from omnibot_driver.simulator.omnibot.settings import BoardPose, BoardSettings
from omnibot_driver.simulator.omnibot.world import TruePose

TITLE = "OmniBot"

__all__ = [
    "CHANNELS",
    "TITLE",
    "BoardMode",
    "BoardPose",
    "BoardSettings",
    "FaultyLine",
    "LineFaults",
    "PtyBoard",
    "ReceivedCommand",
    "ReceiverKind",
    "SentFrame",
    "SimulatedBoard",
    "TruePose",
    "add_options",
    "from_arguments",
]
