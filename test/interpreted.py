# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Which core is tested, and the mark of tests that only make sense with one of them."""

import pytest

from omnibot_driver.selfcheck import core_kind

INTERPRETED = core_kind() == "interpreted"

interpreted_only = pytest.mark.skipif(
    not INTERPRETED,
    reason="it replaces, counts or looks into what compiled code has bound",
)
compiled_only = pytest.mark.skipif(INTERPRETED, reason="the core is not compiled: make compiled")
