# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the opening of a line, the detection of the board on it, and the names of the states."""

import pytest
from robots import standing
from session_bench import OPENING, START, Bench

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.omnibot import DeltaFrame, ImuFrame, encode
from omnibot_driver.core.omnibot.frames import Frame
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardSettings

REST = ImuFrame((120, -80, -16384), (131, 0, -131))


@pytest.fixture
def bench() -> Bench:
    return standing()


def test_the_opening_sequence_is_zeros_stop_and_s_until_data_flows() -> None:
    """When the port opens, the driver writes zeros, Stop and S.

    It repeats S until data arrives, because a booting board ignores bytes.
    """
    bench = Bench(BoardSettings(boot_time_s=2.0))
    bench.open()
    bench.run(1.25)
    assert bench.written_since(0) == OPENING + START + START + START
    bench.run_until_state("nominal")
    assert [command.kind for command in bench.board.commands][:1] == ["start"]


def test_the_state_follows_what_is_heard_and_nothing_else() -> None:
    """The state follows the port and the data of the board.

    * Closed port: disconnected.
    * Port that has just been opened: connecting.
    * Board that reports a pause: paused.
    * Started board: nominal.
    """
    bench = Bench(run=False)
    assert bench.session.state == "disconnected"
    bench.open()
    assert bench.session.state == "connecting"
    bench.run_until_state("paused")
    bench.ask(Request.START, 5.0)
    assert bench.session.state == "nominal"
    bench.close()
    assert bench.session.state == "disconnected"


def test_without_auto_start_a_paused_board_stays_paused() -> None:
    """``auto_start`` is false. The driver writes no S, and the board stays paused."""
    bench = Bench(run=False)
    bench.open()
    bench.run(3.0)
    assert bench.session.state == "paused"
    assert bench.written_since(0) == OPENING


def test_imu_frames_without_deltas_are_imu_only_mode() -> None:
    """The board does not report IMU-only mode.

    The driver infers it from IMU frames without deltas.
    """
    bench = Bench(BoardSettings(imu_only=True))
    bench.open()
    bench.run_until_state("imu_only")
    assert any(isinstance(event, ImuEstimate) for event in bench.events)
    assert not bench.odometry


def test_garbage_is_not_an_understood_board() -> None:
    """Bytes arrive that form no frame. The state stays ``connecting``, and one notice appears."""
    bench = Bench()
    bench.speaks = False
    bench.open()
    for _ in range(300):
        bench.session.inbound.receive(b"\x00\x55\xff\x13" * 4, bench.now)
        bench.run(0.01)
    assert bench.session.state == "connecting"
    assert [text for text in bench.notices if "baudrate" in text] == bench.notices
    assert len(bench.notices) == 1


def test_a_silent_board_is_told_once() -> None:
    """The driver reports a silence of the board once.

    After new data, it reports the next silence.
    """
    bench = Bench()
    bench.speaks = False
    bench.open()
    bench.run(10.0)
    assert len([text for text in bench.notices if "power" in text]) == 1
    bench.speaks = True
    bench.run(2.0)
    bench.speaks = False
    bench.run(10.0)
    assert len([text for text in bench.notices if "power" in text]) == 2


@pytest.mark.parametrize("came", [b"", encode(REST)[:5]], ids=["nothing", "part of a frame"])
def test_a_silence_before_the_first_delta_does_not_make_later_stamps_old(came: bytes) -> None:
    """When the board sends again after a silence of 8 s, no stamp is from before the silence.

    The silence begins after three IMU frames, before the driver knows the board's mode.
    """
    bench = Bench(BoardSettings(running=True))
    bench.open()
    bench.run(0.03)
    assert any(isinstance(event, ImuEstimate) for event in bench.events)
    assert bench.session.state == "connecting"
    bench.speaks = False
    bench.run(3.0)
    if came:
        bench.session.inbound.receive(came, bench.now)
    bench.run(5.0)
    bench.speaks = True
    bench.events.clear()
    bench.run(0.3)
    stamps = [e.stamp_s for e in bench.events if isinstance(e, ImuEstimate | OdometryEstimate)]
    assert len(stamps) >= 29
    assert min(stamps) > bench.now - 0.4


@pytest.mark.parametrize("waits", [ImuFrame((0, 0, -16384), (0, 0, -1)), DeltaFrame(7, 0, 0, 255)])
def test_a_frame_that_waits_when_the_board_falls_silent_is_not_published(waits: Frame) -> None:
    """The decoder holds a frame whose last byte may begin another frame.

    If the board then falls silent, this frame is never published.
    """
    bench, rest = Bench(), encode(REST)
    bench.open()
    bench.session.inbound.receive(rest * 3 + encode(waits), bench.now + 0.03)
    bench.session.tick(bench.now + 1.6)
    bench.settle()
    bench.session.inbound.receive(rest * 4, bench.now + 60.0)
    bench.settle()
    assert bench.odometry == []
    rates = [event.angular_velocity for event in bench.events if isinstance(event, ImuEstimate)]
    assert len(rates) == 7
    assert len(set(rates)) == 1
    assert bench.session.state == "connecting"


def test_a_board_that_restarts_is_started_again_and_stands_still(bench: Bench) -> None:
    """If the board restarts during a drive, the driver starts it, but does not repeat the command.

    The robot stays at rest until the next command.
    """
    bench.drive(0.5)
    bench.run(0.2)
    bench.board.reboot()
    bench.run_until_state("paused")
    noticed = len(bench.written) - 1
    bench.run_until_state("nominal")
    bench.run(1.0)
    assert bench.still()
    assert bench.written_since(noticed).startswith(OPENING + START)
    assert b"\xff\xfe\x01" not in bench.written_since(noticed)
    bench.drive(0.3)
    bench.run(0.3)
    assert not bench.still()


def test_a_paused_robot_is_still_paused_after_a_reconnect(bench: Bench) -> None:
    """The user pauses the board. Then the driver's port is closed and opened again.

    Opening the port does not start the board: it is still paused.
    """
    bench.ask(Request.PAUSE, 5.0)
    bench.close()
    bench.open()
    bench.run(3.0)
    assert bench.session.state == "paused"
