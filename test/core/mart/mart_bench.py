# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A driver session and a simulated MART, in simulated time. The network between them may be bad."""

import math
from collections.abc import Callable
from typing import Any

from any_board import TICK_S as BENCH_TICK_S
from any_board import AnyBench, MartRobot

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Extra
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart import MartSettings as Settings
from omnibot_driver.core.mart.board import MartBoard
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults
from omnibot_driver.simulator.mart import QUIRKS, Firmware, MartSettings, SimulatedMart
from omnibot_driver.simulator.mart.board import TICK_S

POLLS = {b"ENC", b"RMRA", b"MCSTAT", b"VOLTS", b"SFC", b"SRC", b"DOCKED", b"HELLO"}


class NetworkRobot(MartRobot):
    """The simulated controller behind a network with faults."""

    def __init__(self, faults: NetworkFaults, seed: int, **settings: Any) -> None:
        self.board = SimulatedMart(MartSettings(seed=seed, **settings))
        self._heard = False
        self.network = [FaultyNetwork(faults, f"{seed} {channel}") for channel in (0, 1)]

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self._heard = True
        self.network[channel].to_board.send(data, self.board.now_s)

    def advance(self) -> list[Packet]:
        out: list[Packet] = []
        board = self.board
        last = board.ticks + 5
        due_s = self._due_s()
        if not self._heard and due_s > last * TICK_S:
            board.ticks = last
            return out
        self._heard = False
        while board.ticks < last:
            while board.ticks < last - 1 and due_s > (board.ticks + 1) * TICK_S:
                board.ticks += 1
            now_s = board.now_s
            for channel, way in enumerate(self.network):
                for data in way.to_board.arrived(now_s):
                    board.receive(data, now_s, channel)
            for channel, data in board.advance():
                self.network[channel].from_board.send(data, board.now_s)
            now_s = board.now_s
            for channel, way in enumerate(self.network):
                out += [(channel, data) for data in way.from_board.arrived(now_s)]
            due_s = self._due_s()
        return out

    def _due_s(self) -> float:
        """Return the board time, in s, of the next event in the board or the network."""
        command, stop = self.network
        return min(
            self.board.server.wake_at,
            command.to_board.next_s,
            command.from_board.next_s,
            stop.to_board.next_s,
            stop.from_board.next_s,
        )


def sleeps(board: SimulatedMart) -> bool:
    """Skip five ticks of the board if nothing is due in them. Return whether they were skipped."""
    if board.server.wake_at <= (board.ticks + 5) * TICK_S:
        return False
    board.ticks += 5
    return True


class MartBench(AnyBench):
    """A driver session with a simulated controller.

    ``server``: the simulated MART server, a part of that controller.
    """

    def __init__(
        self,
        firmware: Firmware = "firmware",
        faults: NetworkFaults | None = None,
        *,
        seed: int = 0,
        settings: Settings | None = None,
        **simulated: Any,
    ) -> None:
        robot = NetworkRobot(faults or NetworkFaults(), seed, quirks=QUIRKS[firmware], **simulated)
        super().__init__(MartBoard(settings or Settings()), robot)
        self.server = robot.board.server
        self.board: Any = self.session.board
        self._odometry: list[OdometryEstimate] = []
        self._sorted = 0
        self._wake_s = -math.inf

    def ready(self) -> "MartBench":
        """Connect, and wait until the session is nominal and the robot is known to stand still."""
        self.open()
        self.run_until(lambda: self.session.state == "nominal", 30.0)
        self.run(2.0)
        return self

    @property
    def odometry(self) -> list[OdometryEstimate]:
        new = self.events[self._sorted :]
        self._sorted += len(new)
        self._odometry += [event for event in new if isinstance(event, OdometryEstimate)]
        return self._odometry

    def settle(self) -> None:
        super().settle()
        self._wake_s = self.session.wake_at

    def run(self, seconds: float) -> None:
        """Advance the simulated time by ``seconds``.

        The session is called only when it has something to do, which saves computing time.
        """
        for _ in range(round(seconds / BENCH_TICK_S)):
            self.now += BENCH_TICK_S
            packets = self.robot.advance()
            for channel, data in packets:
                if self.speaks:
                    self.session.inbound.receive(data, self.now, channel)
            if packets or self.now >= self._wake_s:
                if self.now >= self.session.wake_at:
                    self.session.tick(self.now)
                self.settle()

    def command(self, vx: float, yaw_rate: float, seconds: float) -> None:
        """Command the twist ten times a second for ``seconds``, and ignore refusals."""
        for _ in range(round(seconds / 0.1)):
            self.try_command(vx, yaw_rate)
            self.run(0.1)

    def try_command(self, vx: float, yaw_rate: float) -> str:
        """Command the twist once, and return the reason of a refusal, or an empty text."""
        try:
            self.session.command_twist(BodyTwist(vx, 0.0, yaw_rate), self.now)
        except CommandRefused as error:
            return str(error)
        finally:
            self.settle()
        return ""

    def command_until(
        self, vx: float, yaw_rate: float, predicate: Callable[[], bool], limit_s: float = 2.0
    ) -> None:
        """Command the twist at each tick until ``predicate`` is true. No command may be refused."""

        def holds() -> bool:
            refusal = self.try_command(vx, yaw_rate)
            assert not refusal, refusal
            return predicate()

        self.run_until(holds, limit_s)

    def go_to(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Command the goal pose.

        If the driver refuses the goal, repeat it every 0.1 s, for 5 s at most.
        """
        for _ in range(50):
            try:
                self.session.command_pose(Pose(x_m, y_m, yaw_rad), self.now)
            except CommandRefused:
                self.run(0.1)
            else:
                break
            finally:
                self.settle()

    def until_it_stands(self, limit_s: float = 20.0) -> float:
        """Wait until the robot stands still, and return how long that takes, in s."""
        began_s = self.now
        self.run_until(lambda: self.robot.stands, limit_s)
        return self.now - began_s

    @property
    def truth(self) -> Pose:
        chassis = self.server.chassis
        return Pose(chassis.x_m, chassis.y_m, chassis.yaw_rad)

    @property
    def error(self) -> Pose:
        """Return the error of the odometry: its last pose minus the true pose."""
        return self.odometry[-1].pose - self.truth

    def said(self, since: int = 0) -> list[bytes]:
        """Return the driver's datagrams without its regular queries.

        ``since``: number of datagrams to leave out at the beginning.
        """
        return [data for _, data in self.written[since:] if data not in POLLS]

    def job(self, job: Job, *arguments: object, limit_s: float = 95.0) -> JobDone:
        """Request a job, wait for its result and return it."""
        seen = len(self.events)
        self.board.ask(job, "token", self.now, *arguments)

        def answers() -> list[JobDone]:
            return [
                event.value
                for event in self.events[seen:]
                if isinstance(event, Extra) and isinstance(event.value, JobDone)
            ]

        self.run_until(lambda: bool(answers()), limit_s)
        return answers()[0]

    def extras(self, kind: type) -> list[Any]:
        return [e.value for e in self.events if isinstance(e, Extra) and isinstance(e.value, kind)]


def steer_along(bench: MartBench, corners: list[tuple[float, float]], near_m: float = 0.04) -> None:
    """Drive from corner to corner by odometry, as a ROS program would, with turns on the spot."""
    for x_m, y_m in corners:
        for _ in range(600):
            way = bench.odometry[-1].pose.way_to(Pose(x_m, y_m, 0.0))
            bearing = math.atan2(way.y_m, way.x_m)
            if way.way_m < near_m or (way.way_m < 0.3 and abs(bearing) > 1.2):
                break
            if abs(bearing) > 0.3:
                bench.try_command(0.0, math.copysign(0.5, bearing))
            else:
                ahead = min(0.3, max(0.05, 1.5 * way.way_m))
                bench.try_command(ahead, max(-0.5, min(0.5, 2 * bearing)))
            bench.run(0.05)
        else:
            raise AssertionError((x_m, y_m, bench.odometry[-1].pose))
