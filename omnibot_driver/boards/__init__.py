# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The boards that the driver works with: a profile of each, imported when it is chosen.

A profile is the one place where a board meets the shell around the core: its parameters, and what
makes it of their values. The rest of the driver knows no board.
"""

from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import Any, Final, Protocol, cast

from omnibot_driver.core.board import Board
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.geometry.kinematics import Kinematics
from omnibot_driver.parameters import Parameter, Table, Value
from omnibot_driver.transports import Transport

PROFILES: Final = {
    "omnibot": "omnibot_driver.boards.omnibot",
    "lois_ecu": "omnibot_driver.boards.lois_ecu",
    "mart": "omnibot_driver.boards.mart",
    "fejemis": "omnibot_driver.boards.fejemis",
}
"""By the value of the parameter ``board``: the module that is its profile."""
DEFAULT: Final = "omnibot"

Publish = Callable[[Any, int], None]
"""Publishes a value of the board's own kind that was measured at this stamp, in ns of ROS time."""


class Profile(Protocol):
    """The functions and values of a board's profile, which is a module."""

    SIMULATOR: str
    """The package of its simulated board, to be imported where it is used."""

    PARAMETERS: Table
    """All that can be set."""

    def make(self, values: Mapping[str, Any]) -> Board:
        """A board with these checked parameter values."""

    def settings(self, values: Mapping[str, Any]) -> object:
        """The new value of ``Board.settings`` when parameters change."""

    def opener(self, values: Mapping[str, Any]) -> Callable[[], Transport]:
        """A function that opens the real line."""

    def kinematics(self, values: Mapping[str, Any]) -> Kinematics:
        """The wheels, by checked values."""

    def extras(self, node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Publish]:
        """Make what only this board has: publishers, services and inputs on the node.

        Returns who publishes each type of value that comes as an ``Extra``. The link's ``call`` and
        ``command`` reach the session. Called once, on the executor's thread, before bytes come.
        """


def load(name: str) -> Profile:
    """The profile of one of ``PROFILES``."""
    return cast(Profile, import_module(PROFILES[name]))


def opener(profile: Profile, values: Mapping[str, Any]) -> Callable[[], Transport]:
    """A function that opens the line, or a simulated board where ``port`` says so."""
    port = str(values["port"])
    if not port.lower().startswith("sim://"):
        return profile.opener(values)
    simulated = import_module("omnibot_driver.transports.simulated")
    return partial(simulated.SimulatedTransport, port, profile.SIMULATOR)


def table_for(given: Mapping[str, object]) -> Table:
    """The parameters of the board that is given, or of the usual one. Raises ParameterError."""
    name = given.get("board", DEFAULT)
    chosen = Parameter("board", DEFAULT, "", "", choices=tuple(PROFILES)).check(name)
    return load(str(chosen)).PARAMETERS


def check_all(given: Mapping[str, object]) -> dict[str, Value]:
    """Every parameter's value, for the board that is given. Raises ParameterError.

    A parameter of another board is refused by that board's name, an unknown one with the nearest.
    """
    table = table_for(given)
    for name in given:
        if name not in table.by_name and (owners := owners_of(name)):
            raise ParameterError(
                f"parameter '{name}' belongs to board {' and '.join(owners)}, not to"
                f" {table.board}; remove it"
            )
    return table.check_all(given)


def owners_of(parameter: str) -> list[str]:
    """Names of the boards that have this parameter."""
    return [name for name in PROFILES if parameter in load(name).PARAMETERS.by_name]
