# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of changes of speed limits and command timeout while the robot drives."""

from collections.abc import Callable

import pytest
from robots import driving
from session_bench import STOP, Bench

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings

TURNS_WHEELS = Bench.turn_wheels, (5.0, 0.0, 0.0)
DRIVES = Bench.drive, (0.4,)


@pytest.mark.parametrize(("command", "values"), [DRIVES, TURNS_WHEELS])
@pytest.mark.parametrize(
    "changed",
    [
        {"limits": SpeedLimits(linear_mps=0.0)},
        {"limits": SpeedLimits(angular_radps=0.1)},
        {"limits": SpeedLimits(wheel_radps=1.0)},
        {"commands": CommandSettings(timeout_s=0.2)},
    ],
)
def test_what_was_commanded_under_looser_ones_ends(
    command: Callable[..., None], values: tuple[float, ...], changed: dict[str, object]
) -> None:
    """The user lowers a limit or the timeout while the robot drives. The driver sends Stop.

    The driver accepts the next command.
    """
    bench = driving()
    command(bench, *values)
    bench.run(0.05)
    start = len(bench.written)
    bench.configure(**changed)
    assert bench.written_since(start) == STOP
    assert bench.notices[-1].startswith("robot stopped because a limit was lowered")
    bench.run(0.4)
    assert bench.written[-1][1] == STOP
    assert bench.still()
    start = len(bench.written)
    bench.turn_wheels(1.0, 1.0, 1.0)
    assert bench.written_since(start) != STOP


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"limits": SpeedLimits(linear_mps=1.0, angular_radps=1.0, wheel_radps=20.0)},
        {"limits": SpeedLimits(linear_mps2=0.5, angular_radps2=0.5)},
        {"commands": CommandSettings(timeout_s=2.0, rate_hz=50.0)},
    ],
)
def test_looser_ones_disturb_nobody(changed: dict[str, object]) -> None:
    """The robot drives on when a speed limit or the timeout becomes looser.

    It also drives on when the acceleration or the command rate changes, or when nothing changes.
    """
    bench = driving()
    start = len(bench.written)
    bench.drive(0.4)
    bench.configure(**changed)
    bench.run(0.2)
    assert STOP not in {data for _, data in bench.written[start:]}
    assert not bench.still()


def test_a_robot_that_stands_is_told_nothing() -> None:
    """A setting that becomes stricter causes no notice if the robot is not commanded to move.

    The robot has no command, or a zero command.
    """
    bench = driving()
    bench.drive()
    bench.configure(limits=SpeedLimits(linear_mps=0.1))
    bench.run(2.0)
    bench.configure(limits=SpeedLimits(linear_mps=0.05))
    assert bench.notices == []
