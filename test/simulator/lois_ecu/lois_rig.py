# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A simulated LOIS ECU in simulated time.

The driver's codec encodes the commands to the ECU and decodes the ECU's reports.
"""

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    LoisDecoder,
    SetRpm,
    Setting,
    Ticks,
    WriteSetting,
    encode_command,
)
from omnibot_driver.core.lois_ecu.messages import Command, Report
from omnibot_driver.simulator.lois_ecu import FIRMWARE, LoisSettings, Quirks, SimulatedLois

LOW_PASS = WriteSetting(Setting.RPM_LOW_PASS, 1.0)


class Rig:
    """A simulated board and its host.

    ``heard``: all reports of the board. The time of a report is the end of the call of ``run`` that
    received it.
    """

    def __init__(self, quirks: Quirks = FIRMWARE, **settings: object) -> None:
        self.board = SimulatedLois(LoisSettings(quirks=quirks, **settings))  # type: ignore[arg-type]
        self.decoder = LoisDecoder()
        self.heard: list[tuple[float, Report]] = []

    @property
    def now(self) -> float:
        return self.board.now_s

    def run(self, seconds: float) -> list[Report]:
        """Advance by ``seconds``, and return the reports received in that time."""
        found: list[Report] = []
        for _ in range(round(seconds / self.board.tick_s)):
            found += self.decoder.feed(self.board.step(), self.now)
        found += self.decoder.feed(b"", self.now)
        self.heard += [(self.now, report) for report in found]
        return found

    def say(self, *commands: Command) -> None:
        """Send each command repeatedly until the board obeys it. The board may miss a line."""
        for command in commands:
            data = encode_command(command, with_sum=self.board._reader.checks)
            for _ in range(50):
                before = len(self.board.commands)
                self.board.receive(data)
                self.run(0.03)
                if len(self.board.commands) > before:
                    break
            else:
                raise AssertionError(f"{command} was not obeyed")

    def drive(self, left: int, right: int, seconds: float) -> list[Report]:
        """Command these wheel speeds in RPM for ``seconds``, and return the reports received."""
        self.say(SetRpm(left, right))
        return self.run(seconds)

    def booted(self) -> "Rig":
        """Run until the board has booted. Set its low-pass filter if the board has one."""
        self.run(2.1)
        if self.board.settings.quirks.extra_settings:
            self.say(LOW_PASS)
        return self


def ticks_in(reports: list[Report]) -> list[Ticks]:
    return [report for report in reports if isinstance(report, Ticks)]


def odometry_in(reports: list[Report]) -> list[BoardOdometry]:
    return [report for report in reports if isinstance(report, BoardOdometry)]
