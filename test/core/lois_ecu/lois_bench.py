# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test bench: a session with a simulated LOIS ECU, in simulated time."""

from typing import Any

import pytest
from any_board import AnyBench, LoisRobot
from lois_drives import with_usual_periods

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Extra
from omnibot_driver.core.lois_ecu import RecordKind
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.simulator.lois_ecu import SimulatedLois

SETTINGS = SessionSettings(
    limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
)
FIRMWARE = pytest.mark.parametrize("firmware", ["documented", "firmware"])


class Bench(AnyBench):
    """A session with a simulated LOIS ECU, which has been in state nominal for 1.5 s.

    ``steps``: encoder ticks of one wheel turn. ``own_periods``: whether the board keeps its own
    report periods if ``settings`` has none.
    """

    def __init__(
        self,
        firmware: str,
        settings: LoisEcuSettings | None = None,
        *,
        steps: int = 60,
        own_periods: bool = False,
    ) -> None:
        self.lois = LoisRobot(firmware, steps)
        ours = settings or LoisEcuSettings()
        board = LoisEcuBoard(ours if own_periods else with_usual_periods(ours))
        super().__init__(board, self.lois)
        self.open()
        self.run_until(lambda: self.session.state == "nominal")
        self.run(1.5)

    @property
    def board(self) -> SimulatedLois:
        return self.lois.board

    def reset(self) -> RequestDone:
        self.session.request(Request.RESET, "token", self.now)
        self.settle()
        before = len(self.answers)
        self.run_until(lambda: len(self.answers) > before)
        return self.answers[-1]

    def record(self, kind: RecordKind, samples: int) -> None:
        """Request a record."""
        board = self.session.board
        assert isinstance(board, LoisEcuBoard)
        board.record(kind, samples)

    @property
    def answers(self) -> list[RequestDone]:
        return [event for event in self.events if isinstance(event, RequestDone)]

    def presses(self, pressed: bool) -> None:
        self.board.press(pressed)
        self.run(0.5)


def told(bench: Bench, kind: type) -> list[Any]:
    """Return the values of type ``kind`` in the session's ``Extra`` events."""
    return [
        event.value
        for event in bench.events
        if isinstance(event, Extra) and isinstance(event.value, kind)
    ]


def configure(bench: Bench, settings: LoisEcuSettings) -> None:
    """Change the session's board settings, as the node does when parameters change."""
    bench.session.configure(SETTINGS, bench.now, board=with_usual_periods(settings))
    bench.settle()


def refusal(bench: Bench, vx: float = 0.3) -> str:
    """Return why the driver refuses a motion command; empty if it accepts the command."""
    try:
        bench.drive(vx)
    except CommandRefused as refused:
        return str(refused).removeprefix("motion command refused: ")
    return ""
