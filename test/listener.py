# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Helpers for tests of ``Link``, which connects a session to a port: a listener and a session.

The listener takes the place of the driver's node.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from omnibot_driver import boards
from omnibot_driver.boards import omnibot
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.events import Event
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.packets import packed
from omnibot_driver.core.session import Session, SessionSettings
from omnibot_driver.link import Link
from omnibot_driver.simulator.omnibot import SimulatedBoard

PATIENCE_S = 60.0
STOP = bytes(8) + bytes.fromhex("FF FE 02 00 00 00 00 00 00")
EMERGENCY_STOP = bytes(8) + bytes.fromhex("FF FE 10 00 00 00 00 00 00")
START = bytes(8) + b"S"
LAST_WORDS = (packed(STOP), packed(EMERGENCY_STOP + STOP))


class Listener:
    """A listener of a link. It keeps the link's events and reports, and wakes a waiting test."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.reports: list[str | None] = []
        self.refused: list[str] = []
        self.failures: list[BaseException] = []
        self.threads: set[str] = set()
        self._changed = threading.Condition()

    def deliver(self, events: Sequence[Event]) -> None:
        with self._changed:
            self.events += events
            if any(isinstance(event, ImuEstimate) for event in events):
                self.threads.add(threading.current_thread().name)
            self._changed.notify_all()

    def report(self, trouble: str | None) -> None:
        with self._changed:
            self.reports.append(trouble)
            self._changed.notify_all()

    def failed(self, error: BaseException) -> None:
        with self._changed:
            self.failures.append(error)
            self._changed.notify_all()

    def wait_for(self, predicate: Callable[[], object]) -> None:
        with self._changed:
            assert self._changed.wait_for(predicate, PATIENCE_S)


def session(*, run: bool = True, obeys: bool = True) -> Session:
    settings = SessionSettings(
        limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
    )
    return Session(OmniBot(OmniBotSettings()), settings, run=run, obeys=obeys)


def link_to(
    url: str,
    listener: Listener,
    session: Session,
    reconnect_interval_s: float = 0.02,
    **taps: Callable[[Any], None],
) -> Link:
    return Link(
        session,
        boards.opener(omnibot, {"port": url, "baudrate": 115200}),
        url,
        guard=True,
        reconnect_interval_s=reconnect_interval_s,
        deliver=listener.deliver,
        report=listener.report,
        failed=listener.failed,
        **taps,
    )


def end_patiently(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the time limits for the closing of a link longer.

    On a busy computer, the proof that the robot is at rest needs more time than usual.
    """
    for limit in ("STANDS_WITHIN_S", "SILENCE_S", "BOTH_PROOFS_S", "JOIN_TIMEOUT_S"):
        monkeypatch.setattr(f"omnibot_driver.link.{limit}", PATIENCE_S)


def kinds(board: SimulatedBoard) -> list[str]:
    """Return the kinds of the commands that the board obeyed."""
    return [command.kind for command in board.commands]


def wait_for_the_end_of(*names: str) -> None:
    for thread in threading.enumerate():
        if thread.name in names:
            thread.join(PATIENCE_S)
