# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a board's own odometry, of its e-stop button, and of its reset."""

import math
from dataclasses import replace

import pytest
from any_board import AnyBench
from toys import line_board
from toys.line_robot import LineRobot

from omnibot_driver.core.board import Mode
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Extra
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.packets import Packets, packed
from omnibot_driver.core.readings import (
    DisplacementReading,
    EStopButtonReading,
    OdometryReading,
    Reading,
    ResetReading,
)
from omnibot_driver.core.requests import Request, RequestDone

STANDS = DisplacementReading(0.0, 0.0, 0.0, "body", 0.2, 0)


class Teller(line_board.LineBoard):
    """A substitute for a board, with its own odometry at 10 Hz.

    ``next``: readings that it returns when the next bytes arrive.
    """

    traits = replace(
        line_board.LineBoard.traits, own_odometry=True, requests=frozenset({Request.RESET})
    )

    def __init__(self) -> None:
        self.next: list[Reading] = []
        self.way_m = 0.0
        self._told_at = -math.inf

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        found = super().receive(data, now, channel)
        self.way_m += sum(
            reading.dx_m for reading in found if isinstance(reading, DisplacementReading)
        )
        told, self.next = self.next, []
        return found + told

    @property
    def wake_at(self) -> float:
        return self._told_at + 0.1 if self.mode is Mode.NOMINAL else math.inf

    def elapse(self, now: float) -> list[Reading]:
        self._told_at = now
        pose, twist = Pose(self.way_m, 0.0, 0.0), BodyTwist(0.1, 0.0, 0.0)
        return [OdometryReading(now, pose, twist, Covariance(), (0.01, 0.02), pose, None)]

    def reset_odometry(self) -> None:
        self.way_m = 0.0

    def reset(self) -> Packets:
        return self.stop() + packed(b"v 0 0\n")


@pytest.fixture
def bench() -> AnyBench:
    bench = AnyBench(Teller(), LineRobot())
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.5)
    return bench


def tell(bench: AnyBench, *readings: Reading) -> None:
    board = bench.session.board
    assert isinstance(board, Teller)
    board.next += readings
    bench.session.inbound.receive(b"", bench.now, 1)
    bench.settle()


def test_a_boards_own_odometry_is_passed_on_and_displacements_are_not(bench: AnyBench) -> None:
    """A board sends displacements and its own odometry. The driver publishes only this odometry.

    It publishes at the board's rate. The twist has the variances that the board reports.
    """
    before = len(bench.odometry)
    bench.drive_on(0.3, 2.0)
    told = bench.odometry[before:]
    assert len(told) == pytest.approx(20, abs=3)
    assert told[-1].pose.x_m > 0.3
    assert {estimate.twist_variances for estimate in told} == {(0.01, 0.02)}


def test_odometry_that_is_predicted_does_not_count_as_heard(bench: AnyBench) -> None:
    """The board sends nothing, but the driver still predicts odometry.

    A prediction is not data from the board. So the driver still regards the board as silent, and
    refuses commands.
    """
    bench.drive_on()
    bench.speaks = False
    with pytest.raises(CommandRefused, match=r"no data from the board|connecting"):
        bench.drive_on(seconds=5.0)
    assert bench.robot.stands


def test_resetting_odometry_resets_the_boards(bench: AnyBench) -> None:
    """The user resets the odometry. The board's own odometry then begins at zero."""
    bench.drive_on()
    bench.run(1.5)
    assert bench.odometry[-1].pose.x_m > 0.1
    bench.session.reset_odometry(bench.now)
    bench.run(0.2)
    assert bench.odometry[-1].pose.x_m == 0.0


def test_a_pressed_button_latches_the_estop_and_its_release_does_nothing(bench: AnyBench) -> None:
    """A user presses the robot's button and releases it. The press latches the e-stop.

    The release does not unlatch it. The driver publishes both events.
    """
    bench.drive_on()
    tell(bench, EStopButtonReading(True))
    assert bench.session.estop_active
    bench.run(1.0)
    tell(bench, EStopButtonReading(False))
    assert bench.session.estop_active
    assert bench.robot.stands
    told = [event.value for event in bench.events if isinstance(event, Extra)]
    assert told == [EStopButtonReading(True), EStopButtonReading(False)]
    assert "e-stop latched by the button on the robot" in bench.notices


def test_a_release_of_the_button_without_its_press_latches_the_estop(bench: AnyBench) -> None:
    """The message of a press is lost, so only the message of the release arrives.

    A release proves that the button was pressed before, so the driver latches the e-stop.
    """
    bench.drive_on()
    tell(bench, EStopButtonReading(False))
    assert bench.session.estop_active
    assert any("its release was reported, but not its press" in text for text in bench.notices)
    bench.estop(False)
    bench.drive_on()
    assert not bench.robot.stands


def test_a_reset_is_done_when_the_board_shows_it(bench: AnyBench) -> None:
    """The user requests a reset. A report of an earlier reset, from before the request, is ignored.

    The next report shows that the requested reset is done.
    """
    bench.session.request(Request.RESET, "token", bench.now)
    bench.settle()
    tell(bench, ResetReading())
    bench.run(0.3)
    assert not [event for event in bench.events if isinstance(event, RequestDone)]
    tell(bench, ResetReading())
    (done,) = [event for event in bench.events if isinstance(event, RequestDone)]
    assert (done.token, done.success) == ("token", True)
    bench.drive_on()
    assert not bench.robot.stands


def test_a_displacement_that_is_not_measured_proves_no_standstill() -> None:
    """A board reports displacements of zero, but marks them as not measured.

    These displacements do not prove a standstill.
    """
    proof = StopProof()
    proof.stopped(0.0)
    for step in range(1, 20):
        proof.look(replace(STANDS, measured=False), 0.2 * step)
    assert not proof.proved


def test_a_proof_takes_as_long_as_the_board_needs() -> None:
    """A proof of a standstill needs 0.6 s. Three zero displacements of 0.2 s each suffice."""
    proof = StopProof(0.6)
    proof.stopped(0.0)
    proved = []
    for step in range(1, 5):
        proof.look(STANDS, 0.2 * step)
        proved.append(proof.proved)
    assert proved == [False, False, True, True]


def test_the_estop_is_not_released_while_the_button_is_held(bench: AnyBench) -> None:
    """The robot's button is pressed, and the user tries to release the e-stop. The driver refuses.

    The driver still refuses after a reconnection, until the button is released.
    """
    tell(bench, EStopButtonReading(True))
    with pytest.raises(RequestRefused, match="release the button, then call again"):
        bench.estop(False)
    bench.close()
    bench.open()
    with pytest.raises(RequestRefused, match="press and release"):
        bench.estop(False)
    assert bench.session.estop_active
    bench.run_until(lambda: bench.session.state == "nominal")
    tell(bench, EStopButtonReading(False))
    assert bench.session.estop_active
    bench.estop(False)
    assert not bench.session.estop_active
    bench.drive_on()
    assert not bench.robot.stands
