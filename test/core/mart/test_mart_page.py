# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test that the protocol page shows where the driver uses each command, or why not."""

import re
from pathlib import Path

from omnibot_driver.core.mart import WORDS, Kind
from omnibot_driver.core.mart.words import NEVER_SAID

PAGE = Path(__file__).parents[3] / "docs/internals/mart_protocol.md"


def test_every_command_has_its_row() -> None:
    """The protocol page has a row for every command, and marks those that the driver never sends.

    The marked commands are those in ``NEVER_SAID``, and TD.
    """
    section = PAGE.read_text(encoding="utf-8").split("## Every command")[1].split("\n## ")[0]
    rows = re.findall(r"^\| ([A-Z][A-Z ,]*) \| (.+) \|$", section, re.MULTILINE)
    listed = {name: ("never" in used) for names, used in rows for name in names.split(", ")}
    said = {word.text for word in WORDS if word.kind is not Kind.CHECK}
    assert said | set(NEVER_SAID) <= set(listed)
    assert all(listed[name] for name in NEVER_SAID)
    assert {name for name in said if listed[name]} == {"TD"}
