"""Every fault once, on the real node: the robot stands still in time and nothing false is said."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
import rclpy
from cases import ENDINGS, Case, survivable
from fuzz import fuzz
from rig import Rig
from walk import walk

CASES = survivable(seed=0)
GRACE_S = 0.5
"""Whoever tests may have a busy machine; ``make faults`` holds the driver to 0.1 s."""


@pytest.fixture(scope="module", autouse=True)
def _ros() -> Iterator[None]:
    ours = not rclpy.ok()
    if ours:
        rclpy.init()
    yield
    if ours:
        rclpy.shutdown()


@pytest.fixture(scope="module")
def rig(_ros: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with Rig(tmp_path_factory.mktemp("line"), grace_s=GRACE_S) as rig:
        yield rig


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_robot_stands_still_and_obeys_again(case: Case, rig: Rig) -> None:
    """While it lasts, and afterwards."""
    case(rig)
    rig.expect_obeys_again()
    assert not rig.findings.take(), rig.driver.output


def test_random_input_from_ros_does_not_disturb_the_node(rig: Rig) -> None:
    """A thousand messages and calls: the calls are answered and the board's frames come through."""
    fuzz(rig, 1000, Random(0))
    rig.expect_obeys_again()
    assert not rig.findings.take(), rig.driver.output


def test_faults_in_random_order_and_at_once(rig: Rig) -> None:
    """A short walk; the long ones are ``make faults`` and ``make soak``."""
    walk(rig, Random(0), steps=6)
    assert not rig.findings.take(), rig.driver.output


def test_nothing_was_published_that_was_not_sent(rig: Rig) -> None:
    """In all of the cases together; and the odometry never jumped."""
    rig.judge_stream(damaged_bytes=True)
    assert not rig.findings.take()
    assert rig.findings.published > 1000


@pytest.mark.parametrize("case", ENDINGS.values(), ids=ENDINGS)
def test_the_robot_stands_still_however_the_driver_ends(case: Case, tmp_path: Path) -> None:
    """Nobody is left to command it but the guard."""
    with Rig(tmp_path, grace_s=GRACE_S) as rig:
        case(rig)
        assert not rig.findings.take(), rig.driver.output
