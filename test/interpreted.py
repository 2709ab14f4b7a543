# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Marks for tests that need the interpreted core, and for tests that need the compiled core."""

import pytest

from omnibot_driver.selfcheck import core_kind

INTERPRETED = core_kind() == "interpreted"

interpreted_only = pytest.mark.skipif(
    not INTERPRETED,
    reason="the core is compiled, and the test replaces, counts or inspects Python functions",
)
compiled_only = pytest.mark.skipif(INTERPRETED, reason="the core is not compiled: make compiled")
