# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The boards that the driver works with: a profile of each, imported when it is chosen.

A profile is the one place where a board meets the shell around the core: what makes it of the
driver's parameters. The rest of the driver knows none of them.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Final, Protocol, cast

from omnibot_driver.core.board import Board
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.transports import Transport

PROFILES: Final = {"omnibot": "omnibot_driver.boards.omnibot"}
"""By the value of the parameter ``board``: the module that is its profile."""


class Profile(Protocol):
    """What the shell needs of a kind of board, as the names of a module."""

    SIMULATOR: str
    """The package of its simulated board, to be imported where it is used."""

    def make(self, values: Mapping[str, Any]) -> Board:
        """A board with these checked parameter values."""

    def settings(self, values: Mapping[str, Any]) -> object:
        """What ``Board.settings`` is to be replaced by when parameters change."""

    def opener(self, values: Mapping[str, Any]) -> Callable[[], Transport]:
        """What opens the line to it."""

    def kinematics(self, values: Mapping[str, Any]) -> Kinematics:
        """The wheels, by checked values."""


def load(name: str) -> Profile:
    """The profile of one of ``PROFILES``."""
    return cast(Profile, import_module(PROFILES[name]))
