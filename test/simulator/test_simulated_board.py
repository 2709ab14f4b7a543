# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The firmware: modes, commands, odometry and the rhythm of what is sent."""

import struct
from math import degrees, hypot, pi
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.simulator import (
    BoardMode,
    BoardPose,
    BoardSettings,
    ReceivedCommand,
    SimulatedBoard,
    TruePose,
)

WAKE_UP = bytes(8)
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
ESTOP = bytes.fromhex("FF FE 10 00 00 00 00 00 00")
RUNNING = BoardSettings(running=True)

IMU, DELTA, POSE = b"\xff\xfa", b"\xff\xfb", b"\xff\xfc"


def velocity(x: int, y: int, omega: int) -> bytes:
    """A body velocity command in LSB."""
    return bytes.fromhex("FF FE 01") + struct.pack(">3h", x, y, omega)


def wheels(a: int, b: int, c: int) -> bytes:
    """A wheel command in LSB."""
    return bytes.fromhex("FF FE 02") + struct.pack(">3h", a, b, c)


def run(board: SimulatedBoard, seconds: float) -> bytes:
    """Everything that the board sends in some simulated seconds."""
    return b"".join(board.step() for _ in range(round(seconds * 100)))


def mode_of(board: SimulatedBoard) -> BoardMode:
    """The mode, asked anew: a type checker would take an attribute for unchanged."""
    return board.mode


def booted(settings: BoardSettings) -> SimulatedBoard:
    """A board that has just become paused and has not been spoken to."""
    board = SimulatedBoard(settings)
    run(board, settings.boot_time_s)
    assert mode_of(board) is BoardMode.PAUSED
    return board


def sent(board: SimulatedBoard, header: bytes) -> list[bytes]:
    """The frames of one kind that the board has sent."""
    return [frame.data for frame in board.sent if frame.data.startswith(header)]


def deltas(board: SimulatedBoard) -> list[tuple[int, int, int, int]]:
    """The 25 Hz frames so far: 0.1 mm, 0.1 mm, 1e-4 rad, SEQ."""
    return [struct.unpack(">3hB", frame[2:]) for frame in sent(board, DELTA)]


def poses(board: SimulatedBoard) -> list[tuple[float, float, float, int]]:
    """The 5 Hz frames so far: mm, mm, mrad, SEQ."""
    return [struct.unpack(">3fB", frame[2:]) for frame in sent(board, POSE)]


# Modes


def test_a_booting_board_is_dead_and_then_says_that_it_is_paused() -> None:
    """Nothing is sent and nothing is heard before the boot is over; then a text comes at once."""
    board = SimulatedBoard(BoardSettings(boot_time_s=0.3))
    board.receive(WAKE_UP + b"S")
    assert run(board, 0.29) == b""
    assert mode_of(board) is BoardMode.BOOTING
    assert board.step() == b"Paused: 0 \n"
    assert mode_of(board) is BoardMode.PAUSED


def test_a_paused_board_counts_once_a_second() -> None:
    """The number is a uint8 that ascends from zero and wraps."""
    board = booted(BoardSettings())
    assert run(board, 2.0) == b"Paused: 1 \nPaused: 2 \n"
    assert run(board, 254.0).endswith(b"Paused: 255 \nPaused: 0 \n")


def test_a_board_that_was_not_woken_misses_three_bytes() -> None:
    """The first S after the boot is lost when fewer than three bytes went before."""
    board = booted(BoardSettings())
    board.receive(b"SSS")
    assert mode_of(board) is BoardMode.PAUSED
    board.receive(b"S")
    assert mode_of(board) is BoardMode.NOMINAL


def test_p_pauses_and_unpauses() -> None:
    """The same letter toggles, and each pause begins with a text."""
    board = SimulatedBoard(RUNNING)
    board.receive(b"P")
    assert mode_of(board) is BoardMode.PAUSED
    assert board.step() == b"Paused: 0 \n"
    board.receive(b"P")
    assert mode_of(board) is BoardMode.NOMINAL
    assert board.step().startswith(IMU)


def test_s_starts_a_paused_board_and_leaves_a_running_one_alone() -> None:
    """Start is idempotent, and a motion goes on through it."""
    board = booted(BoardSettings())
    board.receive(WAKE_UP + b"SS" + velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(b"S")
    run(board, 1.0)
    assert mode_of(board) is BoardMode.NOMINAL
    assert board.truth.vx_mps == pytest.approx(0.5, rel=0.02)


def test_r_reboots_the_board_but_not_the_robot() -> None:
    """Odometry, SEQ and the wake-up start afresh; the true pose stays."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 2.0)
    board.receive(b"R" + velocity(35, 0, 0))
    assert mode_of(board) is BoardMode.BOOTING
    run(board, 1.0)
    at_rest = board.truth
    assert at_rest.x_m > 0.9
    assert at_rest.vx_mps == 0.0
    assert board.odometry == BoardPose(0.0, 0.0, 0.0)
    board.sent.clear()
    board.receive(WAKE_UP + b"S")
    run(board, 0.2)
    assert [seq for *_, seq in deltas(board)] == [0, 1, 2, 3, 4]
    assert poses(board) == [(0.0, 0.0, 0.0, 0)]
    assert board.truth == at_rest


def test_a_power_cycle_does_what_r_does() -> None:
    """`reboot` and the letter end in the same state."""
    by_letter, by_power = SimulatedBoard(RUNNING), SimulatedBoard(RUNNING)
    by_letter.receive(b"R")
    by_power.reboot()
    assert run(by_letter, 3.0) == run(by_power, 3.0)
    assert mode_of(by_letter) is mode_of(by_power) is BoardMode.PAUSED


def test_a_motion_frame_to_a_paused_board_acts_by_its_letters() -> None:
    """A 0x52 within a command resets a paused board, a 0x50 sets it running."""
    board = booted(BoardSettings())
    board.receive(WAKE_UP + velocity(0x52, 0, 0))
    assert mode_of(board) is BoardMode.BOOTING
    run(board, 1.0)
    board.receive(WAKE_UP + velocity(0, 0x50, 0))
    assert mode_of(board) is BoardMode.NOMINAL
    run(board, 1.0)
    assert board.truth.vy_mps == 0.0


def test_a_motion_frame_to_a_sleeping_board_loses_its_header_to_the_wake_up() -> None:
    """The frame that wakes the board can reset it, too."""
    board = booted(BoardSettings())
    board.receive(velocity(0x52, 0, 0))
    assert [command.kind for command in board.commands] == ["reset"]
    assert mode_of(board) is BoardMode.BOOTING


def test_a_running_board_takes_no_letters_out_of_frames() -> None:
    """Within a control frame 0x50, 0x52 and 0x53 are numbers."""
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(0x50, 0x52, 0x53))
    assert list(board.commands) == [ReceivedCommand(0, "wheels", (0x50, 0x52, 0x53))]
    assert mode_of(board) is BoardMode.NOMINAL


def test_an_unknown_control_mode_is_ignored() -> None:
    """Its frame is taken whole and changes nothing."""
    board = SimulatedBoard(RUNNING)
    board.receive(bytes.fromhex("FF FE 03 00 50 00 50 00 50"))
    assert not board.commands
    assert mode_of(board) is BoardMode.NOMINAL


# Commands and motion


@pytest.mark.parametrize(
    ("command", "twist"),
    [
        (velocity(35, 0, 0), (0.5, 0.0, 0.0)),
        (velocity(70, 0, 0), (1.0, 0.0, 0.0)),
        (velocity(0, -35, 0), (0.0, -0.5, 0.0)),
        (velocity(0, 0, 250), (0.0, 0.0, 0.5)),
        (velocity(14, 21, -100), (0.2, 0.3, -0.2)),
        (wheels(-14, -14, -14), (0.0, 0.0, 0.2 / 0.143)),
    ],
)
def test_a_commanded_velocity_is_reached(command: bytes, twist: tuple[float, float, float]) -> None:
    """70 LSB are 1 m/s and 500 LSB are 1 rad/s, settled after two seconds."""
    board = SimulatedBoard(RUNNING)
    board.receive(command)
    run(board, 2.0)
    truth = board.truth
    assert (truth.vx_mps, truth.vy_mps, truth.yaw_rate) == pytest.approx(twist, abs=0.005)


def test_the_scales_of_the_settings_are_the_units_of_commands() -> None:
    """Other scales give other speeds for the same command."""
    board = SimulatedBoard(BoardSettings(running=True, linear_scale=100, angular_scale=1000))
    board.receive(velocity(20, 0, 200))
    run(board, 2.0)
    assert board.truth.vx_mps == pytest.approx(0.2, abs=0.005)
    assert board.truth.yaw_rate == pytest.approx(0.2, abs=0.005)


def test_a_wheel_command_drives_that_wheel_alone() -> None:
    """The rim speeds of A, B and C follow CMD_A, CMD_B and CMD_C."""
    for wheel in range(3):
        board = SimulatedBoard(RUNNING)
        values = [0, 0, 0]
        values[wheel] = 28
        board.receive(wheels(*values))
        run(board, 2.0)
        assert board.rim_speeds_mps == pytest.approx([value / 70 for value in values], abs=0.003)


def test_a_motion_goes_on_without_further_commands() -> None:
    """The board does not stop by itself."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 60.0)
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_stop_stops() -> None:
    """The appendix's stop frame brings the robot to rest."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(STOP)
    run(board, 1.0)
    assert board.truth.vx_mps == 0.0


@pytest.mark.parametrize("latches", [False, True])
def test_an_emergency_stop_stops_at_once(latches: bool) -> None:
    """The motors are off within the tick, and the robot stands within 0.3 s."""
    board = SimulatedBoard(BoardSettings(running=True, estop_latches=latches))
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(ESTOP)
    assert board.estopped
    run(board, 0.3)
    assert board.rim_speeds_mps == (0.0, 0.0, 0.0)
    at_rest = board.truth
    run(board, 5.0)
    assert board.truth == at_rest


def test_an_emergency_stop_that_does_not_latch_ends_with_the_next_motion() -> None:
    """The next motion command moves the robot again."""
    board = SimulatedBoard(RUNNING)
    board.receive(ESTOP + velocity(35, 0, 0))
    assert not board.estopped
    run(board, 2.0)
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_a_latching_emergency_stop_ends_with_a_reset_alone() -> None:
    """Motion, pause and start do not release it, a reset does; refused motion is not logged."""
    board = SimulatedBoard(BoardSettings(running=True, estop_latches=True))
    board.receive(ESTOP + velocity(35, 0, 0) + b"PS" + velocity(35, 0, 0))
    run(board, 2.0)
    assert board.estopped
    assert board.truth == TruePose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert [command.kind for command in board.commands] == ["estop", "pause", "start"]
    board.receive(b"R")
    run(board, 1.0)
    board.receive(WAKE_UP + b"S" + velocity(35, 0, 0))
    run(board, 2.0)
    assert not board.estopped
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


POSITION = BoardSettings(running=True, control="position")


@pytest.mark.parametrize("goal", [(1000, 500, 1571), (-300, 0, -7000), (0, 0, 0), (2, -1, 1)])
def test_with_the_switch_on_position_the_robot_drives_to_the_commanded_pose(
    goal: tuple[int, int, int],
) -> None:
    """In mm and mrad of the board's own earth frame, whole turns included; then it stands."""
    board = SimulatedBoard(POSITION)
    board.receive(velocity(*goal))
    run(board, 15.0)
    there = board.odometry
    assert (there.x_mm, there.y_mm, there.theta_mrad) == pytest.approx(goal, abs=2.0)
    at_rest = board.truth
    run(board, 2.0)
    assert board.truth == at_rest
    assert board.commands[-1] == ReceivedCommand(0, "pose", goal)


def test_on_the_way_to_a_pose_the_robot_keeps_to_a_walk() -> None:
    """However far the pose is."""
    board = SimulatedBoard(POSITION)
    board.receive(velocity(5000, 5000, 0))
    run(board, 5.0)
    assert hypot(board.truth.vx_mps, board.truth.vy_mps) == pytest.approx(0.3, abs=0.01)


def test_zeros_in_mode_one_are_a_drive_to_the_origin_and_stop_is_a_stop() -> None:
    """The reason why Stop is a frame of mode two."""
    board = SimulatedBoard(
        BoardSettings(running=True, control="position", initial_pose=BoardPose(1000.0))
    )
    board.receive(velocity(0, 0, 0))
    run(board, 1.0)
    assert board.truth.vx_mps < -0.2
    board.receive(STOP)
    run(board, 1.0)
    assert board.truth.vx_mps == 0.0
    assert board.odometry.x_mm > 500.0


@pytest.mark.parametrize("ending", [ESTOP, b"P", b"PS"])
def test_an_emergency_stop_or_a_pause_forgets_the_pose_to_drive_to(ending: bytes) -> None:
    """It does not drive on afterwards."""
    board = SimulatedBoard(POSITION)
    board.receive(velocity(1000, 0, 0))
    run(board, 1.0)
    board.receive(ending)
    run(board, 1.0)
    at_rest = board.truth
    run(board, 1.0)
    assert board.truth == at_rest


def test_a_pause_stops_the_motors_and_forgets_the_command() -> None:
    """The robot stands after un-pausing until it is commanded anew."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(35, 0, 0))
    run(board, 1.0)
    board.receive(b"P")
    run(board, 0.3)
    at_rest = board.truth
    assert at_rest.vx_mps == 0.0
    board.receive(b"P")
    run(board, 2.0)
    assert board.truth == at_rest


def test_what_was_received_and_obeyed_is_on_record() -> None:
    """Bytes in full, commands with tick, kind and values."""
    board = SimulatedBoard(RUNNING)
    run(board, 0.05)
    data = velocity(1, -2, 3) + b"x" + STOP
    board.receive(data)
    assert board.received == data
    assert list(board.commands) == [
        ReceivedCommand(5, "velocity", (1, -2, 3)),
        ReceivedCommand(5, "wheels", (0, 0, 0)),
    ]


def test_the_record_of_received_bytes_is_bounded() -> None:
    """Of very much input the newest is kept."""
    board = SimulatedBoard(RUNNING)
    for _ in range(30):
        board.receive(bytes(100_000))
    board.receive(b"end")
    assert len(board.received) < 1_100_000
    assert board.received.endswith(b"end")


command_bytes = st.lists(
    st.one_of(
        st.sampled_from([b"S", b"P", b"R", STOP, ESTOP, velocity(0x50, 0x52, 0x53)]),
        st.binary(max_size=12),
    ),
    max_size=12,
).map(b"".join)


@given(command_bytes, st.data())
@settings(max_examples=60)
def test_the_chunking_of_the_input_does_not_matter(stream: bytes, data: st.DataObject) -> None:
    """The same bytes within one tick, however cut, are obeyed alike and answered alike."""
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    whole, cut = SimulatedBoard(RUNNING), SimulatedBoard(RUNNING)
    whole.receive(stream)
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        cut.receive(stream[start:end])
    assert cut.commands == whole.commands
    assert cut.mode is whole.mode
    assert run(cut, 0.5) == run(whole, 0.5)


# Output


def test_a_nominal_board_sends_at_100_25_and_5_hz() -> None:
    """Ten seconds hold 1000 IMU frames, 250 deltas and 50 poses, and nothing else."""
    board = SimulatedBoard(RUNNING)
    data = run(board, 10.0)
    counts = [len(sent(board, header)) for header in (IMU, DELTA, POSE)]
    assert counts == [1000, 250, 50]
    assert len(data) == 1000 * 14 + 250 * 9 + 50 * 15


def test_an_imu_only_board_sends_imu_frames_alone_and_obeys_motion() -> None:
    """The third mode of the manual listens like the second."""
    board = booted(BoardSettings(imu_only=True))
    board.receive(WAKE_UP + b"S" + velocity(35, 0, 0))
    data = run(board, 2.0)
    assert mode_of(board) is BoardMode.IMU_ONLY
    assert len(data) == 200 * 14
    assert board.truth.vx_mps == pytest.approx(0.5, abs=0.005)


def test_within_a_tick_the_order_is_imu_delta_pose() -> None:
    """The twentieth tick carries all three."""
    board = SimulatedBoard(RUNNING)
    run(board, 0.19)
    tick = board.step()
    assert len(tick) == 14 + 9 + 15
    assert (tick[:2], tick[14:16], tick[23:25]) == (IMU, DELTA, POSE)


def test_the_record_of_what_was_sent_is_what_was_sent() -> None:
    """Its frames in order are the bytes that left the board."""
    board = SimulatedBoard(BoardSettings())
    first = run(board, 1.0)
    board.receive(WAKE_UP + b"S")
    assert first + run(board, 1.0) == b"".join(frame.data for frame in board.sent)


def test_both_sequences_count_by_themselves_and_wrap() -> None:
    """Each SEQ is its own uint8, from zero."""
    board = SimulatedBoard(RUNNING)
    run(board, 52.0)
    assert [seq for *_, seq in deltas(board)] == [n % 256 for n in range(1300)]
    assert [seq for *_, seq in poses(board)] == [n % 256 for n in range(260)]


def test_a_sequence_goes_on_after_a_pause() -> None:
    """Only a reboot sets SEQ to zero, and motion while paused is in the next delta."""
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


def drive_square(board: SimulatedBoard) -> None:
    """Four sides of a metre, two of them sideways, turned by 90 degrees half way."""
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
    """Without slip and scale errors the two agree after four metres to a millimetre."""
    board = SimulatedBoard(RUNNING)
    drive_square(board)
    truth, odometry = board.truth, board.odometry
    assert truth.yaw_rad == pytest.approx(pi / 2, abs=0.01)
    assert hypot(truth.x_m, truth.y_m) > 1.9
    assert odometry.x_mm == pytest.approx(1000 * truth.x_m, abs=1.0)
    assert odometry.y_mm == pytest.approx(1000 * truth.y_m, abs=1.0)
    assert odometry.theta_mrad == pytest.approx(1000 * truth.yaw_rad, abs=1.0)


def test_slip_and_scale_errors_part_the_odometry_from_the_truth() -> None:
    """The board believes in its wheels, the truth does not."""
    board = SimulatedBoard(
        BoardSettings(running=True, slip=0.05, wheel_radius_scale=(1.0, 1.01, 1.0))
    )
    drive_square(board)
    apart_mm = hypot(
        board.odometry.x_mm - 1000 * board.truth.x_m, board.odometry.y_mm - 1000 * board.truth.y_m
    )
    assert apart_mm > 20


def test_earth_frame_deltas_add_up_to_the_pose() -> None:
    """Summed unrotated, they are the board's own pose to half an LSB for each."""
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
    """Driving forward at 0.5 m/s, headed along the earth's y: 20 mm, along y or along x."""
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
    """A board that has already driven sends its pose, and deltas of zero while it stands."""
    board = SimulatedBoard(
        BoardSettings(running=True, initial_pose=BoardPose(1500.0, -250.0, 8000.0))
    )
    run(board, 0.2)
    assert poses(board) == [(1500.0, -250.0, 8000.0, 0)]
    assert {delta[:3] for delta in deltas(board)} == {(0, 0, 0)}
    assert board.truth == TruePose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_heading_is_sent_unwrapped() -> None:
    """Two turns are more than 2 pi, in mrad."""
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(-40, -40, -40))
    run(board, 4.0)
    assert poses(board)[-1][2] > 2 * 2000 * pi


def test_the_pose_can_be_sent_little_endian() -> None:
    """The setting turns the bytes of the floats round."""
    pose = BoardPose(1000.0, 0.0, 0.0)
    board = SimulatedBoard(BoardSettings(running=True, pose_byte_order="little", initial_pose=pose))
    run(board, 0.2)
    assert sent(board, POSE)[0][2:6] == bytes.fromhex("00 00 7A 44")


def test_equal_settings_and_input_give_equal_bytes() -> None:
    """The seed decides over everything random."""

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


# IMU


def readings(board: SimulatedBoard, seconds: float) -> list[tuple[float, ...]]:
    """IMU readings in g and degrees per second, taken while the time passes."""
    board.sent.clear()
    run(board, seconds)
    raw = [struct.unpack(">6h", frame[2:]) for frame in sent(board, IMU)]
    return [(*(a / 16384 for a in one[:3]), *(w / 131 for w in one[3:])) for one in raw]


def mean(values: list[tuple[float, ...]]) -> tuple[float, ...]:
    """The mean of each column."""
    return tuple(sum(column) / len(values) for column in zip(*values, strict=True))


def rms(values: list[tuple[float, ...]]) -> tuple[float, ...]:
    """The deviation of each column from its mean."""
    means = mean(values)
    return tuple(
        (sum((value - middle) ** 2 for value in column) / len(values)) ** 0.5
        for column, middle in zip(zip(*values, strict=True), means, strict=True)
    )


def test_at_rest_the_upside_down_sensor_feels_minus_one_g() -> None:
    """Gravity stands on -z of the sensor; bias and noise are those of the settings."""
    board = SimulatedBoard(BoardSettings(running=True, gyro_bias_dps=(1.0, -2.0, 3.0)))
    values = readings(board, 20.0)
    assert mean(values) == pytest.approx((0.0, 0.0, -1.0, 1.0, -2.0, 3.0), abs=0.005)
    assert rms(values)[:3] == pytest.approx([0.0028] * 3, rel=0.1)
    assert rms(values)[3:] == pytest.approx([0.05] * 3, rel=0.1)


def test_the_gyro_at_rest_reads_like_frame_headers_by_default() -> None:
    """The mean raw counts are -6, -5 and -4."""
    values = mean(readings(SimulatedBoard(RUNNING), 20.0))
    assert [rate * 131 for rate in values[3:]] == pytest.approx([-6, -5, -4], abs=0.5)


def test_turning_left_is_negative_on_the_upside_down_gyro() -> None:
    """A yaw rate of 0.5 rad/s reads -0.5 on z."""
    board = SimulatedBoard(BoardSettings(running=True, gyro_bias_dps=(0.0, 0.0, 0.0)))
    board.receive(velocity(0, 0, 250))
    run(board, 2.0)
    *_, rate_z = mean(readings(board, 2.0))
    assert rate_z == pytest.approx(-degrees(0.5), rel=0.01)


def test_driving_off_to_the_left_is_felt_on_minus_y() -> None:
    """Accelerations while speeding up add to the speed, along x as it is and along y reversed."""
    board = SimulatedBoard(BoardSettings(running=True, accel_noise_g=0.0))
    board.receive(velocity(14, 28, 0))
    values = readings(board, 1.0)
    gained_mps = [sum(column) * 9.80665 * 0.01 for column in zip(*values, strict=True)]
    assert gained_mps[:2] == pytest.approx((0.2, -0.4), abs=0.005)


@pytest.mark.parametrize(
    ("x", "y", "felt_mps2"), [(35, 0, (0.0, -0.5)), (0, 35, (-0.5, 0.0))], ids=["ahead", "left"]
)
def test_a_curve_is_felt_as_centripetal_acceleration(
    x: int, y: int, felt_mps2: tuple[float, float]
) -> None:
    """Turning left at 1 rad/s presses 0.5 m/s² to the left of the motion, y reversed."""
    board = SimulatedBoard(RUNNING)
    board.receive(velocity(x, y, 500))
    run(board, 2.0)
    values = mean(readings(board, 5.0))
    assert values[:2] == pytest.approx([felt / 9.80665 for felt in felt_mps2], abs=0.002)


def test_readings_saturate_at_the_range_of_the_sensor() -> None:
    """Beyond 250 degrees per second the gyro stays at the end of its int16."""
    board = SimulatedBoard(RUNNING)
    board.receive(wheels(60, 60, 60))
    run(board, 1.0)
    assert readings(board, 0.1)[0][5] == 32767 / 131


def test_a_stuck_gyro_reads_its_counts_whatever_the_motion() -> None:
    """All three words stay, while the accelerometer goes on."""
    board = SimulatedBoard(BoardSettings(running=True, gyro_stuck=(-6, -5, -4)))
    board.receive(velocity(0, 0, 250))
    run(board, 1.0)
    frames = sent(board, IMU)
    assert {frame[8:] for frame in frames} == {bytes.fromhex("FF FA FF FB FF FC")}
    assert len({frame[:8] for frame in frames}) > 50
