# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A session with the simulated pair of Teensy boards, in simulated time."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Event, Extra, Notice
from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.readings import Job, JobDone
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import OdometryNoise
from omnibot_driver.core.odometry.estimate import OdometryEstimate, OdometrySettings
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.core.session import Session, SessionSettings
from omnibot_driver.simulator.fejemis import FejemisSettings as SimulatedSettings
from omnibot_driver.simulator.fejemis import Firmware, SimulatedFejemis

DRIVE, FRONT = 0, 1
WHEELS = SteeredKinematics(1.0, 0.4, 0.5)


class Bench:
    """A session with both simulated boards.

    ``hears``: channels on which bytes from the driver reach the robot.

    ``speaks``: channels on which bytes from the robot reach the driver.

    ``read_s``: time in s between two reads of the driver.
    """

    def __init__(
        self,
        simulated: SimulatedSettings | None = None,
        settings: FejemisSettings | None = None,
        *,
        limits: SpeedLimits | None = None,
        commands: CommandSettings | None = None,
        run: bool = True,
    ) -> None:
        self.robot = SimulatedFejemis(simulated or SimulatedSettings())
        self.board = FejemisBoard(settings or FejemisSettings())
        self.session = Session(
            self.board,
            SessionSettings(
                limits=limits or SpeedLimits(linear_mps=1.0, angular_radps=1.5),
                commands=commands or CommandSettings(),
                odometry=OdometrySettings(noise=OdometryNoise(wheels=WHEELS)),
            ),
            run=run,
        )
        self.now = 1000.0
        self.hears, self.speaks = {DRIVE, FRONT}, {DRIVE, FRONT}
        self.carry: Callable[[int, bytes], bytes] = lambda _, data: data
        """Function that changes or drops the bytes from the robot.

        Its arguments are channel and bytes.
        """
        self.read_s = 0.0
        self._unread, self._read_at = [b"", b""], [-math.inf, -math.inf]
        self.events: list[Event] = []
        self.written: list[tuple[float, int, bytes]] = []

    def open(self, missing: str = "") -> None:
        self.session.opened(self.now, missing=missing)
        self.settle()

    def close(self) -> None:
        self.session.closed(self.now)
        self.settle()

    def settle(self) -> None:
        for channel, data in self.session.take_output(self.now):
            self.written.append((self.now, channel, data))
            if channel in self.hears:
                self.robot.receive(data, self.now, channel)
        self.events += self.session.take_events()

    def step(self) -> None:
        self.now += self.robot.tick_s
        for channel, data in self.robot.advance():
            data = self.carry(channel, data)
            if channel in self.speaks:
                self._unread[channel] += data
        for channel, data in enumerate(self._unread):
            if data and self.now > self._read_at[channel] + self.read_s - 1e-9:
                self._unread[channel], self._read_at[channel] = b"", self.now
                self.session.inbound.receive(data, self.now, channel)
                self.settle()
        if self.now >= self.session.wake_at:
            self.session.tick(self.now)
            self.settle()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / self.robot.tick_s)):
            self.step()

    def run_until(self, predicate: Callable[[], bool], limit_s: float = 12.0) -> None:
        end = self.now + limit_s
        while not predicate():
            assert self.now < end, (self.session.state, self.notices)
            self.step()

    def drive(self, v: float = 0.3, w: float = 0.0) -> None:
        self.session.command_twist(BodyTwist(v, 0.0, w), self.now)
        self.settle()

    def drive_on(self, v: float = 0.3, w: float = 0.0, seconds: float = 1.0) -> None:
        for _ in range(round(seconds / 0.1)):
            self.drive(v, w)
            self.run(0.1)

    def estop(self, active: bool) -> None:
        self.session.estop(active, self.now)
        self.settle()

    def ask(self, request: Request, limit_s: float = 6.0) -> RequestDone:
        token = object()
        seen = len(self.events)
        self.session.request(request, token, self.now)
        self.settle()
        found: list[RequestDone] = []

        def answered() -> bool:
            nonlocal seen
            new, seen = self.events[seen:], len(self.events)
            found.extend(e for e in new if isinstance(e, RequestDone) and e.token is token)
            return bool(found)

        self.run_until(answered, limit_s)
        return found[0]

    @property
    def notices(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notice)]

    @property
    def odometry(self) -> list[OdometryEstimate]:
        return [event for event in self.events if isinstance(event, OdometryEstimate)]

    @property
    def imu(self) -> list[ImuEstimate]:
        return [event for event in self.events if isinstance(event, ImuEstimate)]

    def extras(self, kind: type) -> list[Any]:
        return [e.value for e in self.events if isinstance(e, Extra) and isinstance(e.value, kind)]

    def lines(self, channel: int, since: float = -math.inf) -> list[str]:
        """Return the lines written to a channel, without checksums and padding.

        ``since``: time in s before which lines are left out.
        """
        text = b"".join(d for at, to, d in self.written if to == channel and at >= since)
        found = text.decode("ascii").split("\n")
        bare = [line[3:] if line.startswith(";") else line for line in found]
        return [line.rstrip() for line in bare if line]


def ask(bench: Bench, job: Job, limit_s: float = 10.0) -> JobDone:
    """Request a job from the boards, wait for its result and return it."""
    token = object()
    seen = len(bench.events)
    bench.board.services.ask(job, token, bench.now)
    bench.settle()
    found: list[JobDone] = []

    def answered() -> bool:
        nonlocal seen
        new, seen = bench.events[seen:], len(bench.events)
        values = (event.value for event in new if isinstance(event, Extra))
        found.extend(d for d in values if isinstance(d, JobDone) and d.token is token)
        return bool(found)

    bench.run_until(answered, limit_s)
    return found[0]


def nominal(
    simulated: SimulatedSettings | None = None,
    settings: FejemisSettings | None = None,
    **more: Any,
) -> Bench:
    """Return a bench in state nominal: both boards send data and obey commands."""
    bench = Bench(simulated, settings, **more)
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.4)
    return bench


__all__ = ["DRIVE", "FRONT", "Bench", "Firmware", "SimulatedSettings", "ask", "nominal"]


def drive_until_refused(bench: Bench, limit_s: float = 5.0) -> float:
    """Drive until a command is refused, and return the time until then, in s."""
    began = bench.now
    with pytest.raises(CommandRefused):
        bench.drive_on(seconds=limit_s)
    return bench.now - began
