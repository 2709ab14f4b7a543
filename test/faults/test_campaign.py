# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Nearly every fault once: the robot is at rest in time, and nothing false is published."""

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
    "the kernel's buffer is full, and the board silent",
    "TwistStamped where Twist is expected",
}
"""Cases that are similar to others; ``make faults`` has them all."""
CASES = {name: case for name, case in survivable(seed=0).items() if name not in LEFT_OUT}


@pytest.fixture(scope="module")
def rig(
    _ros: None, tmp_path_factory: pytest.TempPathFactory, lenience: dict[str, float]
) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("line"), BOARD, **lenience) as rig:
        yield rig


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_robot_stands_still_and_obeys_again(case: Case[Rig], rig: Rig) -> None:
    """The robot must be at rest during the fault, and obey again after it."""
    case(rig)
    rig.expect_obeys_again()
    assert not rig.findings.take(), rig.driver.output


def test_random_input_from_ros_does_not_disturb_the_node(rig: Rig) -> None:
    """Of 1000 messages and calls, the calls are answered, and the board's frames are published."""
    fuzz(rig, 1000, Random(0))
    rig.expect_obeys_again()
    assert not rig.findings.take(), rig.driver.output


def test_faults_in_random_order_and_at_once(rig: Rig) -> None:
    """This is a short walk; ``make faults`` and ``make soak`` have long ones."""
    walk(rig, Random(0), steps=6)
    assert not rig.findings.take(), rig.driver.output


def test_nothing_was_published_that_was_not_sent(rig: Rig) -> None:
    """This holds for all cases together; odometry has not jumped either."""
    rig.judge_stream(damaged_bytes=True)
    assert not rig.findings.take()
    assert rig.findings.published > 1000
