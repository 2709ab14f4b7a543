# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU in software, as its manual describes it or as its public firmware behaves.

The package must share no code with the driver. ``SimulatedLois`` reads no clock and no port.
"""

from omnibot_driver.simulator.lois_ecu.board import CHANNELS, SimulatedLois
from omnibot_driver.simulator.lois_ecu.commands import Obeyed
from omnibot_driver.simulator.lois_ecu.options import add_options, from_arguments
from omnibot_driver.simulator.lois_ecu.settings import (
    DOCUMENTED,
    FIRMWARE,
    QUIRKS,
    Firmware,
    LoisSettings,
    MotorSettings,
    Quirks,
)

TITLE = "LOIS ECU"

__all__ = [
    "CHANNELS",
    "DOCUMENTED",
    "FIRMWARE",
    "QUIRKS",
    "TITLE",
    "Firmware",
    "LoisSettings",
    "MotorSettings",
    "Obeyed",
    "Quirks",
    "SimulatedLois",
    "add_options",
    "from_arguments",
]
