# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The two simulated Teensys of the Fejemis, written from the manual and public host programs.

The package must share no code with the driver. ``SimulatedFejemis`` reads no clock and no port.
"""

from omnibot_driver.simulator.fejemis.board import CHANNELS, SimulatedFejemis
from omnibot_driver.simulator.fejemis.options import add_options, from_arguments
from omnibot_driver.simulator.fejemis.settings import Fault, FejemisSettings, Firmware
from omnibot_driver.simulator.fejemis.teensy import Obeyed

TITLE = "Fejemis"

__all__ = [
    "CHANNELS",
    "TITLE",
    "Fault",
    "FejemisSettings",
    "Firmware",
    "Obeyed",
    "SimulatedFejemis",
    "add_options",
    "from_arguments",
]
