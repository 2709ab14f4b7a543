# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a tool says when a library is missing."""

import json

import pytest

from omnibot_driver.tools.needs import ToolError, need


def test_a_library_that_is_there_is_imported() -> None:
    """As ``import`` would."""
    assert need("json") is json


def test_a_library_that_is_missing_is_named_with_what_installs_it() -> None:
    """Its own name, not the submodule's."""
    with pytest.raises(ToolError, match="library no_such_library: `pip install no_such_library`"):
        need("no_such_library.part")
