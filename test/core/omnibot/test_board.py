# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the OmniBot's readings in SI units, the letters sent to it, and new connections."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.board import Mode
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.imu.scale import ImuScale
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
from omnibot_driver.core.packets import joined
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    PausedReading,
    PoseReading,
    Reading,
)

ZEROS = bytes(8)
STOP = ZEROS + bytes.fromhex("FF FE 02 00 00 00 00 00 00")
REST = ImuFrame((120, -80, -16384), (131, 0, -131))
TEXT = b"Paused: 1 \n"


def bot(**settings: object) -> OmniBot:
    return OmniBot(OmniBotSettings(**settings))  # type: ignore[arg-type]


def readings(board: OmniBot, *sent: Frame) -> list[Reading]:
    """Return the readings of the given frames, after two frames that synchronize the decoder."""
    board.receive(encode(REST) * 2, 0.0)
    found = [reading for frame in sent for reading in board.receive(encode(frame), 0.0)]
    return found + board.flush(0.0)


def in_mode(mode: Mode) -> OmniBot:
    """Return a board that has received data which shows ``mode``."""
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
    """In a delta, 10000 counts are 1 m or 1 rad. A delta covers 40 ms."""
    (reading,) = readings(bot(), DeltaFrame(10000, -5000, 2500, 0))
    assert reading == DisplacementReading(
        pytest.approx(1.0), pytest.approx(-0.5), pytest.approx(0.25), "earth", 0.04, 0
    )


def test_the_frame_of_the_deltas_is_the_settings() -> None:
    """The board does not say in which coordinate frame its deltas are, so a setting selects it."""
    (reading,) = readings(bot(delta_frame="body"), moved(0))
    assert isinstance(reading, DisplacementReading)
    assert reading.frame == "body"


@pytest.mark.parametrize("order", ["big", "little"])
def test_a_pose_is_in_millimetres_and_milliradians(order: str) -> None:
    """A value of 1000 in a pose is 1 m or 1 rad. A setting gives the byte order of poses."""
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
    """The board sends the text «Paused: i». It becomes a paused reading without the number i."""
    assert readings(bot(), PausedFrame(3)) == [PausedReading()]


@pytest.mark.parametrize("data", [REST, moved(0), PoseFrame(0.0, 0.0, 0.0, 0)], ids=str)
def test_a_text_goes_on_from_one_right_before_it_alone(data: Frame) -> None:
    """Two «Paused» texts show an uninterrupted pause if their numbers show at most nine lost texts.

    If more texts are lost, or if a different frame comes in between, the board may have run.
    """
    first, *more, last = readings(bot(), *map(PausedFrame, (255, 0, 2, 12, 23)))
    assert [first, last] == 2 * [PausedReading()]
    assert more == 3 * [PausedReading(continues=True)]
    assert readings(bot(), PausedFrame(0), data, PausedFrame(1))[-1] == PausedReading()


def test_readings_come_in_the_order_of_the_line() -> None:
    """Readings have the order of their frames.

    The order matters because a pose includes the motion of the delta before it.
    """
    sent = [REST, moved(0), PoseFrame(0.0, 0.0, 0.0, 0), PausedFrame(0)]
    kinds = [type(reading) for reading in readings(bot(), *sent)]
    assert kinds == [ImuReading, DisplacementReading, PoseReading, PausedReading]


def test_readings_are_finite_but_for_poses() -> None:
    """The largest IMU and delta values give finite readings, because they are scaled integers.

    Only a pose can contain infinity or NaN.
    """
    edge = (32767, -32768, -32768)
    found = readings(bot(), ImuFrame(edge, edge), DeltaFrame(*edge, 0))
    assert isinstance(found[0], ImuReading)
    assert all(map(math.isfinite, found[0].specific_force + found[0].angular_velocity))
    assert isinstance(found[1], DisplacementReading)
    assert found[1].dx_m == pytest.approx(3.2767)
    assert found[1].dy_m == pytest.approx(-3.2768)


# Lost frames


def lost(board: OmniBot, *sent: Frame) -> list[int]:
    found = readings(board, *sent)
    return [reading.lost for reading in found if isinstance(reading, DisplacementReading)]


@given(st.integers(0, 255), st.integers(0, 2000))
def test_missing_counts_are_lost_frames_across_any_number_of_wraps(start: int, gap: int) -> None:
    """Deltas are lost. Their counter SEQ has one byte, and may wrap several times in the gap.

    The arrival times show how often it has wrapped. All lost deltas are counted.
    """
    board = bot()
    readings(board, moved(start))
    (reading,) = board.receive(encode(moved((start + 1 + gap) % 256)) + b"\xff", 0.04 * (gap + 1))
    assert isinstance(reading, DisplacementReading)
    assert (reading.lost, reading.duration_s, reading.restarted) == (gap, 0.04, False)


def test_seconds_of_the_line_in_one_read_are_neither_a_restart_nor_a_wrap() -> None:
    """Two reads have more than 2 s of data each. Between the reads, three deltas are lost.

    The three deltas are counted. A wrap of SEQ in the first read is not taken for a restart.
    """
    board = bot()
    periods = [encode(REST) * 4 + encode(moved(count % 256)) for count in range(200, 320)]
    board.receive(b"".join(periods[:58]), 10.0)
    came = board.receive(b"".join(periods[61:]), 12.5)
    deltas = [reading for reading in came if isinstance(reading, DisplacementReading)]
    assert [delta.lost for delta in deltas] == [3] + [0] * 58
    assert not any(delta.restarted for delta in deltas)


def test_a_regular_sequence_has_no_losses() -> None:
    """During 600 regular deltas, SEQ wraps twice. No delta is counted as lost."""
    assert sum(lost(bot(), *[moved(n % 256) for n in range(600)])) == 0


def test_the_first_delta_has_lost_nothing() -> None:
    """The first delta of a connection, or after a pause, may have any count.

    No delta before it is counted as lost.
    """
    board = bot()
    assert lost(board, moved(7)) == [0]
    assert lost(board, PausedFrame(0), moved(100)) == [0]
    board.connect()
    assert lost(board, moved(200)) == [0]


def test_the_poses_have_a_counter_of_their_own() -> None:
    """A pose between deltas 1 and 2 has the count 99. No delta is counted as lost."""
    assert lost(bot(), moved(1), PoseFrame(0.0, 0.0, 0.0, 99), moved(2)) == [0, 0]


# Letters and lines


def test_faults_are_counted_over_all_connections() -> None:
    """Each new connection has a new decoder. The fault counters nevertheless continue."""
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
    """Stop and the emergency stop have the bytes of the manual's appendix."""
    assert joined(bot().stop()) == STOP
    assert joined(bot().emergency_stop()) == ZEROS + bytes.fromhex("FF FE 10 00 00 00 00 00 00")


def test_waking_is_eight_zeros_and_stop() -> None:
    """To wake the board, the driver sends eight zeros and Stop.

    The zeros complete a command that was cut off, and have no other effect.
    """
    assert joined(bot().wake()) == STOP


@pytest.mark.parametrize("mode", Mode)
def test_start_is_s_in_every_mode(mode: Mode) -> None:
    """To start the board, the driver sends S, in every mode. S is harmless.

    S alone does not change the mode: only data of the board can do so.
    """
    board = in_mode(mode)
    assert joined(board.start()) == ZEROS + b"\x53"
    assert board.mode is mode


@pytest.mark.parametrize("mode", Mode)
def test_pause_is_stop_and_p_where_the_board_runs_and_else_refused(mode: Mode) -> None:
    """To pause a running board, the driver sends Stop and P. In other modes, it refuses the pause.

    P is a toggle, so it would start a board that does not run.
    """
    board = in_mode(mode)
    if mode.running:
        assert joined(board.pause()) == STOP + ZEROS + b"\x50"
    else:
        with pytest.raises(RequestRefused):
            board.pause()
    assert board.mode is mode


@pytest.mark.parametrize("mode", Mode)
def test_reset_is_stop_and_r(mode: Mode) -> None:
    """To reset the board, the driver sends Stop and R. The mode is then unknown."""
    board = in_mode(mode)
    assert joined(board.reset()) == STOP + ZEROS + b"\x52"
    assert board.mode is Mode.UNKNOWN


@pytest.mark.parametrize("mode", Mode)
def test_after_silence_or_on_a_new_line_the_mode_is_unknown(mode: Mode) -> None:
    """The board falls silent, or a new connection begins. The mode is then unknown."""
    board = in_mode(mode)
    board.silence()
    assert board.mode is Mode.UNKNOWN
    board = in_mode(mode)
    board.connect()
    assert board.mode is Mode.UNKNOWN


def test_a_new_line_does_not_finish_what_the_old_one_began() -> None:
    """A connection ends within a frame.

    The bytes of the next connection do not complete that frame.
    """
    board = bot()
    board.receive(encode(REST) * 2 + encode(moved(0))[:5], 0.0)
    board.connect()
    assert board.receive(encode(moved(0))[5:], 0.0) == []
    assert board.flush(0.0) == []


def test_a_frame_that_waited_comes_out_at_the_end() -> None:
    """A frame ends in FF, which may begin a header. It is held until the next byte comes.

    If the connection ends before the next byte, the frame is returned.
    """
    board = bot()
    board.receive(encode(REST) * 2, 0.0)
    assert board.receive(encode(moved(255)), 0.0) == []
    assert len(board.flush(0.0)) == 1
