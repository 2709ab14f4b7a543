# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a board's long tasks: only one runs at a time, and several events end it."""

from collections.abc import Callable

import pytest
from any_board import BOARDS, AnyBench, nominal

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.long_task import LongTask
from omnibot_driver.core.requests import RequestDone

NAME = next(name for name in BOARDS if name == "two lines")


def test_it_is_answered_once() -> None:
    """A task has one result. If it is ended again afterwards, the client gets no second result."""
    task = LongTask()
    task.begin("record", "token", 120.0, 5.0)
    assert task.is_current("token")
    assert task.progress(17.2) == "record: 12 s of at most 120 s"
    task.end("another", False, "")
    task.end("token", True, "a file")
    task.give_up("late")
    task.end("token", False, "")
    assert task.answers == [RequestDone("token", True, "a file")]
    assert task.progress(18.0) == ""


def test_a_second_one_is_refused() -> None:
    """The refusal of a second task names the task that is under way."""
    task = LongTask()
    task.begin("record of RPM", "one", 120.0, 0.0)
    with pytest.raises(RequestRefused, match="a record of RPM is under way"):
        task.begin("record of torque", "two", 120.0, 1.0)
    assert task.is_current("one")


def test_it_ends_when_its_time_is_over() -> None:
    """A task fails when its time is over, and not before."""
    task = LongTask()
    task.begin("record", "token", 120.0, 5.0)
    assert task.wake_at == 125.0
    task.tick(124.9)
    assert task.active
    task.tick(125.0)
    assert task.answers == [
        RequestDone(
            "token",
            False,
            "the record failed: the board did not complete it within 120 s; call again",
        )
    ]


def test_a_robot_that_stands_all_along_was_not_stopped() -> None:
    """A robot is at rest when a long task begins. The task continues when the robot is driven.

    When the robot is then stopped, the task fails. The message says that the robot was stopped.
    """
    task = LongTask()
    task.begin("record", "token", 120.0, 0.0)
    for driven in (False, False, True, True):
        task.watch(driven=driven)
    assert task.active
    task.watch(driven=False)
    assert "stopped" in task.answers[0].message


ENDS: dict[str, Callable[[AnyBench], object]] = {
    "stopped": lambda bench: bench.drive(0.0),
    "stopped during the request": lambda bench: bench.run(0.6),
    "e-stop": lambda bench: bench.estop(True),
    "port was lost": lambda bench: bench.close(),
    "check its power and cable": lambda bench: (setattr(bench, "speaks", False), bench.run(5.0)),
    "the driver stalled": lambda bench: (bench.session.stood_still(3.0, bench.now), bench.settle()),
}


@pytest.mark.parametrize("words", ENDS)
def test_a_stop_an_estop_and_a_lost_board_end_it(words: str) -> None:
    """A stop, an e-stop, a lost board or a stall ends the task, and the message says which."""
    bench = nominal(NAME)
    if "stopped" in words:
        bench.drive_on()
    bench.session.begin_task("record", "token", 120.0, bench.now)
    bench.settle()
    bench.run(0.05)
    assert bench.session.figures(bench.now).task
    ENDS[words](bench)
    (done,) = [event for event in bench.events if isinstance(event, RequestDone)]
    assert (done.token, done.success) == ("token", False)
    assert words in done.message
    assert not bench.session.task_is_current("token")


def test_none_is_begun_under_the_estop_or_without_a_board() -> None:
    """The driver refuses to begin a task while the e-stop is latched or the port is closed."""
    bench = nominal(NAME)
    bench.estop(True)
    with pytest.raises(RequestRefused, match="e-stop is latched"):
        bench.session.begin_task("record", "token", 120.0, bench.now)
    bench.estop(False)
    bench.close()
    with pytest.raises(RequestRefused, match="port is not open"):
        bench.session.begin_task("record", "token", 120.0, bench.now)
