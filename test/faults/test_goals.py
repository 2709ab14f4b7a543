# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of faults with a board under position control."""

from collections.abc import Callable, Iterator
from random import Random

import pytest
from goals import GOALS
from omnibot_board import BOARD
from other_rigs import GoalRig
from walk import walk

SOME_GOALS = (
    "a goal, and the wire from the board is cut",
    "a goal, and unplugged, plugged in",
    "a goal, and the kernel's buffer is full",
    "a goal, and e-stop and release",
    "a goal, and the driver hangs and continues",
)
"""Names of the cases that this module tests. ``make faults`` runs all cases.

The module test_position_control has tests of other cases, without a real port.
"""


@pytest.fixture(scope="module")
def goals(
    _ros: None, tmp_path_factory: pytest.TempPathFactory, lenience: dict[str, float]
) -> Iterator[GoalRig]:
    with GoalRig(tmp_path_factory.mktemp("goals"), BOARD, **lenience) as rig:
        rig.wait_ticks(100)
        yield rig


@pytest.mark.parametrize("case", [GOALS[name] for name in SOME_GOALS], ids=SOME_GOALS)
def test_a_goal_is_discarded_and_a_fresh_one_is_pursued(
    case: Callable[[GoalRig], None], goals: GoalRig
) -> None:
    """After an event such as a cut cable, the goal is discarded and never sent again.

    A new goal moves the robot.
    """
    case(goals)
    goals.expect_obeys_again()
    assert not goals.findings.take(), goals.driver.output


def test_goals_are_pursued_by_what_was_sent(goals: GoalRig) -> None:
    """In all tests of this module, the driver has published only readings that the board sent.

    The tests share one driver.
    """
    goals.judge_stream()
    assert not goals.findings.take(), goals.driver.output
    assert goals.findings.published > 50


def test_goals_and_faults_in_random_order(goals: GoalRig) -> None:
    """Faults occur in random order under position control.

    The robot stops in time, and then obeys a fresh command.
    """
    walk(goals, Random(1), steps=3)
    goals.judge_stream(damaged_bytes=True)
    assert not goals.findings.take(), goals.driver.output
