# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of nearly every fault: the robot stops in time, and the driver publishes nothing false."""

from collections.abc import Iterator
from random import Random

import pytest
from cases import Case, survivable
from fuzz import fuzz
from omnibot_board import BOARD
from rig import Rig
from walk import walk

LEFT_OUT = {
    "an adapter that accepts no data for 3 s",
    "the kernel's buffer is full, and the board is silent",
    "TwistStamped where Twist is expected",
    "e-stop by topic; false does not release",
    "wheel_cmd has the wrong size",
    "~/pause with true, then false",
    "the driver hangs and continues (SIGSTOP, SIGCONT)",
}
"""Cases that this module omits. ``make faults`` runs all cases.

Each omitted case is similar to a case in this module or to a test in test/system.
"""
CASES = {
    name: case for name, case in survivable(seed=0, damaged_s=1.0).items() if name not in LEFT_OUT
}


@pytest.fixture(scope="module")
def rig(
    _ros: None, tmp_path_factory: pytest.TempPathFactory, lenience: dict[str, float]
) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("line"), BOARD, **lenience) as rig:
        yield rig


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_robot_stands_still_and_obeys_again(case: Case[Rig], rig: Rig) -> None:
    """A fault occurs during a drive, and the robot comes to rest.

    Afterwards it obeys a fresh command.
    """
    case(rig)
    rig.expect_moves_again()
    assert not rig.findings.take(), rig.driver.output


def test_random_input_from_ros_does_not_disturb_the_node(rig: Rig) -> None:
    """The driver gets 1000 random messages and calls.

    It answers all calls, and still publishes readings.
    """
    fuzz(rig, 1000, Random(0))
    rig.expect_obeys_again()
    assert not rig.findings.take(), rig.driver.output


def test_faults_in_random_order_and_at_once(rig: Rig) -> None:
    """Faults occur in random order, several at the same time. The robot stops in time.

    Afterwards it obeys a fresh command. ``make soak`` runs many more faults.
    """
    walk(rig, Random(0), steps=6)
    assert not rig.findings.take(), rig.driver.output


def test_nothing_was_published_that_was_not_sent(rig: Rig) -> None:
    """The other tests have caused faults. The driver has published only a few wrong messages.

    A few wrong messages are allowed, because some faults damage bytes. Odometry has not jumped.
    """
    rig.judge_stream(damaged_bytes=True)
    assert not rig.findings.take()
    assert rig.findings.published > 1000
