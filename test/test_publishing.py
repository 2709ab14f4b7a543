# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the publishers of a real node, and of stamps from the node's clock."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import pytest
import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.time import Time
from sensor_msgs.msg import Imu, JointState

from omnibot_driver import boards, parameters
from omnibot_driver.boards import omnibot
from omnibot_driver.core.events import Extra
from omnibot_driver.core.fejemis import JobDone as FejemisDone
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.lois_ecu import RecordKind, TerminalLine
from omnibot_driver.core.lois_ecu.messages import Record
from omnibot_driver.core.lois_ecu.readings import RecordFailed, RecordReading, TerminalLeft
from omnibot_driver.core.mart.readings import DockedReading
from omnibot_driver.core.mart.readings import JobDone as MartDone
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.omnibot import PausedFrame
from omnibot_driver.core.omnibot.board import TRAITS
from omnibot_driver.core.omnibot.frames import Frame
from omnibot_driver.core.omnibot.modes import ModeTracker
from omnibot_driver.core.readings import EStopButtonReading
from omnibot_driver.core.session import Session
from omnibot_driver.messages import MessageSettings
from omnibot_driver.publishing import Publishing
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

VALUES = {**boards.check_all({}), "publish_tf": False}


@pytest.fixture
def node() -> Iterator[Node]:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("stamped", context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def session_with(node: Node) -> tuple[Session, Publishing]:
    """Return a session that has no open port, and the publishers of its events."""
    session = Session(
        omnibot.make(VALUES),
        parameters.session_settings(VALUES, omnibot.kinematics(VALUES)),
        run=True,
    )
    return session, Publishing(
        node,
        session,
        TRAITS,
        VALUES,
        MessageSettings.from_parameters(VALUES, omnibot.kinematics(VALUES)),
    )


def test_a_command_waits_for_no_events_of_publishers() -> None:
    """No publisher has event handlers, because they would make commands wait.

    The executor would spend time on each handler.
    """
    script = (
        "import rclpy\n"
        "from omnibot_driver.node import OmniBotDriver\n"
        "rclpy.init(args=['--ros-args', '-p', 'port:=sim://'])\n"
        "driver = OmniBotDriver()\n"
        "print([len(publisher.event_handlers) for publisher in driver.publishers])\n"
        "driver.close()\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    handlers = json.loads(told.stdout)
    assert len(handlers) >= 6
    assert not any(handlers)


def test_stamps_follow_simulated_time_while_there_is_any(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stamps are in simulated time while ``use_sim_time`` is true, otherwise in system time."""
    published: list[bytes] = []

    def published_at_s() -> float:
        publishing.deliver([ImuEstimate(time.monotonic(), (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))])
        stamp = deserialize_message(published[-1], Imu).header.stamp
        return float(stamp.sec + 1e-9 * stamp.nanosec)

    def simulate(active: bool) -> None:
        node.set_parameters([rclpy.Parameter("use_sim_time", value=active)])

    for begins_before in (True, False):
        simulate(begins_before)
        _, publishing = session_with(node)
        monkeypatch.setattr(publishing._imu, "publish", published.append)
        simulate(True)
        node.get_clock().set_ros_time_override(Time(seconds=5.0))  # type: ignore[attr-defined]
        assert published_at_s() == pytest.approx(5.0, abs=1.0)
        simulate(False)
        assert published_at_s() == pytest.approx(time.time(), abs=1.0)
        publishing._time_watch.unregister()  # otherwise rcl calls the destroyed watch


def test_a_simulated_time_that_no_stamp_can_express_publishes_nothing(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A faulty ``/clock`` sends the largest seconds and nanoseconds that a message can contain.

    No stamp can express this time. So the driver does not publish the measurement, and continues.
    """
    node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    _, publishing = session_with(node)
    published: list[bytes] = []
    monkeypatch.setattr(publishing._imu, "publish", published.append)
    clock = node.get_clock()
    for nanoseconds, count in (((2**31 - 1) * 10**9 + 2**32 - 1, 0), (5 * 10**9, 1)):
        clock.set_ros_time_override(Time(nanoseconds=nanoseconds))  # type: ignore[attr-defined]
        publishing.deliver([ImuEstimate(time.monotonic(), (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))])
        assert len(published) == count
    publishing._time_watch.unregister()  # otherwise rcl calls the destroyed watch


def test_simulated_time_gives_no_stamp_before_it_begins_and_none_twice(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Measurements are published only after the simulated clock has begun.

    Stamps increase even while the simulated clock does not advance. If the clock jumps back, the
    stamps jump back, too.
    """
    node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    session, publishing = session_with(node)
    stamps_ns: dict[str, list[int]] = {"_imu": [], "_odometry": []}
    for topic, kind in (("_imu", Imu), ("_odometry", Odometry)):

        def publish(data: bytes, topic: str = topic, kind: type = kind) -> None:
            stamp = deserialize_message(data, kind).header.stamp
            stamps_ns[topic].append(stamp.sec * 10**9 + stamp.nanosec)

        monkeypatch.setattr(getattr(publishing, topic), "publish", publish)
    states: list[str] = []
    monkeypatch.setattr(publishing._state, "publish", lambda state: states.append(state.data))

    def deliver() -> None:
        now = time.monotonic()
        for late_s in (0.0, 0.03, 0.01):
            imu = ImuEstimate(now - late_s, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))
            odometry = OdometryEstimate(now - late_s, Pose(), None, Covariance())
            publishing.deliver([imu, odometry, *session.take_events()])

    session.opened(0.0)
    deliver()
    assert states == ["connecting"]
    assert stamps_ns == {"_imu": [], "_odometry": []}
    for seconds in (0.001, 5.0, 5.0, 5.02):
        node.get_clock().set_ros_time_override(Time(seconds=seconds))  # type: ignore[attr-defined]
        deliver()
    for stamped in stamps_ns.values():
        assert len(stamped) == 12
        assert all(earlier < later for earlier, later in pairwise([0, *stamped]))
    node.get_clock().set_ros_time_override(Time(seconds=2.0))  # type: ignore[attr-defined]
    deliver()
    for stamped in stamps_ns.values():
        assert all(stamp_ns < 3 * 10**9 for stamp_ns in stamped[12:])
        assert all(earlier < later for earlier, later in pairwise(stamped[12:]))


def test_the_result_of_a_request_does_not_wait_for_simulated_time(node: Node) -> None:
    """The driver passes on the result of a request before the simulated clock has begun."""
    node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    _, publishing = session_with(node)
    published: list[Charge] = []
    publishing.extras = {
        MartDone: lambda done, _ns: done.token.set_result(done),
        FejemisDone: lambda done, _ns: done.token.set_result(done),
        Charge: lambda charge, _ns: published.append(charge),
    }
    for kind in (MartDone, FejemisDone):
        token = Future()
        publishing.deliver([Extra(Charge(12.5), 2.0), Extra(kind(token, True, "done"), 2.0)])
        assert token.done()
    assert not published
    publishing._time_watch.unregister()  # otherwise rcl calls the destroyed watch


WITHOUT_STAMP = (
    RecordReading(Record(RecordKind.RPM, (), ()), None, 60),
    RecordFailed("the board did not answer"),
    EStopButtonReading(True),
    TerminalLine("$HCHDT"),
    TerminalLeft(),
    DockedReading(True),
)


@pytest.mark.parametrize("value", WITHOUT_STAMP, ids=lambda value: type(value).__name__)
def test_what_needs_no_stamp_does_not_wait_for_simulated_time(node: Node, value: object) -> None:
    """The board's records and state changes are passed on before the simulated clock has begun.

    Otherwise, a press of the e-stop button, which is reported once, would be lost.
    """
    node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    _, publishing = session_with(node)
    published: list[object] = []
    publishing.extras = {type(value): lambda value, _ns: published.append(value)}
    publishing.deliver([Extra(value, 2.0)])
    assert published == [value]
    publishing._time_watch.unregister()  # otherwise rcl calls the destroyed watch


def test_joints_do_not_jump_when_the_wheels_are_said_to_be_of_another_size(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user changes the parameters for the sizes of the wheels while the robot is at rest.

    The published joint angles do not change.
    """
    _, publishing = session_with(node)
    published: list[bytes] = []
    monkeypatch.setattr(publishing._joints, "publish", published.append)
    far = OdometryEstimate(1.0, Pose(), None, Covariance(), rolled=Pose(100.0, 20.0, 3.0))
    publishing.publish([far], 0)
    other = {**VALUES, "wheel_radius": 0.0295, "base_radius": 0.15}
    publishing.settings = MessageSettings.from_parameters(other, omnibot.kinematics(other))
    publishing.publish([far], 0)
    before, after = (deserialize_message(data, JointState).position for data in published)
    assert before == after


def test_a_state_that_was_passed_through_within_one_read_is_not_latched(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pause of the board begins and ends within one read. Later subscribers get "nominal".

    This also holds if another thread publishes the state "paused" during the read.
    """
    session, publishing = session_with(node)
    published: list[str] = []
    monkeypatch.setattr(publishing._state, "publish", lambda state: published.append(state.data))
    board, now = SimulatedBoard(BoardSettings(running=True)), 0.0

    def read(data: bytes) -> None:
        nonlocal now
        now += 0.01
        session.inbound.receive(data, now)
        publishing.publish(session.take_events(), 0)

    session.opened(now)
    while session.state != "nominal":
        read(board.step())
    hear = ModeTracker.hear

    def hear_meanwhile(modes: ModeTracker, frame: Frame) -> None:
        hear(modes, frame)
        if isinstance(frame, PausedFrame):
            assert session.state == "paused"
            publishing.publish_state()

    monkeypatch.setattr(ModeTracker, "hear", hear_meanwhile)
    read(b"Paused: 1\n" + b"".join(board.step() for _ in range(8)))
    assert session.state == "nominal"
    assert published[-1] == "nominal"


@dataclass(frozen=True, slots=True)
class Charge:
    """A reading of a type that only one board has."""

    volts: float


def test_what_only_one_board_measures_is_published_by_its_type(node: Node) -> None:
    """Values that only one board measures go to the publisher for their type, in order.

    Their stamps are in ROS time.
    """
    _, publishing = session_with(node)
    published: list[tuple[float, int]] = []
    publishing.extras = {Charge: lambda charge, ns: published.append((charge.volts, ns))}
    publishing.publish([Extra(Charge(12.5), 2.0), Extra(Charge(12.4), 2.5)], 10**9)
    assert published == [(12.5, 3 * 10**9), (12.4, 3_500_000_000)]


def test_in_simulated_time_each_kind_of_extra_reading_has_its_own_time(node: Node) -> None:
    """A reading is published after a newer reading of another kind.

    It gets an older stamp than the newer reading: stamps have to increase only within a kind.
    """
    node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    _, publishing = session_with(node)
    stamps_ns: list[int] = []
    publishing.extras = dict.fromkeys((Charge, str), lambda _, ns: stamps_ns.append(ns))
    node.get_clock().set_ros_time_override(Time(seconds=5.0))  # type: ignore[attr-defined]
    now = time.monotonic()
    publishing.deliver(
        [Extra(Charge(12.5), now), Extra("", now - 0.5), Extra(Charge(12.4), now - 0.1)]
    )
    assert stamps_ns[1] == pytest.approx(stamps_ns[0] - 500_000_000, abs=10)
    assert stamps_ns[2] == stamps_ns[0] + 1
    publishing._time_watch.unregister()  # otherwise rcl calls the destroyed watch
