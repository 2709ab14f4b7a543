# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated Fejemis and a host that sends typed lines, in simulated time."""

import re

from omnibot_driver.simulator.fejemis import FejemisSettings, Firmware, SimulatedFejemis

DRIVE, FRONT = 0, 1
BEAT = re.compile(r"(;\d\d)?hbt ")


class Rig:
    """A simulated board and its host.

    ``lines``: all lines from the board, without line ends, each with time and port.

    ``relays``: whether the host relays the front wheel's angles to the drive Teensy.
    """

    def __init__(self, *, firmware: Firmware | None = None, **settings: object) -> None:
        sums = Firmware(sums=False) if firmware is None else firmware
        self.board = SimulatedFejemis(
            FejemisSettings(firmware=sums, **settings)  # type: ignore[arg-type]
        )
        self.lines: list[tuple[float, int, str]] = []
        self.relays = False
        self._held = [b"", b""]

    @property
    def now(self) -> float:
        return self.board.now_s

    def booted(self) -> "Rig":
        """Run for a second after power-on, and discard the lines that came in this time."""
        self.run(1.0)
        self.lines.clear()
        return self

    def say(self, port: int, *texts: str) -> None:
        for text in texts:
            self.board.receive(text.encode("latin-1") + b"\n", self.now, port)

    def run(self, seconds: float) -> list[tuple[int, str]]:
        """Advance by ``seconds``, and return port and text of each line received in that time."""
        before = len(self.lines)
        for _ in range(round(seconds / self.board.tick_s)):
            for port, data in self.board.advance():
                *whole, self._held[port] = (self._held[port] + data).split(b"\n")
                for line in whole:
                    self._hear(port, line.decode("latin-1").rstrip("\r"))
        return [(port, text) for _, port, text in self.lines[before:]]

    def _hear(self, port: int, text: str) -> None:
        self.lines.append((self.now, port, text))
        if self.relays and text.startswith("fwl "):
            self.say(DRIVE, f"fwl {text.split()[1]}")

    def ask(self, port: int, text: str) -> list[str]:
        """Send a line to a port, and return the port's replies of the next 10 ms.

        Heartbeats are left out, unless the line requests one.
        """
        self.say(port, text)
        said = [answer for number, answer in self.run(0.01) if number == port]
        return said if text == "hbti" else [answer for answer in said if not BEAT.match(answer)]

    def drive(self, text: str, seconds: float) -> None:
        """Send an ``rc`` line to both Teensys, and run for ``seconds``.

        In this time, the host relays the front wheel's angle to the drive Teensy.
        """
        self.relays = True
        self.say(FRONT, "sub fwl 15", text)
        self.say(DRIVE, text)
        self.run(seconds)
