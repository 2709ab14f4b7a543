# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of advice on settings that the board's data contradicts.

Right settings cause no advice.
"""

import math
from functools import cache

import pytest
from session_bench import Bench
from synthetic_board import earth

from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings, PoseFrame
from omnibot_driver.core.omnibot.misconfiguration import MisconfigurationChecks
from omnibot_driver.core.omnibot.schedule import DELTA_PERIODS_S
from omnibot_driver.core.readings import PoseReading
from omnibot_driver.simulator.omnibot import (
    BoardPose,
    BoardSettings,
    FaultyLine,
    LineFaults,
    SimulatedBoard,
)

DRIVE = bytes.fromhex("FF FE 01 00 15 00 0E 00 C8")
"""Command for 0.3 m/s forward, 0.2 m/s to the left and 0.4 rad/s."""
LONG_S = 12.0


@cache
def sent_by(board: BoardSettings, seconds: float, command: bytes = b"") -> tuple[bytes, ...]:
    """Return what a simulated board sends in each tick after one command."""
    sender = SimulatedBoard(board)
    sender.receive(command)
    return tuple(sender.step() for _ in range(round(seconds * 100)))


def advice(board: BoardSettings, settings: OmniBotSettings, seconds: float = 6.0) -> str | None:
    """Return the advice of a driver with ``settings`` after a drive of the simulated board."""
    driver = OmniBot(settings)
    for tick, data in enumerate(sent_by(board, seconds, DRIVE)):
        driver.receive(data, tick / 100)
    return driver.advice


@pytest.mark.parametrize(("sent", "read"), [("big", "little"), ("little", "big")])
def test_a_wrong_byte_order_of_poses_is_noticed(sent: str, read: str) -> None:
    """The setting ``pose_byte_order`` is wrong, so the poses are impossible.

    The driver advises to change this setting.
    """
    board = BoardSettings(running=True, pose_byte_order=sent)
    told = advice(board, OmniBotSettings(pose_byte_order=read))
    assert told is not None
    assert f"`pose_byte_order` to {sent}" in told


@pytest.mark.slow
@pytest.mark.parametrize(("sent", "read"), [("earth", "body"), ("body", "earth")])
@pytest.mark.parametrize("period_s", DELTA_PERIODS_S)
def test_a_wrong_frame_of_deltas_is_noticed(sent: str, read: str, period_s: float) -> None:
    """The setting ``delta_frame`` is wrong, and the robot's heading is not zero.

    The driver advises the right value.
    """
    turned = BoardPose(0.0, 0.0, 1500.0)
    board = BoardSettings(running=True, frame=sent, initial_pose=turned, delta_period_s=period_s)
    told = advice(board, OmniBotSettings(delta_frame=read, delta_period_s=period_s))
    assert told is not None
    assert f"`delta_frame` to {sent}" in told


@pytest.mark.slow
@pytest.mark.parametrize("sent_s", DELTA_PERIODS_S)
@pytest.mark.parametrize("read_s", DELTA_PERIODS_S)
def test_a_wrong_period_of_deltas_is_noticed(sent_s: float, read_s: float) -> None:
    """The setting ``delta_period`` is wrong. Within 3 s, the driver advises the right value.

    There is no advice if the setting is right.
    """
    board = BoardSettings(running=True, delta_period_s=sent_s)
    told = advice(board, OmniBotSettings(delta_period_s=read_s), 3.0)
    if sent_s == read_s:
        assert told is None
    else:
        assert told is not None
        assert f"a delta every {sent_s:g} s, not every {read_s:g} s" in told
        assert told.endswith(f"set the parameter `delta_period` to {sent_s:g}")


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.04, 0.1])
@pytest.mark.parametrize("lose", [0.01, 0.05])
def test_lost_bytes_do_not_pass_for_another_period(period_s: float, lose: float) -> None:
    """Lost bytes do not make the driver advise another ``delta_period``.

    Fewer IMU frames come between two deltas, but the arrival times do not confirm another period.
    """
    sent = sent_by(BoardSettings(running=True, delta_period_s=period_s), LONG_S)
    driver = OmniBot(OmniBotSettings(delta_period_s=period_s))
    line = FaultyLine(LineFaults(lose=lose), 5)
    for tick, data in enumerate(sent):
        driver.receive(line.carry(data), tick / 100)
    assert driver.advice is None


@pytest.mark.slow
@pytest.mark.parametrize("lose", [0.001, 0.005])
def test_a_wrong_period_is_noticed_on_a_bad_line_too(lose: float) -> None:
    """The delta period is wrong, and the line loses bytes.

    The driver still advises the right period.
    """
    sent = sent_by(BoardSettings(running=True, delta_period_s=0.1), LONG_S)
    driver = OmniBot(OmniBotSettings())
    line = FaultyLine(LineFaults(lose=lose), 5)
    for tick, data in enumerate(sent):
        driver.receive(line.carry(data), tick / 100)
    assert driver.advice is not None
    assert "`delta_period` to 0.1" in driver.advice


@pytest.mark.slow
@pytest.mark.parametrize("reads_s", [0.016, 0.1, 0.5, 1.0])
def test_reads_that_bring_much_at_once_do_not_pass_for_another_period(reads_s: float) -> None:
    """A busy computer reads up to 1 s of data at once, and a read's deltas get one arrival time.

    The driver does not advise the user to change the delta period.
    """
    sent = sent_by(BoardSettings(running=True, delta_period_s=0.04), LONG_S)
    driver = OmniBot(OmniBotSettings())
    held, read_at = b"", 0.0
    for tick, data in enumerate(sent):
        held += data
        if tick / 100 >= read_at:
            driver.receive(held, tick / 100)
            held, read_at = b"", tick / 100 + reads_s
    assert driver.advice is None


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["earth", "body"])
@pytest.mark.parametrize("order", ["big", "little"])
@pytest.mark.parametrize("start", [BoardPose(), BoardPose(1e5, -3.0, 2e4), BoardPose(1e-12, 500.0)])
def test_nobody_is_told_anything_of_right_settings(
    frame: str, order: str, start: BoardPose
) -> None:
    """The driver gives no advice if all settings are right.

    The robot starts at the origin, close to it, or far away.
    """
    board = BoardSettings(running=True, frame=frame, pose_byte_order=order, initial_pose=start)
    assert advice(board, OmniBotSettings(delta_frame=frame, pose_byte_order=order), 15.0) is None


def test_the_user_is_told_once_and_odom_goes_on_by_deltas() -> None:
    """The byte order is wrong, so the poses are impossible. The driver gives one notice.

    The odometry ignores the poses and continues with the deltas.
    """
    start = BoardPose(3000.0, -2000.0, 0.0)
    bench = Bench(BoardSettings(running=True, pose_byte_order="little", initial_pose=start))
    bench.open()
    bench.run(2.0)
    for _ in range(20):
        bench.drive(0.3, 0.0, 0.2)
        bench.run(0.2)
    (told,) = [text for text in bench.notices if "pose_byte_order" in text]
    assert told.endswith("set the parameter `pose_byte_order` to little")
    pose, true = bench.odometry[-1].pose, bench.board.truth
    assert math.hypot(pose.x_m - true.x_m, pose.y_m - true.y_m) < 0.03


def test_poses_that_never_make_sense_leave_nothing_behind() -> None:
    """No pose is plausible for a long time. The list of stored deltas stays short."""
    suspicion = MisconfigurationChecks()
    zero, absurd = PoseFrame(0.0, 0.0, 0.0, 1), PoseFrame(1e-30, 1e-30, 1e-30, 1)
    suspicion.posed(zero, PoseReading(0.0, 0.0, 0.0), "big")
    for _ in range(1000):
        for _ in range(5):
            suspicion.displaced(earth(0.01, 0.0))
        suspicion.posed(absurd, PoseReading(0.0, 0.0, 0.0), "big")
    assert len(suspicion._moved) <= 10
