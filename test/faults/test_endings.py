# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the ways in which the driver ends. After each of them, the robot is at rest."""

from pathlib import Path

import pytest
from endings import ENDINGS, Ending, terminal_is_closed
from goals import GOAL_ENDINGS
from omnibot_board import BOARD
from other_rigs import GoalRig
from rig import Rig

SOME = (
    "ctrl-C, plugged in but not yet open again",
    "SIGTERM while a call is pending",
    "SIGINT, SIGTERM, SIGKILL to its process group",
    "an exit in a callback",
    "a callback that hangs, and ctrl-C",
    "a final Stop that hangs, and ctrl-C",
    "an exception while the port is full",
    "SIGKILL while the port is full",
    "a segmentation fault",
)
"""Names of the ways to end the driver that this module tests.

test_driver_endings and test_driver_guard test other ways.
"""


@pytest.mark.parametrize("ending", [ENDINGS[name] for name in SOME], ids=SOME)
def test_the_robot_stands_still_however_the_driver_ends(
    ending: Ending, tmp_path: Path, lenience: dict[str, float]
) -> None:
    """The driver ends during a drive. The board receives Stop last, and the exit code is right."""
    with Rig(tmp_path, BOARD, before=ending.before, **lenience) as rig:
        ending(rig)
        assert not rig.findings.take(), rig.driver.output


def test_a_terminal_that_is_closed_ends_the_driver_in_order(
    tmp_path: Path, lenience: dict[str, float]
) -> None:
    """If the driver's terminal is closed, the driver still stops the robot and exits with code 0.

    The driver gets SIGHUP, and can no longer print.
    """

    def run(rig: Rig, end: Ending) -> None:
        end(rig)
        assert not rig.findings.take()

    terminal_is_closed(lambda before: Rig(tmp_path, BOARD, before=before, **lenience), run)


def test_a_goal_ends_with_the_driver(tmp_path: Path, lenience: dict[str, float]) -> None:
    """The driver is killed while the board drives to a goal. The robot stops.

    Otherwise the board would drive on to the goal.
    """
    with GoalRig(tmp_path, BOARD, **lenience) as rig:
        GOAL_ENDINGS["a goal, and SIGKILL"](rig)
        assert not rig.findings.take(), rig.driver.output
