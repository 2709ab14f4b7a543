# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a zero command that arrives too late while the robot drives to a goal.

The driver refuses the command, but usually ends the goal: a goal does not expire, and a joystick
sends its zero only once.
"""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from any_board import AnyBench, nominal
from geometry_msgs.msg import Twist
from rclpy.serialization import serialize_message
from session_bench import Bench

from omnibot_driver import cdr
from omnibot_driver.command_topics import Action, obeying
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.session import Session
from omnibot_driver.shared_session import SharedSession
from omnibot_driver.simulator.omnibot import BoardSettings

LATE_S = 0.7
NS = 1_000_000_000


def obey(session: Session, data: bytes, now: float) -> None:
    session.command_twist(cdr.twist(data)[0], now)


def obey_an_old_stamp(session: Session, data: bytes, now: float) -> None:
    session.command_twist(cdr.twist(data)[0], now, age_s=LATE_S)


class Topic:
    """The topic cmd_vel of a driver.

    The driver uses the session of the bench. The driver's clocks show the bench's simulated time.
    """

    def __init__(self, bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        def now_ns() -> int:
            return round(bench.now * NS)

        clock = SimpleNamespace(monotonic=lambda: bench.now, time_ns=now_ns)
        monkeypatch.setattr("omnibot_driver.shared_session.time", clock)
        monkeypatch.setattr("omnibot_driver.shared_session.boot_time_s", lambda: bench.now)
        monkeypatch.setattr("omnibot_driver.command_topics.time", clock)
        monkeypatch.setattr("omnibot_driver.command_topics.boot_time_ns", now_ns)
        self.refused: list[str] = []
        self.action: Action = obey
        self._now_ns = now_ns
        self._shared = SharedSession(bench.session, bench.events.extend, self.refused.append, None)
        self._callback = obeying(
            self._shared,
            "cmd_vel",
            lambda session, data, now: self.action(session, data, now),
            lambda: 0.5,
            ends_goal=cdr.is_zero,
        )

    def hear(self, vx: float = 0.0, *, late_s: float = 0.0) -> None:
        """Deliver a message with the velocity ``vx``, in m/s. It was sent ``late_s`` ago."""
        now_ns = self._now_ns()
        twist = Twist()
        twist.linear.x = vx
        times = {
            "source_timestamp": now_ns - round(late_s * NS),
            "received_timestamp": now_ns,
        }
        self._callback(serialize_message(twist), times)
        self._shared.outbox.deliver()


def source(bench: Any) -> str | None:
    """Return the name of the topic that commands the robot."""
    name: str | None = bench.session.figures(bench.now).commands.source
    return name


def on_the_way(monkeypatch: pytest.MonkeyPatch) -> tuple[AnyBench, Topic]:
    """Return a bench with a MART that drives to a goal, and a topic that delivers cmd_vel messages.

    The driver received a zero command on cmd_vel before the goal.
    """
    bench = nominal("mart")
    topic = Topic(bench, monkeypatch)
    topic.hear()
    bench.session.command_pose(Pose(3.0, 0.0, 0.0), bench.now)
    bench.settle()
    bench.run(3.0)
    assert source(bench) == "cmd_pose"
    return bench, topic


@pytest.mark.parametrize(
    ("action", "late_s"), [(obey, LATE_S), (obey_an_old_stamp, 0.0)], ids=["transit", "stamp"]
)
def test_a_late_zero_is_refused_but_ends_a_goal(
    action: Action, late_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A zero command that is too old is refused, but ends the drive to a goal.

    A notice gives the reason.
    """
    bench, topic = on_the_way(monkeypatch)
    topic.action = action
    topic.hear(late_s=late_s)
    assert len(topic.refused) == 1
    assert source(bench) is None
    bench.run(3.0)
    assert bench.robot.stands
    assert bench.robot.way_m < 2.0
    assert [text for text in bench.notices if "goal of cmd_pose is discarded: cmd_vel" in text]


@pytest.mark.parametrize("vx", [0.3, math.nan])
def test_a_late_velocity_and_nan_do_not_end_a_goal(
    vx: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, topic = on_the_way(monkeypatch)
    topic.hear(vx, late_s=LATE_S)
    assert len(topic.refused) == 1
    assert source(bench) == "cmd_pose"


def test_a_late_zero_does_not_stop_a_velocity(monkeypatch: pytest.MonkeyPatch) -> None:
    """A zero that arrives late on cmd_vel is refused. The velocity from cmd_vel stays in effect.

    This velocity may be newer than the zero.
    """
    bench = nominal("mart")
    topic = Topic(bench, monkeypatch)
    topic.hear(0.3)
    topic.hear(late_s=LATE_S)
    assert len(topic.refused) == 1
    assert source(bench) == "cmd_vel"


def test_a_zero_ends_no_goal_on_a_board_whose_switch_is_on_positional_control(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Under positional control, a zero on cmd_vel does not end a goal.

    The driver refuses all commands on cmd_vel while the board is under positional control.
    """
    bench = Bench(BoardSettings(running=True, control="position"))
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    topic = Topic(bench, monkeypatch)
    bench.go_to(1.0, 0.0, 0.0)
    topic.hear()
    topic.hear(late_s=LATE_S)
    assert len(topic.refused) == 2
    assert source(bench) == "cmd_pose"
