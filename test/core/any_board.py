# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test bench in simulated time: a session, connected to the simulated robot of any board.

It is for tests of what may move or stop a robot.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from toys import line_board, request_board
from toys.line_robot import LineRobot
from toys.request_robot import RequestRobot

from omnibot_driver import core
from omnibot_driver.boards import PROFILES
from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.events import Event, Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.session import Session, SessionSettings

TICK_S = 0.01


class Robot(Protocol):
    """Interface of the simulated robots.

    ``way_m``: distance that the robot has really driven forward, in m.
    """

    @property
    def stands(self) -> bool: ...

    @property
    def way_m(self) -> float: ...

    def receive(self, data: bytes, now: float, channel: int) -> None: ...

    def advance(self) -> list[Packet]: ...


class OmniBotRobot:
    """The simulated OmniBot, with the interface of ``Robot``."""

    def __init__(self) -> None:
        from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

        self.board = SimulatedBoard(BoardSettings(running=True))

    @property
    def stands(self) -> bool:
        truth = self.board.truth
        return max(abs(truth.vx_mps), abs(truth.vy_mps), abs(truth.yaw_rate)) < 0.01

    @property
    def way_m(self) -> float:
        return self.board.truth.x_m

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.board.receive(data)

    def advance(self) -> list[Packet]:
        data = self.board.step()
        return [(0, data)] if data else []


def omnibot() -> tuple[Board, Any]:
    from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings

    return OmniBot(OmniBotSettings()), OmniBotRobot()


class LoisRobot:
    """The simulated LOIS ECU. ``steps``: encoder ticks of one turn of a wheel.

    ``late_s``: delay in s with which its robot follows a command.
    """

    # 0.5 s until a wheel turns, then another 0.5 s until the wheel has its speed.
    late_s = 0.75

    def __init__(self, firmware: Any, steps: int = 60) -> None:
        from omnibot_driver.simulator.lois_ecu import QUIRKS, LoisSettings, SimulatedLois

        settings = LoisSettings(quirks=QUIRKS[firmware], running=True, steps=steps)
        self.board = SimulatedLois(settings)

    @property
    def stands(self) -> bool:
        return self.board.standing

    @property
    def way_m(self) -> float:
        return self.board.truth.x_m

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.board.receive(data, now, channel)

    def advance(self) -> list[Packet]:
        return self.board.advance()


def lois_ecu(firmware: str) -> tuple[Board, Any]:
    from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
    from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

    return LoisEcuBoard(LoisEcuSettings()), LoisRobot(firmware)


class MartRobot:
    """The simulated MART controller. It runs five of its own ticks in one tick of the bench."""

    def __init__(self, firmware: Any) -> None:
        from omnibot_driver.simulator.mart import QUIRKS, MartSettings, SimulatedMart

        self.board = SimulatedMart(MartSettings(quirks=QUIRKS[firmware]))

    @property
    def stands(self) -> bool:
        return not self.board.server.moving

    @property
    def way_m(self) -> float:
        return self.board.server.chassis.x_m

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.board.receive(data, now, channel)

    def advance(self) -> list[Packet]:
        if self.board.server.wake_at > (self.board.ticks + 5) * self.board.tick_s:
            self.board.ticks += 5
            return []
        return [packet for _ in range(5) for packet in self.board.advance()]


def mart(firmware: str) -> tuple[Board, Any]:
    from omnibot_driver.core.mart import MartSettings
    from omnibot_driver.core.mart.board import MartBoard

    return MartBoard(MartSettings()), MartRobot(firmware)


class FejemisRobot:
    """The simulated Fejemis. It runs five of its own ticks in one tick of the bench."""

    def __init__(self, sums: bool) -> None:
        from omnibot_driver.simulator.fejemis import FejemisSettings, Firmware, SimulatedFejemis

        self.board = SimulatedFejemis(FejemisSettings(firmware=Firmware(sums=sums)))

    @property
    def stands(self) -> bool:
        return self.board.standing

    @property
    def way_m(self) -> float:
        return self.board.truth.x_m

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.board.receive(data, now, channel)

    def advance(self) -> list[Packet]:
        return [packet for _ in range(5) for packet in self.board.advance()]


def fejemis(*, sums: bool) -> tuple[Board, Any]:
    from omnibot_driver.core.fejemis.board import FejemisBoard
    from omnibot_driver.core.fejemis.settings import FejemisSettings

    return FejemisBoard(FejemisSettings()), FejemisRobot(sums)


MAKERS: dict[str, Callable[[], tuple[Board, Any]]] = {
    "omnibot": omnibot,
    "lois_ecu": lambda: lois_ecu("firmware"),
    "lois_ecu as documented": lambda: lois_ecu("documented"),
    "mart": lambda: mart("firmware"),
    "mart as documented": lambda: mart("documented"),
    "fejemis": lambda: fejemis(sums=True),
    "fejemis without sums": lambda: fejemis(sums=False),
    "two lines": lambda: (line_board.make({}), LineRobot()),
    "requests": lambda: (request_board.make({}), RequestRobot()),
}
"""For each board name, a function that makes a new board and its simulated robot."""
CORE = Path(core.__file__).parent
BOARDS = [
    name for name in MAKERS if (board := name.split()[0]) not in PROFILES or (CORE / board).is_dir()
]
"""Names of the boards to test. A board is left out if its folder has been removed."""


class AnyBench:
    """A session connected to a robot.

    ``hears``: whether the robot receives data; false if the line to it is cut.

    ``speaks``: whether the robot sends data.
    """

    def __init__(self, board: Board, robot: Robot) -> None:
        self.robot = robot
        settings = SessionSettings(
            limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
        )
        goals_too = {Authority.BASE, Authority.POSE} <= board.traits.authorities
        control = None if board.traits.own_odometry and goals_too else "velocity"
        self.session = Session(board, settings, run=True, control=control)
        self.now = 1000.0
        self.hears = self.speaks = True
        self.events: list[Event] = []
        self.written: list[Packet] = []

    def open(self) -> None:
        self.session.opened(self.now)
        self.settle()

    def close(self) -> None:
        self.session.closed(self.now)
        self.settle()

    def settle(self) -> None:
        for channel, data in self.session.take_output(self.now):
            self.written.append((channel, data))
            if self.hears:
                self.robot.receive(data, self.now, channel)
        self.events += self.session.take_events()

    def run(self, seconds: float) -> None:
        """Advance the simulated time by ``seconds``.

        As in the driver, the session is called only when data arrives, or at its time ``wake_at``.
        """
        wake_s = self.session.wake_at
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            packets = self.robot.advance()
            if packets and self.speaks:
                for channel, data in packets:
                    self.session.inbound.receive(data, self.now, channel)
                wake_s = self.session.wake_at
            wakes = self.now >= wake_s
            if wakes:
                self.session.tick(self.now)
            if packets or wakes:
                self.settle()
                wake_s = self.session.wake_at

    def stall(self, seconds: float) -> None:
        """Let the process stall for ``seconds``, and then read all data of this time at once."""
        waiting: list[Packet] = []
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            waiting += self.robot.advance()
        self.session.stood_still(seconds, self.now)
        for channel, data in waiting:
            self.session.inbound.receive(data, self.now, channel)
        self.settle()

    def run_until(self, predicate: Callable[[], bool], limit_s: float = 12.0) -> None:
        end = self.now + limit_s
        while not predicate():
            assert self.now < end, self.session.state
            self.run(TICK_S)

    def drive(self, vx: float = 0.3) -> None:
        self.session.command_twist(BodyTwist(vx, 0.0, 0.0), self.now)
        self.settle()

    def drive_on(self, vx: float = 0.3, seconds: float = 1.0) -> None:
        for _ in range(round(seconds / 0.1)):
            self.drive(vx)
            self.run(0.1)

    def estop(self, active: bool) -> None:
        self.session.estop(active, self.now)
        self.settle()

    @property
    def notices(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notice)]

    @property
    def odometry(self) -> list[OdometryEstimate]:
        return [event for event in self.events if isinstance(event, OdometryEstimate)]


def nominal(name: str) -> AnyBench:
    """Return a bench whose robot is at rest and accepts commands."""
    bench = AnyBench(*MAKERS[name]())
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.5)
    return bench
