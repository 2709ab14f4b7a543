# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The effect of each command on the board.

This module knows commands and payloads. It does not know characters, nor how replies are sent.
"""

from dataclasses import dataclass

from omnibot_driver.simulator.lois_ecu import wire
from omnibot_driver.simulator.lois_ecu.channel import WheelChannel
from omnibot_driver.simulator.lois_ecu.odometry import DocumentedOdometry
from omnibot_driver.simulator.lois_ecu.records import HEADINGS, RPM, TORQUE, Recorder
from omnibot_driver.simulator.lois_ecu.settings import Quirks
from omnibot_driver.simulator.lois_ecu.terminal import Terminal
from omnibot_driver.simulator.lois_ecu.timers import Timers
from omnibot_driver.simulator.lois_ecu.tuning import adjust

BALL_S = 6.0


@dataclass(frozen=True, slots=True)
class Obeyed:
    """A line of valid form that the board has processed, even if the command is unknown.

    ``tick``: number of the tick in which the line was processed.
    """

    tick: int
    command: int
    payload: int


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of the board on which commands act. Each boot makes new parts."""

    wheels: tuple[WheelChannel, ...]
    odometry: DocumentedOdometry
    timers: Timers
    terminal: Terminal
    reader: wire.LineReader
    records: Recorder


class Commands:
    """Executes commands.

    * ``led``: whether the LED is on.
    * ``balls``: number of balls dropped, which a reboot does not reset.
    """

    def __init__(self, quirks: Quirks) -> None:
        self._quirks = quirks
        self.balls = 0
        self.boot()

    def boot(self) -> None:
        """Switch the LED off, and forget when the board last dispensed a ball."""
        self.led = False
        self._ball_at_s = -BALL_S

    def obey(self, parts: Parts, command: int, payload: int, now_s: float, clock_ms: int) -> None:
        """Execute one command. An unknown command is ignored."""
        quirks, (left, right) = self._quirks, parts.wheels
        high, low = payload >> 16, payload & 0xFFFF
        signed = [word - 0x10000 if word & 0x8000 else word for word in (high, low)]
        if command == 0x01:
            left.command_duty(signed[0])
            right.command_duty(signed[1])
        elif command == 0x02:
            left.command_rpm(signed[0])
            right.command_rpm(signed[1])
        elif command == 0x03:
            self.led = low & 0xFF != 0
        elif command in (RPM, TORQUE, HEADINGS):
            parts.records.start(command, payload)
        elif command in parts.timers:
            if command != 0x20 or not quirks.odometry_period_is_fixed:
                parts.timers.set(command, low, clock_ms)
        elif command == 0x11:
            parts.terminal.mode = low & 0xFF
            parts.reader.checks = parts.terminal.mode != 4
            if quirks.terminal_mode_zeroes_correction:
                left.short_correction = wire.number_of(payload)
        elif command == 0x18:
            left.reset()
            right.reset()
            if not quirks.reset_clears_ticks_only:
                parts.odometry.clear()
        elif command == 0x19:
            self._drop_ball(now_s)
        else:
            adjust(parts.wheels, command, wire.number_of(payload), quirks)

    def _drop_ball(self, now_s: float) -> None:
        if now_s < self._ball_at_s + BALL_S and self._quirks.one_ball_in_six_seconds:
            return
        self.balls += 1
        self._ball_at_s = now_s
