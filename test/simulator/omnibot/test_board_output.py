# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a running board's output, its timing, and its odometry from the encoders."""

from math import hypot, pi
from random import Random

import pytest
from board_talk import (
    DELTA,
    IMU,
    POSE,
    RUNNING,
    STOP,
    WAKE_UP,
    booted,
    deltas,
    mode_of,
    poses,
    run,
    sent,
    velocity,
    wheels,
)

from omnibot_driver.simulator.omnibot import (
    BoardMode,
    BoardPose,
    BoardSettings,
    SimulatedBoard,
    TruePose,
)


def test_a_nominal_board_sends_at_100_25_and_5_hz() -> None:
    """In 10 s the board sends 1000 IMU frames, 250 deltas and 50 poses, and nothing else."""
    board = SimulatedBoard(RUNNING)
    data = run(board, 10.0)
    counts = [len(sent(board, header)) for header in (IMU, DELTA, POSE)]
    assert counts == [1000, 250, 50]
    assert len(data) == 1000 * 14 + 250 * 9 + 50 * 15


def test_a_board_may_send_its_deltas_at_10_hz() -> None:
    """With a delta period of 0.1 s, a delta covers ten ticks and comes after ten IMU frames."""
    board = SimulatedBoard(BoardSettings(running=True, delta_period_s=0.1))
    board.receive(velocity(35, 0, 0))
    run(board, 10.0)
    counts = [len(sent(board, header)) for header in (IMU, DELTA, POSE)]
    assert counts == [1000, 100, 50]
    assert [seq for *_, seq in deltas(board)] == list(range(100))
    assert deltas(board)[-1][0] == pytest.approx(500, abs=10)  # 0.5 m/s in 0.1 mm


def test_an_imu_only_board_sends_imu_frames_alone_and_obeys_motion() -> None:
    """In IMU-only mode the board sends only IMU frames. It obeys commands as in nominal mode."""
    board = booted(BoardSettings(imu_only=True))
    board.receive(WAKE_UP + b"S" + velocity(35, 0, 0))
    data = run(board, 2.0)
    assert mode_of(board) is BoardMode.IMU_ONLY
    assert len(data) == 200 * 14
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_within_a_tick_the_order_is_imu_delta_pose() -> None:
    """In the twentieth tick, the board sends an IMU frame, a delta and a pose, in this order."""
    board = SimulatedBoard(RUNNING)
    run(board, 0.19)
    tick = board.step()
    assert len(tick) == 14 + 9 + 15
    assert (tick[:2], tick[14:16], tick[23:25]) == (IMU, DELTA, POSE)


def test_the_record_of_what_was_sent_is_what_was_sent() -> None:
    """The board's record of sent frames has all bytes that ``step`` has returned, in order."""
    board = SimulatedBoard(BoardSettings())
    first = run(board, 1.0)
    board.receive(WAKE_UP + b"S")
    assert first + run(board, 1.0) == b"".join(frame.data for frame in board.sent)


@pytest.mark.slow
def test_both_sequences_count_by_themselves_and_wrap() -> None:
    """Deltas and poses each have their own SEQ. Each SEQ counts from 0 to 255 and then wraps."""
    board = SimulatedBoard(RUNNING)
    run(board, 52.0)
    assert [seq for *_, seq in deltas(board)] == [n % 256 for n in range(1300)]
    assert [seq for *_, seq in poses(board)] == [n % 256 for n in range(260)]


def test_a_sequence_goes_on_after_a_pause() -> None:
    """After a pause, SEQ continues.

    The board is paused during a drive and starts again. The first delta after the pause also
    contains the motion during the pause.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 2.0)
    board.receive(b"P")
    run(board, 1.0)
    board.receive(b"P")
    run(board, 0.2)
    assert [seq for *_, seq in deltas(board)] == list(range(55))
    assert deltas(board)[50][0] > 200
    assert sum(dx for dx, *_ in deltas(board)) == pytest.approx(
        10 * board.odometry.x_mm, abs=0.5 * 55
    )


def test_the_rhythm_of_deltas_and_poses_goes_on_through_a_pause() -> None:
    """The board is paused and starts again.

    Ticks are counted during the pause too, so deltas and poses keep their rhythm.
    """
    board = SimulatedBoard(RUNNING)
    run(board, 0.05)
    board.receive(b"P")
    run(board, 0.06)
    board.receive(b"P")
    run(board, 0.09)
    ticks = {
        header: [one.tick for one in board.sent if one.data.startswith(header)]
        for header in (DELTA, POSE)
    }
    assert ticks == {DELTA: [4, 12, 16, 20], POSE: [20]}


def drive_square(board: SimulatedBoard) -> None:
    """Drive four sides of 1 m, two of them sideways. Turn by 90 degrees after the second side."""
    legs = [velocity(35, 0, 0), velocity(0, 35, 0)] * 2
    for leg, command in enumerate(legs):
        board.receive(command)
        run(board, 2.0)
        board.receive(STOP)
        run(board, 1.0)
        if leg == 1:
            board.receive(velocity(0, 0, 250))
            run(board, pi)
            board.receive(STOP)
            run(board, 1.0)


def test_the_odometry_is_the_truth_but_for_quantisation() -> None:
    """Without slip and scale errors, the board's odometry is right within 1 mm after 4 m."""
    board = SimulatedBoard(RUNNING)
    drive_square(board)
    truth, odometry = board.truth, board.odometry
    assert truth.yaw_rad == pytest.approx(pi / 2, abs=0.01)
    assert hypot(truth.x_m, truth.y_m) > 1.9
    assert odometry.x_mm == pytest.approx(1000 * truth.x_m, abs=1.0)
    assert odometry.y_mm == pytest.approx(1000 * truth.y_m, abs=1.0)
    assert odometry.theta_mrad == pytest.approx(1000 * truth.yaw_rad, abs=1.0)


def test_slip_and_scale_errors_part_the_odometry_from_the_truth() -> None:
    """With slip and a wheel of another size, the board's odometry differs from the true pose."""
    board = SimulatedBoard(
        BoardSettings(running=True, slip=0.05, wheel_radius_scale=(1.0, 1.01, 1.0))
    )
    drive_square(board)
    apart_mm = hypot(
        board.odometry.x_mm - 1000 * board.truth.x_m, board.odometry.y_mm - 1000 * board.truth.y_m
    )
    assert apart_mm > 20


def test_earth_frame_deltas_add_up_to_the_pose() -> None:
    """Deltas in the earth frame add up to the board's pose, within half an LSB for each delta."""
    board = SimulatedBoard(RUNNING)
    drive_square(board)
    run(board, 0.2 - 0.01 * (board.tick % 20))
    received = deltas(board)
    x_mm, y_mm, theta_mrad, _ = poses(board)[-1]
    bound = 0.5 * len(received)
    assert sum(dx for dx, *_ in received) == pytest.approx(10 * x_mm, abs=bound)
    assert sum(dy for _, dy, *_ in received) == pytest.approx(10 * y_mm, abs=bound)
    assert sum(dth for *_, dth, _ in received) == pytest.approx(10 * theta_mrad, abs=bound)


@pytest.mark.parametrize(
    ("frame", "expected"), [("earth", (0, 200, 0)), ("body", (200, 0, 0))], ids=["earth", "body"]
)
def test_a_delta_is_in_the_earth_frame_or_in_the_body_frame(
    frame: str, expected: tuple[int, int, int]
) -> None:
    """The robot faces and drives along the y axis of the earth frame, at 0.5 m/s.

    Its delta is 20 mm: along y in the earth frame, along x in the body frame.
    """
    board = SimulatedBoard(
        BoardSettings(
            running=True,
            frame="earth" if frame == "earth" else "body",
            initial_pose=BoardPose(3000.0, 0.0, 1000 * pi / 2),
        )
    )
    board.receive(velocity(35, 0, 0))
    run(board, 3.0)
    assert deltas(board)[-1][:3] == pytest.approx(expected, abs=2)


def test_an_initial_pose_is_the_boards_own_and_not_a_movement() -> None:
    """A board begins with an initial pose and sends it. Its deltas and the true pose are zero."""
    board = SimulatedBoard(
        BoardSettings(running=True, initial_pose=BoardPose(1500.0, -250.0, 8000.0))
    )
    run(board, 0.2)
    assert poses(board) == [(1500.0, -250.0, 8000.0, 0)]
    assert {delta[:3] for delta in deltas(board)} == {(0, 0, 0)}
    assert board.truth == TruePose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_heading_is_sent_unwrapped() -> None:
    """The robot turns more than twice.

    The heading that the board sends grows beyond 4 pi, in mrad.
    """
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(-40, -40, -40))
    run(board, 4.0)
    assert poses(board)[-1][2] > 2 * 2000 * pi


def test_the_pose_can_be_sent_little_endian() -> None:
    """A setting reverses the bytes of each float of the pose frame."""
    pose = BoardPose(1000.0, 0.0, 0.0)
    board = SimulatedBoard(BoardSettings(running=True, pose_byte_order="little", initial_pose=pose))
    run(board, 0.2)
    assert sent(board, POSE)[0][2:6] == bytes.fromhex("00 00 7A 44")


def test_equal_settings_and_input_give_equal_bytes() -> None:
    """Equal settings and commands give equal bytes. Another seed gives other bytes."""

    def stream(seed: int) -> bytes:
        board = SimulatedBoard(BoardSettings(seed=seed, running=True, slip=0.1))
        commands = Random(1)
        data = b""
        for _ in range(10):
            board.receive(velocity(*(commands.randrange(-30, 31) for _ in range(3))))
            data += run(board, 0.5)
        return data

    assert stream(1) == stream(1)
    assert stream(1) != stream(2)
