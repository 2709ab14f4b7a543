# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of the rules for imports between the packages of the simulator."""

import ast
from pathlib import Path

import pytest

from omnibot_driver import simulator
from omnibot_driver.simulator.__main__ import boards

FOLDER = Path(simulator.__file__).parent
PACKAGE = simulator.__name__


def imported(folder: Path) -> set[str]:
    return {
        node.module
        for path in folder.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module
    }


@pytest.mark.parametrize("name", ["common", *boards()])
def test_a_package_imports_itself_and_what_all_share(name: str) -> None:
    """A board's package imports only itself and ``common``, so any board can be removed."""
    allowed = (f"{PACKAGE}.common", f"{PACKAGE}.{name}")
    ours = {module for module in imported(FOLDER / name) if module.startswith(PACKAGE)}
    assert not {module for module in ours if not module.startswith(allowed)}
