# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A sample of the bounded search that drives the real pilot; ``real_search`` has all of it."""

from random import Random

import pytest
import real_search
from real_search import Trial, trouble

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", range(12))
def test_one_datagram_that_is_lost_late_or_doubled_hangs_nothing(seed: int) -> None:
    """Any of them, in any pair of wishes."""
    trial = Random(seed).choice(list(real_search.pairs()))
    assert trouble(trial) == ""


@pytest.mark.parametrize("seed", range(8))
def test_a_driver_that_begins_without_a_network_hangs_no_server(seed: int) -> None:
    """Whatever the robot does then, and whenever the network comes back."""
    trial = Random(seed).choice(list(real_search.beginnings()))
    assert trouble(trial) == ""


def test_the_network_comes_back_between_the_stops_and_the_stop_port() -> None:
    """SL ends RM then; SRM behind it would hang the server, and is not said."""
    assert trouble(Trial(met=b"RM 30", away_s=3.6, ways=(0,))) == ""
    assert trouble(Trial(met=b"RM 30", away_s=6.8, back_s=0.7)) == ""


@pytest.mark.parametrize(
    ("met", "away_s"), [(b"RM 30", 3.6), (b"B SLOW", 3.6)], ids=["SRM behind SL", "SM behind SL"]
)
def test_a_driver_that_sweeps_again_behind_the_stop_port_is_found(
    met: bytes, away_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A planted trap: the sweep of a driver that asks nothing first."""
    from omnibot_driver.core.mart.pilot import Pilot

    monkeypatch.setattr(Pilot, "_ask_what_moves", Pilot._sweep)
    assert trouble(Trial(met=met, away_s=away_s, ways=(0,))) == "the server hangs"
