# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulator's old names, which can still be imported for one release."""

import subprocess
import sys
from pathlib import Path

import pytest

from omnibot_driver import simulator
from omnibot_driver.simulator import omnibot

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", simulator.__all__)
def test_a_name_is_found_where_it_was_with_a_warning(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An old name gives the same object as the new one. A warning says the new name."""
    monkeypatch.delitem(vars(simulator), name, raising=False)
    with pytest.warns(DeprecationWarning, match=r"from omnibot_driver\.simulator\.omnibot"):
        assert getattr(simulator, name) is getattr(omnibot, name)
    monkeypatch.delitem(vars(simulator), name)


def test_a_name_that_never_was_there_is_not_found() -> None:
    """A name that never existed raises an AttributeError, as in any module."""
    with pytest.raises(AttributeError, match="has no attribute 'wheels'"):
        _ = simulator.wheels


def test_no_board_is_imported_before_it_is_asked_for() -> None:
    """A program imports the simulator, but no board. This import does not load the OmniBot."""
    program = "import sys, omnibot_driver.simulator; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert "omnibot_driver.simulator" in done.stdout.split()
    assert "omnibot_driver.simulator.omnibot" not in done.stdout
