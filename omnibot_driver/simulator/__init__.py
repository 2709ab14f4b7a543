# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Simulated motor boards for tests of the driver, each written from the manual of the real board.

The simulator shares no code with the driver. Imports from here are deprecated: use
``simulator.omnibot``.
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
        f"import {name} from {__name__}.omnibot; the next release removes it from {__name__}",
        DeprecationWarning,
        stacklevel=2,
    )
    found: object = getattr(import_module(f"{__name__}.omnibot"), name)
    globals()[name] = found
    return found
