# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that each quirk of the simulated LOIS ECU can be observed, and can be switched off.

A quirk is a deviation from the manual.
"""

from collections.abc import Callable
from dataclasses import fields, replace

import pytest
import sights_of_motion
import sights_of_talk
from lois_rig import Rig, ticks_in

from omnibot_driver.core.lois_ecu import (
    Ticks,
)
from omnibot_driver.simulator.lois_ecu import DOCUMENTED, FIRMWARE, Quirks

SEEN: dict[str, Callable[[Quirks], bool]] = {
    name: found
    for name, found in (vars(sights_of_motion) | vars(sights_of_talk)).items()
    if name in {field.name for field in fields(Quirks)}
}


def test_every_quirk_has_its_sight() -> None:
    """Every quirk of the simulated board has a detector."""
    assert set(SEEN) == {field.name for field in fields(Quirks)}


@pytest.mark.slow
@pytest.mark.parametrize("name", SEEN)
def test_a_quirk_is_seen_with_it_and_unseen_without(name: str) -> None:
    """A detector finds its quirk on the public firmware, but not if this quirk is switched off."""
    assert SEEN[name](FIRMWARE)
    assert not SEEN[name](replace(FIRMWARE, **{name: False}))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SEEN if name != "extra_settings"])
def test_a_quirk_is_unseen_on_a_board_as_documented(name: str) -> None:
    """A board that follows the manual has no quirks. No detector finds a quirk on this board."""
    assert not SEEN[name](DOCUMENTED)


def test_ticks_in_finds_the_reports_of_ticks() -> None:
    """After a drive, ``ticks_in`` finds the reports of encoder ticks among the board's lines.

    The detectors of several quirks rely on this.
    """
    rig = Rig().booted()
    rig.drive(20, 20, 3.0)
    assert isinstance(ticks_in(rig.run(0.5))[-1], Ticks)
