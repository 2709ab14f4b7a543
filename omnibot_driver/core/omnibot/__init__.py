# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Neuron OmniBot's STM32 motor board: its protocol, frames and settings."""

from omnibot_driver.core.omnibot.board import OmniBot
from omnibot_driver.core.omnibot.decoder import DecoderStatistics, FrameDecoder
from omnibot_driver.core.omnibot.frames import (
    CommandFrame,
    DeltaFrame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    decode,
    encode,
)
from omnibot_driver.core.omnibot.settings import OmniBotSettings

__all__ = [
    "CommandFrame",
    "DecoderStatistics",
    "DeltaFrame",
    "FrameDecoder",
    "ImuFrame",
    "OmniBot",
    "OmniBotSettings",
    "PausedFrame",
    "PoseFrame",
    "decode",
    "encode",
]
