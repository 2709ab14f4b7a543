# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the driver makes few Python calls for the data of one tick (10 ms) of a running board.

Each test bounds the number of calls. A change that raises a bound gives its reason in
docs/internals/performance.md.
"""

import gc
import struct
import sys
from collections.abc import Callable
from types import FrameType

import pytest
from interpreted import interpreted_only

from omnibot_driver import boards, parameters
from omnibot_driver.boards import omnibot
from omnibot_driver.cdr import LITTLE_ENDIAN, Serializer, twist
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.omnibot import FrameDecoder
from omnibot_driver.core.session import Session
from omnibot_driver.messages import MessageSettings, turned, unturned
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

pytestmark = interpreted_only

DEFAULTS = boards.check_all({})
TICK_S = 0.01
SETTLED = 400
TICKS = 400
IMU, DELTA, POSE = 14, 14 + 9, 14 + 9 + 15
"""Number of bytes that the board sends in a tick of 10 ms, for three kinds of ticks: only an IMU
frame; IMU and delta; IMU, delta and pose."""


def calls(work: Callable[[], object]) -> int:
    """Count the calls of Python functions in ``work``."""
    count = 0

    def see(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event == "call"

    before = sys.getprofile()
    gc.disable()  # Hypothesis has a callback at each collection, which does not count
    sys.setprofile(see)
    try:
        work()
    finally:
        sys.setprofile(before)
        gc.enable()
    return count


def opened_session() -> Session:
    """Return a session as the driver makes it."""
    values = boards.check_all({})
    session = Session(
        omnibot.make(values),
        parameters.session_settings(values, omnibot.kinematics(values)),
        run=True,
    )
    session.opened(0.0)
    session.take_output(0.0)
    return session


def most_calls(
    work: Callable[[bytes, float], object], rest: Callable[[float], None] = lambda _now: None
) -> dict[int, float]:
    """Return the mean number of Python calls that ``work`` makes for each kind of tick.

    The key for a kind of tick is the number of bytes that the running board sends in such a tick.
    """
    board = SimulatedBoard(BoardSettings(seed=3, running=True))
    counted: dict[int, list[int]] = {}
    for tick in range(SETTLED + TICKS):
        data, now = board.step(), tick * TICK_S
        if tick < SETTLED:
            work(data, now)
        else:
            counted.setdefault(len(data), []).append(calls(lambda: work(data, now)))  # noqa: B023
        rest(now)
    return {length: sum(each) / len(each) for length, each in counted.items()}


@pytest.mark.parametrize(("kind", "bound"), [(IMU, 14), (DELTA, 9), (POSE, 9)])
def test_decoding_calls_no_more_than_it_did(kind: int, bound: int) -> None:
    """The decoder makes at most ``bound`` Python calls, on average, for the bytes of one tick.

    The bound depends on the frames in the tick (``kind``).
    """
    assert most_calls(FrameDecoder().feed)[kind] <= bound


@pytest.mark.parametrize(("kind", "bound"), [(IMU, 47), (DELTA, 159), (POSE, 255)])
def test_the_core_calls_no_more_than_it_did(kind: int, bound: int) -> None:
    """The session needs at most ``bound`` calls to turn the bytes of a tick into events.

    The number includes the calls with which the link asks for packets and for the next wake-up.
    """
    session = opened_session()

    def work(data: bytes, now: float) -> None:
        session.inbound.receive(data, now)
        session.take_output(now)
        assert session.wake_at > now
        session.take_events()

    assert most_calls(work)[kind] <= bound


@pytest.mark.parametrize(("kind", "bound"), [(IMU, 31), (DELTA, 58), (POSE, 150)])
def test_no_more_than_it_did_stands_between_the_wire_and_an_imu(kind: int, bound: int) -> None:
    """The session makes at most ``bound`` Python calls, on average, to read a tick's IMU frame.

    The bound depends on the frames in the tick (``kind``).
    """
    session = opened_session()

    def work(data: bytes, now: float) -> None:
        assert session.inbound.hear(data, now) or now < SETTLED * TICK_S

    def rest(now: float) -> None:
        session.inbound.process(now)
        session.take_events()

    assert most_calls(work, rest)[kind] <= bound


def test_a_command_calls_no_more_than_it_did() -> None:
    """A Twist takes at most 46 Python calls, from its bytes to the packets for a running board."""
    session, board, now = opened_session(), SimulatedBoard(BoardSettings(running=True)), 0.0
    for tick in range(SETTLED):
        now = tick * TICK_S
        session.inbound.receive(board.step(), now)
        session.take_output(now)
    data = LITTLE_ENDIAN + struct.pack("<6d", 0.1, 0.0, 0.0, 0.0, 0.0, 0.1)
    written = []

    def work() -> None:
        velocity, planar = twist(data)
        session.command_twist(velocity, now, planar=planar)
        written.append(session.take_output(now))

    now += TICK_S
    assert calls(work) <= 46
    assert written != [()]


def test_a_serialised_tick_calls_no_more_than_it_did() -> None:
    """The serializer makes an Imu in at most 2 calls.

    It makes an Odometry with its JointState in at most 8 calls.
    """
    settings = MessageSettings.from_parameters(DEFAULTS, omnibot.kinematics(DEFAULTS))
    make, before = Serializer(settings), unturned(settings.wheels)
    imu = ImuEstimate(0.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    pose, rates = Pose(1.0, 2.0, 3.0), BodyTwist(0.1, 0.2, 0.3)
    odometry = OdometryEstimate(0.0, pose, rates, Covariance(), pose, rates)
    assert calls(lambda: make.imu(imu, 0)) <= 2

    def work() -> None:
        make.odometry(odometry, 0)
        make.joint_state(turned(before, odometry, settings.wheels), 0)

    assert calls(work) <= 8
