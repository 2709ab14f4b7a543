# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's bytes as readings in SI units, and wishes as the board's bytes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import twists, words

from omnibot_driver.core.board import (
    DisplacementReading,
    ImuReading,
    Mode,
    PausedReading,
    PoseReading,
    Reading,
)
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.imu import ImuScale
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.omnibot import (
    DeltaFrame,
    ImuFrame,
    OmniBot,
    OmniBotSettings,
    PausedFrame,
    PoseFrame,
    encode,
)
from omnibot_driver.core.omnibot.frames import Frame
from omnibot_driver.core.se2 import Pose

STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
REST = ImuFrame((120, -80, -16384), (131, 0, -131))
TEXT = b"Paused: 1 \n"


def bot(**settings: object) -> OmniBot:
    return OmniBot(OmniBotSettings(**settings))  # type: ignore[arg-type]


def readings(board: OmniBot, *sent: Frame) -> list[Reading]:
    """What the board reads in frames on the line, behind two that bring it into step."""
    board.receive(encode(REST) * 2, 0.0)
    found = [reading for frame in sent for reading in board.receive(encode(frame), 0.0)]
    return found + board.flush(0.0)


def in_mode(mode: Mode) -> OmniBot:
    """A board that is believed in this mode, for what was heard."""
    board = bot()
    if mode is Mode.PAUSED:
        board.receive(TEXT, 0.0)
    elif mode is Mode.NOMINAL:
        readings(board, DeltaFrame(0, 0, 0, 0))
    elif mode is Mode.IMU_ONLY:
        board.receive(encode(REST) * 40, 0.0)
    assert board.mode is mode
    return board


def moved(seq: int) -> DeltaFrame:
    return DeltaFrame(1, 1, 1, seq)


# Readings


def test_a_delta_is_in_tenths_of_millimetres_and_milliradians_over_40_ms() -> None:
    """10000 counts are 1 m, and 1 rad."""
    (reading,) = readings(bot(), DeltaFrame(10000, -5000, 2500, 0))
    assert reading == DisplacementReading(
        pytest.approx(1.0), pytest.approx(-0.5), pytest.approx(0.25), "earth", 0.04, 0
    )


def test_the_frame_of_the_deltas_is_the_settings() -> None:
    """The wire does not tell."""
    (reading,) = readings(bot(delta_frame="body"), moved(0))
    assert isinstance(reading, DisplacementReading)
    assert reading.frame == "body"


@pytest.mark.parametrize("order", ["big", "little"])
def test_a_pose_is_in_millimetres_and_milliradians(order: str) -> None:
    """1000 are 1 m, and 1 rad; in the byte order of the settings."""
    board = bot(pose_byte_order=order)
    board.receive(encode(REST) * 2, 0.0)
    found = board.receive(encode(PoseFrame(1500.0, -250.0, 3142.0, 0), order), 0.0)  # type: ignore[arg-type]
    assert found == [PoseReading(1.5, -0.25, pytest.approx(3.142))]


def test_imu_counts_are_scaled_by_the_ranges_of_the_settings() -> None:
    """16384 counts are 1 g in the 2 g range and 2 g in the 4 g range."""
    frame = ImuFrame((0, 0, 16384), (131, 0, 0))
    (fine,) = readings(bot(), frame)
    assert fine == ImuReading((0, 0, pytest.approx(9.80665)), (pytest.approx(0.0174533), 0, 0))
    (coarse,) = readings(bot(imu=ImuScale(accel_range_g=4, gyro_range_dps=500)), frame)
    assert coarse == ImuReading((0, 0, pytest.approx(19.6133)), (pytest.approx(0.0349066), 0, 0))


def test_a_text_says_that_the_board_is_paused() -> None:
    """And nothing else."""
    assert readings(bot(), PausedFrame(3)) == [PausedReading()]


def test_readings_come_in_the_order_of_the_line() -> None:
    """A pose includes the delta before it."""
    sent = [REST, moved(0), PoseFrame(0.0, 0.0, 0.0, 0), PausedFrame(0)]
    kinds = [type(reading) for reading in readings(bot(), *sent)]
    assert kinds == [ImuReading, DisplacementReading, PoseReading, PausedReading]


# Lost frames


def lost(board: OmniBot, *sent: Frame) -> list[int]:
    found = readings(board, *sent)
    return [reading.lost for reading in found if isinstance(reading, DisplacementReading)]


@given(st.integers(0, 255), st.integers(0, 2000))
def test_missing_counts_are_lost_frames_across_any_number_of_wraps(start: int, gap: int) -> None:
    """SEQ is one byte; arrival times tell how often it has wrapped."""
    board = bot()
    readings(board, moved(start))
    (reading,) = board.receive(encode(moved((start + 1 + gap) % 256)) + b"\xff", 0.04 * (gap + 1))
    assert isinstance(reading, DisplacementReading)
    assert (reading.lost, reading.duration_s, reading.restarted) == (gap, 0.04, False)


def test_seconds_of_the_line_in_one_read_are_neither_a_restart_nor_a_wrap() -> None:
    """Between two such reads the counter wrapped, and three deltas were lost with all around."""
    board = bot()
    periods = [encode(REST) * 4 + encode(moved(count % 256)) for count in range(200, 320)]
    board.receive(b"".join(periods[:58]), 10.0)
    came = board.receive(b"".join(periods[61:]), 12.5)
    deltas = [reading for reading in came if isinstance(reading, DisplacementReading)]
    assert [delta.lost for delta in deltas] == [3] + [0] * 58
    assert not any(delta.restarted for delta in deltas)


def test_a_regular_sequence_has_no_losses() -> None:
    """Over more than one wrap."""
    assert sum(lost(bot(), *[moved(n % 256) for n in range(600)])) == 0


def test_the_first_delta_has_lost_nothing() -> None:
    """Nobody knows what came before the connection, or before a pause."""
    board = bot()
    assert lost(board, moved(7)) == [0]
    assert lost(board, PausedFrame(0), moved(100)) == [0]
    board.connect()
    assert lost(board, moved(200)) == [0]


def test_the_poses_have_a_counter_of_their_own() -> None:
    """It says nothing of lost deltas."""
    assert lost(bot(), moved(1), PoseFrame(0.0, 0.0, 0.0, 99), moved(2)) == [0, 0]


# Commands


@pytest.mark.parametrize(
    ("twist", "typed"),
    [
        ((0.5, 0.0, 0.0), "FF FE 01 00 23 00 00 00 00"),
        ((0.0, -0.5, 0.0), "FF FE 01 00 00 FF DD 00 00"),
        ((0.0, 0.0, 0.5), "FF FE 01 00 00 00 00 00 FA"),
        ((0.1, 0.2, -0.3), "FF FE 01 00 07 00 0E FF 6A"),
    ],
)
def test_a_velocity_is_70_lsb_for_a_metre_and_500_for_a_radian(
    twist: tuple[float, float, float], typed: str
) -> None:
    """The vendor's scales, in mode 1."""
    assert bot().velocity(BodyTwist(*twist)) == bytes.fromhex(typed)


def test_the_scales_are_those_of_the_settings() -> None:
    """100 LSB per m/s, 200 per rad/s."""
    board = bot(linear_scale=100.0, angular_scale=200.0)
    typed = bytes.fromhex("FF FE 01 00 64 FF 38 00 C8")
    assert board.velocity(BodyTwist(1.0, -2.0, 1.0)) == typed


def test_wheel_rates_are_rim_speeds_in_the_linear_unit() -> None:
    """10 rad/s at 29 mm is 0.29 m/s: 20.3 LSB; mode 2."""
    assert bot().wheels((10.0, -10.0, 1.0)) == bytes.fromhex("FF FE 02 00 14 FF EC 00 02")
    wide = bot(wheel_radius_m=0.058)
    assert wide.wheels((10.0, 0.0, 0.0)) == bytes.fromhex("FF FE 02 00 29 00 00 00 00")


def test_commands_are_rounded_to_the_nearest() -> None:
    """0.0493 m/s is 3.451 LSB, 0.0508 m/s is 3.556."""
    assert bot().velocity(BodyTwist(0.0493, -0.0508, 0.0))[3:7] == bytes.fromhex("00 03 FF FC")


@given(twists)
def test_a_velocity_that_rounds_to_nothing_is_the_stop_frame(twist: BodyTwist) -> None:
    """Zeros in mode 1 would mean: drive to the origin, with the switch on position."""
    command = bot().velocity(twist)
    assert command != bytes.fromhex("FF FE 01 00 00 00 00 00 00")
    counts = (70 * twist.vx_mps, 70 * twist.vy_mps, 500 * twist.yaw_rate_radps)
    if max(map(abs, counts)) < 0.5:
        assert command == STOP
    else:
        assert command[2] == 1 or max(map(abs, counts)) == 0.5


@pytest.mark.parametrize("tiny", [0.0, -0.0, 0.005, -0.007, 5e-324])
def test_almost_nothing_is_the_stop_frame(tiny: float) -> None:
    """Body and wheels."""
    assert bot().velocity(BodyTwist(tiny, -tiny, tiny / 10)) == STOP
    assert bot().wheels((tiny, -tiny, tiny)) == STOP


@given(st.tuples(*[st.floats(-1e308, 1e308)] * 3).filter(lambda v: max(map(abs, v)) < 1e305))
def test_a_command_too_large_for_the_wire_keeps_its_direction(
    values: tuple[float, float, float],
) -> None:
    """Scaled down as a whole; never an exception, never a word that wraps round."""
    command = bot().velocity(BodyTwist(*values))
    counts = (70 * values[0], 70 * values[1], 500 * values[2])
    largest = max(1.0, max(map(abs, counts)) / 32767)
    sent = [int.from_bytes(command[n : n + 2], "big", signed=True) for n in (3, 5, 7)]
    for word, count in zip(sent, counts, strict=True):
        assert word == pytest.approx(count / largest, abs=0.500001)


@given(words, words, words)
def test_what_is_commanded_comes_back_as_it_was_meant(x: int, y: int, omega: int) -> None:
    """Whole counts survive scaling, rounding and the wire."""
    x, y, omega = (max(-32767, word) for word in (x, y, omega))
    command = bot().velocity(BodyTwist(x / 70, y / 70, omega / 500))
    sent = tuple(int.from_bytes(command[n : n + 2], "big", signed=True) for n in (3, 5, 7))
    assert sent == (x, y, omega)


@pytest.mark.parametrize(
    ("pose", "typed"),
    [
        ((1.0, -0.5, 1.571), "FF FE 01 03 E8 FE 0C 06 23"),
        ((32.767, -32.767, 0.0), "FF FE 01 7F FF 80 01 00 00"),
        ((0.0, 0.0, 0.0), "FF FE 01 00 00 00 00 00 00"),
        ((0.0006, -0.0006, 0.0), "FF FE 01 00 01 FF FF 00 00"),
    ],
)
def test_a_pose_to_drive_to_is_millimetres_and_milliradians(
    pose: tuple[float, float, float], typed: str
) -> None:
    """In mode 1; the origin is a place like any other."""
    assert bot().drive_to(Pose(*pose)) == bytes.fromhex(typed)


@pytest.mark.parametrize("far", [33.0, -33.0, 1e300, math.inf, math.nan])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_pose_that_does_not_fit_the_line_is_refused_and_not_another_place(
    far: float, place: int
) -> None:
    """32.77 m and 32.77 rad are the end of the words."""
    values = [0.0, 0.0, 0.0]
    values[place] = far
    with pytest.raises(CommandRefused, match=r"32\.77 m and 32\.77 rad.*~/reset"):
        bot().drive_to(Pose(*values))


# Letters


def test_commands_that_do_not_fit_the_wire_are_counted() -> None:
    """One at the very end of it is not."""
    board = bot(linear_scale=10_000.0)
    board.velocity(BodyTwist(3.2767, 0.0, 0.0))
    assert board.figures.saturated == 0
    board.velocity(BodyTwist(3.3, 0.0, 0.0))
    assert board.figures.saturated == 1


def test_faults_are_counted_over_all_connections() -> None:
    """A new line has a new decoder, but the robot's cable is the same."""
    board = bot()
    board.receive(encode(REST) * 8, 0.0)
    assert (board.figures.faults, board.figures.discarded_bytes) == (0, 0)
    for start_s in (1.0, 2.0):
        before = board.figures
        board.connect()
        board.receive(encode(REST) * 40 + bytes(30) + encode(REST) * 40, start_s)
        assert board.figures.faults > before.faults
        assert board.figures.discarded_bytes >= before.discarded_bytes + 30


def test_stop_and_emergency_stop_are_the_manuals() -> None:
    """From the appendix."""
    assert bot().stop() == STOP
    assert bot().emergency_stop() == bytes.fromhex("FF FE 10 00 00 00 00 00 00")


def test_waking_is_eight_zeros_and_stop() -> None:
    """Zeros end any half command and are no letters."""
    assert bot().wake() == bytes(8) + STOP


@pytest.mark.parametrize("mode", Mode)
def test_start_is_s_in_every_mode(mode: Mode) -> None:
    """It is harmless, and does not change the belief."""
    board = in_mode(mode)
    assert board.start() == b"\x53"
    assert board.mode is mode


@pytest.mark.parametrize("mode", Mode)
def test_pause_is_stop_and_p_where_the_board_runs_and_else_refused(mode: Mode) -> None:
    """A toggle is for boards whose state is known; a refusal changes nothing."""
    board = in_mode(mode)
    if mode.running:
        assert board.pause() == STOP + b"\x50"
    else:
        with pytest.raises(RequestRefused):
            board.pause()
    assert board.mode is mode


@pytest.mark.parametrize("mode", Mode)
def test_reset_is_stop_and_r_with_zeros_first_where_the_board_may_not_listen(mode: Mode) -> None:
    """Afterwards the mode is unknown."""
    board = in_mode(mode)
    prefix = b"" if mode.running else bytes(8)
    assert board.reset() == prefix + STOP + b"\x52"
    assert board.mode is Mode.UNKNOWN


@pytest.mark.parametrize("mode", Mode)
def test_after_silence_or_on_a_new_line_the_mode_is_unknown(mode: Mode) -> None:
    """Belief rests on what is heard."""
    board = in_mode(mode)
    board.silence()
    assert board.mode is Mode.UNKNOWN
    board = in_mode(mode)
    board.connect()
    assert board.mode is Mode.UNKNOWN


def test_a_new_line_does_not_finish_what_the_old_one_began() -> None:
    """Half a frame is worth nothing on another line."""
    board = bot()
    board.receive(encode(REST) * 2 + encode(moved(0))[:5], 0.0)
    board.connect()
    assert board.receive(encode(moved(0))[5:], 0.0) == []
    assert board.flush(0.0) == []


def test_a_frame_that_waited_comes_out_at_the_end() -> None:
    """One that ends in FF, when the line is closed."""
    board = bot()
    board.receive(encode(REST) * 2, 0.0)
    assert board.receive(encode(moved(255)), 0.0) == []
    assert len(board.flush(0.0)) == 1


def test_settings_may_be_replaced_while_it_runs() -> None:
    """Scales hold from the next command on."""
    board = bot()
    board.settings = OmniBotSettings(linear_scale=100.0)
    assert board.velocity(BodyTwist(1.0, 0.0, 0.0))[3:5] == b"\x00\x64"


def test_readings_are_finite_but_for_poses() -> None:
    """Integers scaled; a pose is what the board says it is."""
    edge = (32767, -32768, -32768)
    found = readings(bot(), ImuFrame(edge, edge), DeltaFrame(*edge, 0))
    assert isinstance(found[0], ImuReading)
    assert all(map(math.isfinite, found[0].specific_force + found[0].angular_velocity))
    assert isinstance(found[1], DisplacementReading)
    assert found[1].dx_m == pytest.approx(3.2767)
    assert found[1].dy_m == pytest.approx(-3.2768)
