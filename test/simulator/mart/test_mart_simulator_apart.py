# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that the simulated MART shares no code with the driver."""

import ast
from pathlib import Path

import pytest

from omnibot_driver.simulator import mart

MODULES = sorted(Path(mart.__file__).parent.glob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_no_module_imports_the_core(path: Path) -> None:
    """No module of the simulated controller imports the driver's core.

    If simulator and driver used the same parser, no test could detect a misread manual.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.module is not None
            assert not node.module.startswith("omnibot_driver.core")
