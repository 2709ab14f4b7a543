# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Options of a simulated LOIS ECU, except its seed and the faults of its line.

This module does not know which program runs the board.
"""

import argparse
from typing import get_args

from omnibot_driver.simulator.lois_ecu.board import SimulatedLois
from omnibot_driver.simulator.lois_ecu.settings import QUIRKS, Firmware, LoisSettings


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options to the parser."""
    parser.add_argument(
        "--firmware",
        choices=get_args(Firmware),
        default="documented",
        help="behaviour of the board. documented (the default): as in the manual. firmware: as in"
        " the public firmware",
    )
    parser.add_argument(
        "--running", action="store_true", help="start with a board that has already booted"
    )


def from_arguments(arguments: argparse.Namespace) -> SimulatedLois:
    """Return the board that the parsed options describe."""
    return SimulatedLois(
        LoisSettings(
            quirks=QUIRKS[arguments.firmware], seed=arguments.seed, running=arguments.running
        )
    )
