# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures of the system tests: real driver processes, a real pseudo-terminal and real DDS."""

import os
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest
from driver_process import PATIENCE_S, Driver
from probe import Probe, ros
from std_srvs.srv import SetBool

from omnibot_driver.shared_session import WAITED

if TYPE_CHECKING:
    from omnibot_driver.simulator.omnibot import PtyBoard

UNHEARD = "motion command refused: no data from the board"


@pytest.fixture(scope="session", autouse=True)
def _ros() -> Iterator[None]:
    with ros():
        yield


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """A stack of context managers. The end of the test closes them in reverse order."""
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def start_board(stack: ExitStack) -> "Callable[..., PtyBoard]":
    from omnibot_driver.simulator.omnibot import BoardSettings, PtyBoard, SimulatedBoard

    def start(*, link: str | None = None, **settings: Any) -> PtyBoard:
        return stack.enter_context(PtyBoard(SimulatedBoard(BoardSettings(**settings)), link))

    return start


@pytest.fixture
def start_driver(stack: ExitStack) -> Callable[..., Driver]:
    def start(port: str | None, **parameters: Any) -> Driver:
        return stack.enter_context(Driver(port=port, **parameters))

    return start


@pytest.fixture
def probe_of(stack: ExitStack) -> Callable[[Driver], Probe]:
    """Return a function that starts a probe: a ROS node that observes and commands one driver.

    The probe repeats a message that the driver refused because of a stall, and a service call whose
    answer was lost.
    """

    def start(driver: Driver) -> Probe:
        probe = stack.enter_context(Probe.of(driver))
        driver.answers[WAITED] = driver.answers[UNHEARD] = probe.publish_again
        return probe

    return start


@pytest.fixture
def board(start_board: "Callable[..., PtyBoard]") -> "PtyBoard":
    return start_board()


@pytest.fixture
def driver(board: "PtyBoard", start_driver: Callable[..., Driver]) -> Driver:
    return start_driver(board.path)


@pytest.fixture
def probe(driver: Driver, probe_of: Callable[[Driver], Probe]) -> Probe:
    probe = probe_of(driver)
    probe.wait_for_state("nominal")
    return probe


@pytest.fixture(scope="module")
def shared(_ros: None) -> Iterator[tuple["PtyBoard", Driver]]:
    """A board and its driver, which several tests of a module use."""
    from omnibot_driver.simulator.omnibot import PtyBoard, SimulatedBoard

    with PtyBoard(SimulatedBoard()) as board, Driver(port=board.path) as driver:
        yield board, driver


@pytest.fixture
def shared_probe(
    shared: tuple["PtyBoard", Driver], probe_of: Callable[[Driver], Probe]
) -> Iterator[Probe]:
    """A probe of the shared driver, for one test.

    When the test begins, the robot is at rest, the e-stop is released, and no earlier commands and
    output are stored. Afterwards, the e-stop is latched.
    """
    board, driver = shared
    probe = probe_of(driver)
    probe.wait_for_state("nominal")
    for data in (True, False):  # discards the command of the previous test
        assert probe.call(SetBool, "estop", data=data).success
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    with board.lock:
        board.board.commands.clear()
    driver.lines.clear()
    yield probe
    if driver.process.poll() is None:
        probe.call(SetBool, "estop", data=True)


@pytest.fixture
def silent_terminal() -> Iterator[tuple[int, str]]:
    """Yield a pseudo-terminal without a board: the descriptor of the board's end, and the name."""
    far, near = os.openpty()
    tty.setraw(near)
    yield far, os.ttyname(near)
    os.close(far)
    os.close(near)


@pytest.fixture
def silent_port(silent_terminal: tuple[int, str]) -> str:
    return silent_terminal[1]


@pytest.fixture
def write_to_silent_port(silent_terminal: tuple[int, str]) -> Callable[[bytes], None]:
    """Return a function that writes all bytes to the port, even if the driver reads slowly."""

    def write(data: bytes) -> None:
        while data:
            data = data[os.write(silent_terminal[0], data[:1024]) :]

    return write
