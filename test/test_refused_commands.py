# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of refused commands after the motion monitor has stopped the robot.

After this stop, motion is refused until the sender was silent for a while or sent a zero command.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace

import pytest
from disobedient_robots import SLOWLY, on_the_wrong_switch, stopped_after_s
from session_bench import Bench

from omnibot_driver import cdr
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.session import Session
from omnibot_driver.shared_session import SharedSession
from omnibot_driver.transit import Delay

Action = Callable[[Session, None, float], None]


def drive(session: Session, _wish: None, now: float) -> None:
    session.command_twist(BodyTwist(*SLOWLY), now)


REFUSED: dict[str, Action] = {
    "NaN": lambda session, _, now: session.command_twist(BodyTwist(math.nan, 0.0, 0.0), now),
    "no Twist": lambda _session, _wish, _now: (cdr.twist(b""), None)[1],
    "an old stamp": lambda session, _, now: session.command_twist(
        BodyTwist(*SLOWLY), now, age_s=9.0
    ),
    "a long time in transit": lambda _session, _wish, _now: Delay(9.0, 0.0).require("cmd_vel", 0.5),
    "the wrong number of wheels": lambda session, _, now: session.command_wheels((1.0, 1.0), now),
}


class Sender:
    """A sender of commands to the session of a ``Bench``, at the simulated time of the bench."""

    def __init__(self, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
        clock = SimpleNamespace(monotonic=lambda: bench.now)
        monkeypatch.setattr("omnibot_driver.shared_session.time", clock)
        monkeypatch.setattr("omnibot_driver.shared_session.boot_time_s", lambda: bench.now)
        self._bench = bench
        self._shared = SharedSession(bench.session, bench.events.extend, lambda _reason: None, None)

    def is_obeyed(self, action: Action, sent_ns: tuple[int, ...] = ()) -> bool:
        """Send a command, let 0.1 s pass, and return whether the command was accepted."""
        try:
            self._shared.command(action, None, sent_ns)
        except CommandRefused:
            return False
        finally:
            self._bench.run(0.1)
        return True


@pytest.mark.parametrize("refused", REFUSED.values(), ids=REFUSED)
def test_a_sender_of_refused_commands_does_not_pause(
    refused: Action, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a stop by the motion monitor, a sender sends commands that are refused or rejected.

    The driver also refuses the next valid command of this sender, because the sender was not
    silent.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    sender = Sender(bench, monkeypatch)
    assert not any(sender.is_obeyed(refused) for _ in range(10))
    assert not sender.is_obeyed(drive)
    bench.run(0.5)
    assert sender.is_obeyed(drive)


def test_a_sender_does_not_pause_while_its_commands_are_refused_after_a_stall(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After a stop by the motion monitor, a sender's commands arrive late because of a stall.

    The driver refuses the late commands and the next command, because the sender was not silent.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    sender = Sender(bench, monkeypatch)
    monkeypatch.setattr(
        "omnibot_driver.stall_detector.StallDetector.outlived_by",
        lambda _detector, sent_ns, _now: sent_ns > 0,
    )
    assert not any(sender.is_obeyed(drive, (0,)) for _ in range(10))
    assert not sender.is_obeyed(drive, (1,))
    bench.run(0.5)
    assert sender.is_obeyed(drive, (1,))


def test_a_refused_command_does_not_bring_back_a_refusal_that_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After a stop by the motion monitor, the sender pauses, which ends the refusal of motion.

    Then a late command is refused, but the next command is accepted.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    sender = Sender(bench, monkeypatch)
    bench.run(0.6)
    assert bench.session.figures(bench.now).commands.interlock == ""
    assert not sender.is_obeyed(REFUSED["a long time in transit"])
    assert sender.is_obeyed(drive)
