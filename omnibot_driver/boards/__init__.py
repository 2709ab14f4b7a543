# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The boards that the driver supports. Each has a profile, which is imported only if it is chosen.

A profile makes its board's objects. Outside the core, only the profile knows its board.
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
"""Modules of the profiles, by the value of the parameter ``board``."""
DEFAULT: Final = "omnibot"

Publish = Callable[[Any, int], None]
"""Function that publishes one value, of a type that only one board has. The second argument is the
stamp in ns of ROS time."""


class Profile(Protocol):
    """The functions and values of a board's profile, which is a module and not a class."""

    SIMULATOR: str
    """Package of the simulated board, to be imported where it is used."""

    PARAMETERS: Table
    """All parameters of the board."""

    def make(self, values: Mapping[str, Any]) -> Board:
        """Return a board object, made from checked parameter values."""

    def settings(self, values: Mapping[str, Any]) -> object:
        """Return these parameter values in the form that ``Board.settings`` expects."""

    def opener(self, values: Mapping[str, Any]) -> Callable[[], Transport]:
        """Return a function that opens the connection to the real board.

        Raises ParameterError if no attempt can succeed, however often it is repeated.
        """

    def kinematics(self, values: Mapping[str, Any]) -> Kinematics:
        """Return the kinematics of the wheels, from checked values."""

    def extras(self, node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Publish]:
        """Create the board's own ROS interfaces; return how to publish ``Extra`` values, by type.

        The driver calls this once, on the executor's thread, before bytes come.
        """


def load(name: str) -> Profile:
    """Return the profile with this name in ``PROFILES``."""
    return cast(Profile, import_module(PROFILES[name]))


def opener(profile: Profile, values: Mapping[str, Any]) -> Callable[[], Transport]:
    """Return a function that opens the board's port, or a simulated board for ``sim://``.

    Raises ParameterError if no attempt can succeed, however often it is repeated.
    """
    port = str(values["port"])
    if not port.lower().startswith("sim://"):
        return profile.opener(values)
    simulated = import_module("omnibot_driver.transports.simulated")
    simulated.check_address(port, profile.SIMULATOR)
    return partial(simulated.SimulatedTransport, port, profile.SIMULATOR)


def table_for(given: Mapping[str, object]) -> Table:
    """Return the parameters of the board that ``given`` names, or else of the default board.

    Raises ParameterError if there is no such board.
    """
    name = given.get("board", DEFAULT)
    chosen = Parameter("board", DEFAULT, "", "", choices=tuple(PROFILES)).check(name)
    return load(str(chosen)).PARAMETERS


def check_all(given: Mapping[str, object]) -> dict[str, Value]:
    """Return the values of all parameters of the given board.

    Raises ParameterError if a value is wrong, or if the board lacks a given parameter.
    """
    table = table_for(given)
    for name in given:
        if name not in table.by_name and (owners := owners_of(name)):
            raise ParameterError(
                f"parameter '{name}' belongs to board {' or '.join(owners)}, not to"
                f" {table.board}; remove it, or set the parameter `board`"
            )
    return table.check_all(given)


def owners_of(parameter: str) -> list[str]:
    """Return the names of the boards that have this parameter."""
    return [name for name in PROFILES if parameter in load(name).PARAMETERS.by_name]
