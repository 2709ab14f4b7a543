# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the driver reads each parameter, so that setting it has an effect."""

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from omnibot_driver import boards

PACKAGE = Path(boards.__file__).parent.parent
PROGRAMS = {"demo", "simulator", "tools"}
"""Folders of programs that do not receive the driver's parameters."""


class Watched(Mapping[str, Any]):
    """A mapping that records in ``read`` the keys whose values are read."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values, self.read = values, set[str]()

    def __getitem__(self, key: str) -> Any:
        self.read.add(key)
        return self._values[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)


@cache
def strings(file: Path) -> tuple[set[str], set[str]]:
    """Return the strings of a module, and its patterns. Names in parameter definitions are omitted.

    An f-string such as ``f"{kind}_minimum"`` is a pattern that matches every ``kind``.
    """
    found, patterns, rows = set[str](), set[str](), set[int]()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Parameter":
            rows.update(id(argument) for argument in node.args[:1])
        elif isinstance(node, ast.JoinedStr):
            parts = [
                re.escape(part.value) if isinstance(part, ast.Constant) else r"\w+"
                for part in node.values
            ]
            if max(map(len, parts)) > len(r"\w+"):
                patterns.add("".join(parts))
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in rows
        ):
            found.add(node.value)
    return found, patterns


def own_files(board: str) -> Iterator[Path]:
    """Yield the driver's modules that may read a parameter of this board."""
    for file in PACKAGE.rglob("*.py"):
        parts = file.relative_to(PACKAGE).parts
        others = tuple(name for name in boards.PROFILES if name != board)
        of_another = (
            len(parts) > 1 and parts[0] in {"boards", "core"} and parts[1].startswith(others)
        )
        if not of_another and not PROGRAMS & set(parts):
            yield file


@pytest.mark.parametrize("board", boards.PROFILES)
def test_every_parameter_is_read(board: str) -> None:
    """Every parameter of a board has an effect.

    It is a setting of the board, or its name occurs in the driver's code outside its definition.
    """
    profile = boards.load(board)
    watched = Watched(boards.check_all({"board": board}))
    profile.settings(watched)
    files = [strings(file) for file in own_files(board)]
    names = set[str]().union(*(each for each, _ in files))
    patterns = re.compile("|".join(set[str]().union(*(each for _, each in files))))
    without = [
        row.name
        for row in profile.PARAMETERS.rows
        if row.name not in watched.read | names and not patterns.fullmatch(row.name)
    ]
    assert not without, (
        f"no code reads these parameters, so they have no effect: {', '.join(without)}. Did you"
        f" fill the field in `settings` of boards/{board}.py?"
    )


UNLIKE_THE_ROW = {"mart": {"speed_per_unit"}, "fejemis": {"wheelbase_m"}}
"""For each board: the fields of its settings whose default differs from the parameter's default."""


@pytest.mark.parametrize("board", boards.PROFILES)
def test_the_settings_have_the_defaults_of_the_parameters(board: str) -> None:
    """A board's function ``settings`` makes the default settings from the default parameters.

    An exchange of two fields with different defaults in this function would change the result. The
    fields in ``UNLIKE_THE_ROW`` are exceptions: their defaults differ.
    """
    settings = boards.load(board).settings(boards.check_all({"board": board}))
    defaults = type(settings)()
    different = {
        field.name
        for field in fields(settings)
        if getattr(settings, field.name) != getattr(defaults, field.name)
    }
    assert different == UNLIKE_THE_ROW.get(board, set())


@pytest.mark.parametrize("board", boards.PROFILES)
def test_the_core_of_a_board_reads_all_of_its_settings(board: str) -> None:
    """Each field of a board's settings is read in the board's folder of the core."""
    settings = boards.load(board).settings(boards.check_all({"board": board}))
    read = {
        node.attr
        for file in (PACKAGE / "core" / board).glob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)
    }
    assert {field.name for field in fields(settings)} <= read
