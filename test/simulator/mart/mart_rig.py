# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated MART controller and a host that sends typed datagrams, in simulated time."""

from math import inf

from omnibot_driver.simulator.mart import (
    COMMAND,
    FIRMWARE,
    STOP,
    Kind,
    MartServer,
    MartSettings,
    Quirks,
)

INCH_M = 0.0254


class Rig:
    """A simulated controller and its host.

    ``replies``: all replies of the controller, each with its time.

    ``took_s``: the time for which ``wait`` waited for the last reply, in s.
    """

    def __init__(self, quirks: Quirks = FIRMWARE, **settings: object) -> None:
        self.server = MartServer(MartSettings(quirks=quirks, **settings))  # type: ignore[arg-type]
        self.replies: list[tuple[float, bytes]] = []
        self.took_s = inf

    @property
    def now(self) -> float:
        return self.server.now_s

    def say(self, *texts: str) -> None:
        """Send these requests to the command port, without waiting for replies."""
        for text in texts:
            self.server.receive(text.encode("latin-1"), COMMAND, "us", self.now)

    def stop(self, text: str) -> None:
        self.server.receive(text.encode("latin-1"), STOP, "us", self.now)

    def run(self, seconds: float) -> list[str]:
        """Advance by ``seconds``, and return the replies that the server has sent in this time."""
        found = self.server.advance(self.now + seconds)
        self.replies += [(reply.at_s, reply.data) for reply in found]
        return [reply.data.decode("latin-1") for reply in found]

    def wait(self, limit_s: float = 20.0) -> str | None:
        """Return the next reply and set ``took_s``, or return None after ``limit_s``."""
        began_s, until_s = self.now, self.now + limit_s
        while self.now < until_s:
            found = self.run(max(0.0, min(self.server.wake_at, until_s) - self.now))
            if found:
                self.took_s = self.now - began_s
                assert len(found) == 1, found
                return found[0]
            if self.server.wake_at == inf:
                self.run(until_s - self.now)
        return None

    def ask(self, text: str, limit_s: float = 20.0) -> str | None:
        """Send one request to the command port and return its reply."""
        self.say(text)
        return self.wait(limit_s)

    def number(self, text: str) -> float:
        """Send one request and return the number in its reply."""
        answer = self.ask(text)
        assert answer is not None
        ok, number = answer.split()
        assert ok == "ok"
        return float(number)

    def drive(self, text: str, seconds: float = 1.0) -> None:
        """Start an uncontrolled motion, and let the robot move for ``seconds``."""
        assert self.ask(text) == "ok"
        self.run(seconds)

    @property
    def x_in(self) -> float:
        """Return the true distance forward, in inches."""
        return self.server.chassis.x_m / INCH_M

    @property
    def yaw_deg(self) -> float:
        """Return the true heading, in degrees."""
        return self.server.chassis.yaw_rad * 57.29577951308232

    @property
    def moving(self) -> bool:
        return self.server.chassis.moving

    @property
    def in_progress(self) -> Kind | None:
        """Return the motion that the server regards as in progress. The robot may be at rest."""
        return self.server.motion
