# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The boards that the driver supports.

Each board has a profile, a module that is imported only if the parameter ``board`` selects it. All
other modules outside the core must work with any board.
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
"""Names of the boards' profile modules, by the value of the parameter ``board``."""
DEFAULT: Final = "omnibot"

Publish = Callable[[Any, int], None]
"""Function that publishes one reading of a type that only one board has. Its arguments are the
reading and the reading's stamp, in ns of ROS time."""


class Profile(Protocol):
    """The functions and values that the profile of a board must have. A profile is a module."""

    SIMULATOR: str
    """Name of the package with the simulated board. The package is imported only when a
    simulated board is used."""

    PARAMETERS: Table
    """All parameters of the board."""

    def make(self, values: Mapping[str, Any]) -> Board:
        """Return a board object, made from checked parameter values."""

    def settings(self, values: Mapping[str, Any]) -> object:
        """Return the settings for ``Board.settings``, made from checked parameter values."""

    def opener(self, values: Mapping[str, Any]) -> Callable[[], Transport]:
        """Return a function that opens the connection to the real board.

        Raises ParameterError if the parameters name a port that can never be opened.
        """

    def kinematics(self, values: Mapping[str, Any]) -> Kinematics:
        """Return the kinematics of the wheels, from checked parameter values."""

    def extras(self, node: Any, link: Any, values: Mapping[str, Any]) -> Mapping[type, Publish]:
        """Create the board's own topics and services, and return its publishing functions.

        There is one function for each type of reading that only this board has. Call ``extras``
        once, on the executor's thread, before any bytes arrive.
        """


def load(name: str) -> Profile:
    """Import and return the profile of the board with this name."""
    return cast(Profile, import_module(PROFILES[name]))


def opener(profile: Profile, values: Mapping[str, Any]) -> Callable[[], Transport]:
    """Return a function that opens the board's port, or a simulated board for ``sim://``.

    Raises ParameterError if the parameters name a port that can never be opened.
    """
    port = str(values["port"])
    if not port.lower().startswith("sim://"):
        return profile.opener(values)
    simulated = import_module("omnibot_driver.transports.simulated")
    simulated.check_address(port, profile.SIMULATOR)
    return partial(simulated.SimulatedTransport, port, profile.SIMULATOR)


def table_for(given: Mapping[str, object]) -> Table:
    """Return the parameter table of the board that ``given`` names, or of the default board.

    ``given``: parameter values, by name. Raises ParameterError for an unknown board.
    """
    name = given.get("board", DEFAULT)
    chosen = Parameter("board", DEFAULT, "", "", choices=tuple(PROFILES)).check(name)
    return load(str(chosen)).PARAMETERS


def check_all(given: Mapping[str, object]) -> dict[str, Value]:
    """Return the values of all parameters of the board ``given["board"]``.

    Parameters that are not in ``given`` have their default values. Raises ParameterError for a
    wrong value, or for a parameter that this board does not have.
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
