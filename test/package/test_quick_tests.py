# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that ``make check`` stays quick: its tests do not use ROS and try few examples."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
MOST_EXAMPLES = 200
"""Largest number of examples that a property-based test may try without the mark ``slow``."""


def quick_folders() -> list[str]:
    """Return the folders of the quick tests, which the Makefile names."""
    found = re.search(r"^QUICK := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert found
    return found[1].split()


def nodes_of_files_with(text: str) -> Iterator[tuple[str, ast.AST]]:
    """Search the quick tests for files with ``text``, and yield their syntax nodes.

    Each node comes with the name of its file.
    """
    for folder in quick_folders():
        for path in sorted((ROOT / folder).rglob("*.py")):
            if text in (source := path.read_text()):
                name = str(path.relative_to(ROOT))
                yield from ((name, node) for node in ast.walk(ast.parse(source)))


def test_none_of_them_imports_ros() -> None:
    """No file in the folders of the quick tests imports rclpy."""
    for name, node in nodes_of_files_with("rclpy"):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names]
            assert not any(one.split(".")[0] == "rclpy" for one in names), name


def test_a_property_of_many_examples_is_marked_slow() -> None:
    """A property-based test that tries many examples has the mark ``slow``.

    ``make check`` leaves out tests with this mark, so that it stays quick.
    """
    for name, node in nodes_of_files_with("max_examples="):
        if not isinstance(node, ast.FunctionDef):
            continue
        marks = [ast.unparse(decorator) for decorator in node.decorator_list]
        examples = [int(n) for mark in marks for n in re.findall(r"max_examples=(\d+)", mark)]
        if "pytest.mark.slow" not in marks:
            assert max(examples, default=0) <= MOST_EXAMPLES, f"{name}: {node.name}"
