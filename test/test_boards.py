# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Each kind of board meets the rest of the driver in its profile alone."""

import ast
from pathlib import Path

import pytest

from omnibot_driver import boards, parameters
from omnibot_driver.core.errors import ParameterError
from omnibot_driver.simulator.__main__ import boards as simulated_boards
from omnibot_driver.simulator.common import options

PACKAGE = Path(boards.__file__).parent.parent
KNOW_BOARDS = ("boards", "simulator", "urls", "tools", "demo", "parameters", *boards.PROFILES)
"""Folders. What is left in parameters, simulator and tools of one board moves to it in time."""


def imported(path: Path) -> set[str]:
    """The modules that this one imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


@pytest.mark.parametrize(
    "path",
    [
        path
        for path in sorted(PACKAGE.rglob("*.py"))
        if not set(path.relative_to(PACKAGE).parts) & set(KNOW_BOARDS)
    ],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_common_code_imports_no_board(path: Path) -> None:
    """Session, link, node and all the others take what the profile made."""
    known = {
        f"omnibot_driver.{place}.{name}" for place in ("core", "boards") for name in boards.PROFILES
    }
    assert not {name for name in imported(path) for one in known if name.startswith(one)}


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_profile_makes_its_board_of_the_defaults(name: str) -> None:
    """With a kinematics whose joints are the wheels that can be commanded."""
    values = parameters.check_all({"board": name})
    profile = boards.load(name)
    board = profile.make(values)
    assert board.settings == profile.settings(values)
    assert len(profile.kinematics(values).joints) == len(board.traits.wheels)


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_profile_names_its_simulated_board(name: str) -> None:
    """It is the one that ``simulator --board`` runs by the same name."""
    module = boards.load(name).SIMULATOR
    assert module == f"omnibot_driver.simulator.{name}"
    assert name in simulated_boards()
    board, _ = options.from_words([], options.load(module))
    assert board.facts.keys() >= {"x_m", "y_m", "yaw_rad"}


def test_a_board_that_is_not_built_is_refused_by_name() -> None:
    """In one sentence, with those that are."""
    with pytest.raises(ParameterError, match="'board' must be one of omnibot, not 'mart'"):
        parameters.check_all({"board": "mart"})
    assert tuple(boards.PROFILES) == parameters.BY_NAME["board"].choices
