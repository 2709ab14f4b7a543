# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of a simulated board's thread on a computer that is too busy to run it in time."""

import time
from collections.abc import Iterable

import pytest

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.common.running import RunningBoard

LATE_S = 0.7


class Motor:
    """A board that drives until it receives a stop.

    ``driven``: number of ticks in which the board has driven.
    """

    channels, tick_s = (Channel(),), 0.01

    def __init__(self) -> None:
        self.driven, self.stopped = 0, False

    def receive(self, data: bytes, now: float, channel: int) -> None:
        self.stopped |= data == b"stop"

    def advance(self) -> list[Packet]:
        self.driven += not self.stopped
        return []

    def reboot(self) -> None:
        """Do nothing: this board never boots."""

    @property
    def facts(self) -> dict[str, object]:
        return {}


class LateBoard(RunningBoard[Motor]):
    """A simulated board whose thread runs late, as on a busy computer.

    During the delay, a stop command arrives at the board.
    """

    def __init__(self) -> None:
        super().__init__(Motor())
        self.now_s, self.calls = 0.0, 0

    def _receive(self, timeout_s: float) -> Iterable[Packet]:
        self.calls += 1
        if self.calls == 1:
            self.now_s += LATE_S
            return []
        self.now_s += timeout_s
        self._stopping.set()
        return [(0, b"stop")]

    def _send(self, channel: int, data: bytes) -> int:
        return len(data)


def test_what_came_while_the_thread_was_late_precedes_the_ticks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A stop arrives while the board's thread does not run.

    When the thread runs again, the stop acts before the overdue ticks.
    """
    board = LateBoard()
    monkeypatch.setattr(time, "monotonic", lambda: board.now_s)
    board._run()
    board.check()
    assert board.board.stopped
    assert board.board.driven == 0
