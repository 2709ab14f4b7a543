# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test bench in simulated time: a session connected to a simulated OmniBot."""

from dataclasses import replace
from typing import Any, Literal

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.commands.shaping import ControlMethod
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.packets import joined
from omnibot_driver.core.requests import OnExit, Request, RequestDone
from omnibot_driver.core.session import Session, SessionSettings
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

TICK_S = 0.01
ZEROS = bytes(8)
STOP = ZEROS + bytes.fromhex("FF FE 02 00 00 00 00 00 00")
EMERGENCY_STOP = ZEROS + bytes.fromhex("FF FE 10 00 00 00 00 00 00")
START, PAUSE, RESET = ZEROS + b"S", ZEROS + b"P", ZEROS + b"R"
OPENING = STOP


def bare(data: bytes) -> bytes:
    """Return ``data`` without the zeros that the driver sends before each frame."""
    return data.lstrip(b"\0")


class Bench:
    """A session connected to a simulated OmniBot.

    ``hears``: whether the board receives data.

    ``obeys``: False if the session replays a recording, which cannot follow commands.

    ``speaks``: whether the board sends data.
    """

    def __init__(
        self,
        board: BoardSettings | None = None,
        *,
        run: bool = True,
        axis_signs: tuple[int, int, int] = (1, 1, 1),
        limits: SpeedLimits | None = None,
        use_board_pose: bool = True,
        control: ControlMethod | None = None,
        obeys: bool = True,
    ) -> None:
        self.board = SimulatedBoard(board or BoardSettings())
        frame, period_s = self.board.settings.frame, self.board.settings.delta_period_s
        self.settings = SessionSettings(
            limits=limits or SpeedLimits(),
            commands=CommandSettings(),
            odometry=OdometrySettings(use_board_pose=use_board_pose),
        )
        self.session = Session(
            OmniBot(OmniBotSettings(delta_frame=frame, delta_period_s=period_s)),
            self.settings,
            run=run,
            axis_signs=axis_signs,
            control=control or self.board.settings.control,
            obeys=obeys,
        )
        self.now = 1000.0
        self.hears = self.speaks = True
        self.events: list[Event] = []
        self.written: list[tuple[float, bytes]] = []

    def open(self) -> None:
        self.session.opened(self.now)
        self.settle()

    def close(self) -> None:
        self.session.closed(self.now)
        self.settle()

    def settle(self) -> None:
        """Write the session's output and collect its events, as the driver does after an input."""
        data = joined(self.session.take_output(self.now))
        if data:
            self.written.append((self.now, data))
            if self.hears:
                self.board.receive(data)
        self.events += self.session.take_events()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            data = self.board.step()
            if data and self.speaks:
                self.session.inbound.receive(data, self.now)
            if self.now >= self.session.wake_at:
                self.session.tick(self.now)
            self.settle()

    def run_until_state(self, state: str, limit_s: float = 12.0) -> None:
        end = self.now + limit_s
        while self.session.state != state:
            assert self.now < end, f"still {self.session.state}, not {state}"
            self.run(TICK_S)

    def drive(
        self, vx: float = 0.0, vy: float = 0.0, yaw_rate: float = 0.0, *, age_s: float = 0.0
    ) -> None:
        self.session.command_twist(BodyTwist(vx, vy, yaw_rate), self.now, age_s=age_s)
        self.settle()

    def turn_wheels(self, a: float, b: float, c: float) -> None:
        self.session.command_wheels((a, b, c), self.now)
        self.settle()

    def ask(self, request: Request, limit_s: float) -> RequestDone:
        token = object()
        self.session.request(request, token, self.now)
        self.settle()
        end = self.now + limit_s
        while True:
            for event in self.events:
                if isinstance(event, RequestDone) and event.token is token:
                    return event
            assert self.now < end, f"no answer to {request.value} within {limit_s} s"
            self.run(TICK_S)

    def configure(self, **changed: Any) -> None:
        """Change these fields of SessionSettings.

        All other fields get their values from ``self.settings``.
        """
        self.session.configure(replace(self.settings, **changed), self.now)
        self.settle()

    def configure_board(self, **changed: Any) -> None:
        """Replace the driver's OmniBotSettings. ``changed``: values of fields.

        ``delta_frame`` and ``delta_period_s`` are those of the simulated board. All other fields
        get their default values.
        """
        board = self.board.settings
        settings = OmniBotSettings(
            delta_frame=board.frame, delta_period_s=board.delta_period_s, **changed
        )
        self.session.configure(self.settings, self.now, board=settings)
        self.settle()

    def read_deltas_as(self, frame: Literal["earth", "body"]) -> None:
        """Let the driver interpret deltas as displacements in ``frame``."""
        self.session.configure(self.settings, self.now, board=OmniBotSettings(delta_frame=frame))

    def last_words(self, on_exit: OnExit) -> bytes:
        """Return the last bytes that the driver writes at shutdown, before it closes the port."""
        return joined(self.session.shutdown.sequence(on_exit, self.now))

    def written_since(self, mark: int) -> bytes:
        """Return what was written to the board after the first ``mark`` writes of the test."""
        return b"".join(data for _, data in self.written[mark:])

    def still(self) -> bool:
        truth = self.board.truth
        return max(abs(truth.vx_mps), abs(truth.vy_mps), abs(truth.yaw_rate)) < 0.01

    def go_to(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        self.session.command_pose(Pose(x_m, y_m, yaw_rad), self.now)
        self.settle()

    @property
    def notices(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notice)]

    @property
    def odometry(self) -> list[OdometryEstimate]:
        return [event for event in self.events if isinstance(event, OdometryEstimate)]
