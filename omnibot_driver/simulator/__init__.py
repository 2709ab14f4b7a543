# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Motor boards in software, each written from its manual, to run the driver against.

Each board has its own package; ``common`` holds what the boards share. The simulator shares no
code with the driver, so that a misread manual does not cancel out.
``python -m omnibot_driver.simulator`` runs one board in real time.

For one release, the names of ``simulator.omnibot`` can also be imported from here.
"""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omnibot_driver.simulator.omnibot import (
        BoardMode,
        BoardPose,
        BoardSettings,
        FaultyLine,
        LineFaults,
        PtyBoard,
        ReceivedCommand,
        ReceiverKind,
        SentFrame,
        SimulatedBoard,
        TruePose,
    )

__all__ = [
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
]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(
        f"import {name} from {__name__}.omnibot; {__name__} will not have it in the next release",
        DeprecationWarning,
        stacklevel=2,
    )
    found: object = getattr(import_module(f"{__name__}.omnibot"), name)
    globals()[name] = found
    return found
