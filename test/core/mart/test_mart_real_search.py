# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Some trials of ``real_search``, which runs the real driver against the simulated server.

In most trials, one datagram is lost, late or doubled, the IMU dies, or the network is interrupted.
"""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest
import real_search
from real_search import FATES, WISHES, Trial, each_fate, trouble

from omnibot_driver.core.mart import states, words
from omnibot_driver.core.mart.imu_proof import ImuProof
from omnibot_driver.core.mart.pilot import Pilot
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.mart.stopping import Stopping
from omnibot_driver.core.packets import Packets

pytestmark = pytest.mark.slow


# The eight seeds include each fault, and each kind of command as the first one.
@pytest.mark.parametrize("seed", range(8))
def test_one_datagram_that_is_lost_late_or_doubled_hangs_nothing(seed: int) -> None:
    """A single fault in a trial with two user commands does no harm.

    * A datagram is lost, late or doubled: the server does not hang, and the robot rests.
    * The IMU dies: no motion begins more than 0.25 s later. The robot rests, or the driver reports
      a lost server.
    """
    random, names = Random(seed), list(WISHES)
    wishes = (names[seed % len(names)], random.choice(names))
    fate = FATES[seed % len(FATES)]
    trial = random.choice([trial for trial in each_fate(wishes) if trial.fate == fate])
    assert trouble(trial) == ""


@pytest.mark.parametrize("seed", range(8))
def test_a_driver_that_begins_without_a_network_hangs_no_server(seed: int) -> None:
    """A driver starts while the robot may be moving, and the network is interrupted.

    The server does not hang, and the robot rests at the end.
    """
    trial = Random(seed).choice(list(real_search.beginnings()))
    assert trouble(trial) == ""


def test_the_network_comes_back_between_the_stops_and_the_stop_port() -> None:
    """The network loses the first stops, and the driver sends SL (stop port) in their place.

    After SL, the driver does not send SRM, the usual stop of a forward drive. SRM would then hang
    the server.
    """
    assert trouble(Trial(met=b"RM 30", away_s=3.6, ways=(0,))) == ""
    assert trouble(Trial(met=b"RM 30", away_s=6.8, back_s=0.7)) == ""


Patch = Callable[[Any, str, Any], None]


def sweeps_again(patch: Patch) -> None:
    """Patch the driver: after SL (stop by the stop port), it at once sends the stops SRM and SM.

    This can hang the server, so the real driver first finds out which motion is in progress.
    """
    patch(Pilot, "_ask_what_moves", Pilot._sweep)


def says_sl_before_sm(patch: Patch) -> None:
    due = Stopping.due

    def trapped(stopping: Stopping, now: float) -> tuple[words.Word, ...]:
        said = due(stopping, now)
        return (words.SL, *said) if words.SM in said else said

    patch(Stopping, "due", trapped)


def turns_within_rm(patch: Patch) -> None:
    """Patch the driver: from a forward drive, it starts a turn on the spot (L) without a stop."""
    agrees, act = Pilot._agrees, Pilot._act

    def spins(pilot: Pilot, now: float) -> bool:
        return pilot.state is State.DRIVING and pilot._wish(now)[0] is Motion.SPIN

    def trapped(pilot: Pilot, now: float) -> Packets:
        if spins(pilot, now):
            return pilot._begin(words.L.request("SLOW"), now)
        return act(pilot, now)

    patch(Pilot, "_agrees", lambda pilot, now: agrees(pilot, now) or spins(pilot, now))
    patch(Pilot, "_act", trapped)
    allowed = {*states.MAY_SAY[State.DRIVING], words.L}
    patch(states, "MAY_SAY", {**states.MAY_SAY, State.DRIVING: frozenset(allowed)})


def starts_without_proof(patch: Patch) -> None:
    patch(ImuProof, "fresh", lambda imu, now: True)


TRAPS = {
    "SRM behind SL": (sweeps_again, Trial(met=b"RM 30", away_s=3.6, ways=(0,)), "server hangs"),
    "SM behind SL": (sweeps_again, Trial(met=b"B SLOW", away_s=3.6, ways=(0,)), "server hangs"),
    "SL before SM": (says_sl_before_sm, Trial(("backward", "stop")), "server hangs"),
    "L in RM": (turns_within_rm, Trial(("forward", "left")), "server hangs"),
    "no proof": (
        starts_without_proof,
        Trial(("e-stop", "forward"), 0, 0, "the IMU dies"),
        "a motion begins with a dead IMU",
    ),
}


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_that_is_planted_in_the_pilot_is_found(
    trap: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A trial passes with the real driver. With a deliberate defect in the driver, it fails."""
    plant, trial, found = TRAPS[trap]
    assert trouble(trial) == ""
    plant(monkeypatch.setattr)
    assert found in trouble(trial)
