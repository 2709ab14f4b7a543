# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the codec, with bytes typed by hand from the manual."""

import math
import struct

import pytest
from frame_strategies import (
    byte_orders,
    commands,
    counters,
    float32,
    floats32,
    frames,
    pose_frames,
    triples,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.errors import FrameError
from omnibot_driver.core.omnibot import (
    CommandFrame,
    DeltaFrame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    decode,
    encode,
)
from omnibot_driver.core.omnibot.frames import (
    EMERGENCY_STOP,
    FORCE_START,
    INCOMPLETE,
    NO_FRAME,
    RESET,
    STOP,
    TOGGLE_PAUSE,
    ByteOrder,
    Frame,
    measure,
)
from omnibot_driver.simulator.omnibot import wire
from omnibot_driver.simulator.omnibot.receivers import CommandReceiver

APPENDIX = {
    "Stop": ("FF FE 02 00 00 00 00 00 00", CommandFrame(0x02, (0, 0, 0))),
    "E-stop": ("FF FE 10 00 00 00 00 00 00", CommandFrame(0x10, (0, 0, 0))),
    "Rotate all": ("FF FE 02 00 20 00 20 00 20", CommandFrame(0x02, (32, 32, 32))),
    "Rotate all reversed": ("FF FE 02 FF E0 FF E0 FF E0", CommandFrame(0x02, (-32, -32, -32))),
    "Rotate A": ("FF FE 02 00 20 00 00 00 00", CommandFrame(0x02, (32, 0, 0))),
    "Rotate B": ("FF FE 02 00 00 00 20 00 00", CommandFrame(0x02, (0, 32, 0))),
    "Rotate C": ("FF FE 02 00 00 00 00 00 20", CommandFrame(0x02, (0, 0, 32))),
    "Vx = 32": ("FF FE 01 00 20 00 00 00 00", CommandFrame(0x01, (32, 0, 0))),
    "Vy = 32": ("FF FE 01 00 00 00 20 00 00", CommandFrame(0x01, (0, 32, 0))),
    "Omega = 8": ("FF FE 01 00 00 00 00 00 08", CommandFrame(0x01, (0, 0, 8))),
}

FRAME_TABLES: dict[str, tuple[str, Frame | CommandFrame]] = {
    "IMU": (
        "FF FA 00 01 FF FE C0 00 FF FA FF FB FF FC",
        ImuFrame((1, -2, -16384), (-6, -5, -4)),
    ),
    "IMU, edges": (
        "FF FA 7F FF 80 00 00 00 80 00 7F FF FF FF",
        ImuFrame((32767, -32768, 0), (-32768, 32767, -1)),
    ),
    "delta": ("FF FB 00 C8 FF 38 00 0A 07", DeltaFrame(200, -200, 10, 7)),
    "delta, edges": ("FF FB 7F FF 80 00 FF FF FF", DeltaFrame(32767, -32768, -1, 255)),
    "pose": (
        "FF FC 44 7A 00 00 C0 20 00 00 3F 80 00 00 09",
        PoseFrame(1000.0, -2.5, 1.0, 9),
    ),
    "pose at the origin": (
        "FF FC 00 00 00 00 00 00 00 00 00 00 00 00 FF",
        PoseFrame(0.0, 0.0, 0.0, 255),
    ),
    "command, edges": ("FF FE 01 7F FF 80 00 FF FF", CommandFrame(1, (32767, -32768, -1))),
}


@pytest.mark.parametrize(("typed", "frame"), APPENDIX.values(), ids=APPENDIX.keys())
def test_each_command_of_the_appendix_is_these_bytes(typed: str, frame: CommandFrame) -> None:
    """The ten commands of the manual's appendix are encoded and decoded as printed there."""
    assert encode(frame) == bytes.fromhex(typed)
    assert decode(bytes.fromhex(typed)) == frame


@pytest.mark.parametrize(("typed", "frame"), FRAME_TABLES.values(), ids=FRAME_TABLES.keys())
def test_each_frame_table_is_laid_out_as_in_the_manual(
    typed: str, frame: Frame | CommandFrame
) -> None:
    """A frame has a header, then its words, and SEQ last, if it has SEQ.

    The most significant byte of a word comes first.
    """
    assert encode(frame) == bytes.fromhex(typed)
    assert decode(bytes.fromhex(typed)) == frame


def test_the_pose_may_be_little_endian() -> None:
    """The manual does not make clear in which order the bytes of a pose's floats come.

    A setting selects that the least significant byte comes first.
    """
    typed = bytes.fromhex("FF FC 00 00 7A 44 00 00 20 C0 00 00 80 3F 09")
    frame = PoseFrame(1000.0, -2.5, 1.0, 9)
    assert encode(frame, "little") == typed
    assert decode(typed, "little") == frame


@pytest.mark.parametrize("count", [0, 7, 42, 255])
def test_the_paused_text_is_the_one_of_the_manual(count: int) -> None:
    """The board's text is «Paused: i», with a space before the line feed.

    The number i is a uint8.
    """
    typed = {
        0: "50 61 75 73 65 64 3A 20 30 20 0A",
        7: "50 61 75 73 65 64 3A 20 37 20 0A",
        42: "50 61 75 73 65 64 3A 20 34 32 20 0A",
        255: "50 61 75 73 65 64 3A 20 32 35 35 20 0A",
    }[count]
    assert encode(PausedFrame(count)) == bytes.fromhex(typed)
    assert decode(bytes.fromhex(typed)) == PausedFrame(count)


@pytest.mark.parametrize("text", [b"Paused: 3\n", b"Paused: 3 \r\n", b"Paused: 3\r\n"])
def test_a_paused_text_with_other_blanks_is_understood(text: bytes) -> None:
    """A «Paused: i» text ends with other white space than in the manual. It is still decoded.

    The reason: another version of the firmware may send such a text.
    """
    assert decode(text) == PausedFrame(3)


def test_the_named_frames_and_letters_are_those_of_the_manual() -> None:
    """Stop and the emergency stop are the frames of the appendix.

    S, P and R are 0x53, 0x50 and 0x52.
    """
    assert encode(STOP).hex(" ") == "ff fe 02 00 00 00 00 00 00"
    assert encode(EMERGENCY_STOP).hex(" ") == "ff fe 10 00 00 00 00 00 00"
    assert (FORCE_START, TOGGLE_PAUSE, RESET) == (b"\x53", b"\x50", b"\x52")


@given(frames, byte_orders)
def test_decoding_undoes_encoding(frame: Frame, order: ByteOrder) -> None:
    """Every frame that the board may send is the same after encoding and decoding."""
    assert decode(encode(frame, order), order) == frame


@given(commands)
def test_decoding_undoes_encoding_of_commands(command: CommandFrame) -> None:
    """Every command to the board is the same after encoding and decoding."""
    assert decode(encode(command)) == command


@given(st.one_of(frames, commands), byte_orders)
def test_encoding_undoes_decoding(frame: Frame | CommandFrame, order: ByteOrder) -> None:
    """Every byte of a frame has a meaning, so decoding and encoding give the same bytes again."""
    data = encode(frame, order)
    assert encode(decode(data, order), order) == data


@settings(max_examples=40)
@given(triples, triples, counters, floats32, floats32, floats32, byte_orders)
def test_the_simulated_board_speaks_the_same_language(
    a: tuple[int, int, int],
    b: tuple[int, int, int],
    seq: int,
    x: float,
    y: float,
    theta: float,
    order: ByteOrder,
) -> None:
    """The driver and the simulated board have separate codecs. Both understand the same values."""
    assert decode(wire.imu_frame(a, b)) == ImuFrame(a, b)
    assert decode(wire.delta_frame(a, seq)) == DeltaFrame(*a, seq)
    assert decode(wire.pose_frame(x, y, theta, seq, order), order) == PoseFrame(x, y, theta, seq)
    assert decode(wire.paused_text(seq)) == PausedFrame(seq)


@settings(max_examples=40)
@given(commands)
def test_the_simulated_board_understands_every_command(command: CommandFrame) -> None:
    """The receiver of the simulated board reads every command as the driver has encoded it."""
    receiver = CommandReceiver(awake=True)
    understood = [receiver.feed(byte, 0.0, control_frames=True) for byte in encode(command)]
    assert understood[-1] == (wire.ControlFrame(command.mode, command.values),)
    assert not any(understood[:-1])


def test_a_pose_that_is_not_a_number_is_still_a_pose() -> None:
    """A pose contains NaN or infinity. It is decoded, because the codec does not judge values."""
    frame = decode(bytes.fromhex("FF FC 7F C0 00 00 FF 80 00 00 00 00 00 00 01"))
    assert isinstance(frame, PoseFrame)
    assert math.isnan(frame.x)
    assert frame.y == -math.inf


@given(pose_frames, st.floats(allow_nan=False, allow_infinity=False))
def test_a_pose_is_rounded_to_four_bytes_or_refused(pose: PoseFrame, x: float) -> None:
    """A coordinate is rounded to a 32-bit float.

    A coordinate that is too large for a 32-bit float is rejected.
    """
    wide = PoseFrame(x, pose.y, pose.theta, pose.seq)
    try:
        rounded = float32(x)
    except OverflowError:
        with pytest.raises(FrameError, match="cannot be encoded"):
            encode(wide)
    else:
        assert decode(encode(wide)) == PoseFrame(rounded, pose.y, pose.theta, pose.seq)


@pytest.mark.parametrize(
    "frame",
    [
        ImuFrame((32768, 0, 0), (0, 0, 0)),
        ImuFrame((0, 0, 0), (0, 0, -32769)),
        DeltaFrame(0, 40000, 0, 0),
        DeltaFrame(0, 0, 0, 256),
        DeltaFrame(0, 0, 0, -1),
        PoseFrame(1e39, 0.0, 0.0, 0),
        PoseFrame(0.0, 0.0, 0.0, 256),
        PausedFrame(256),
        PausedFrame(-1),
        CommandFrame(1, (0, 0, 32768)),
        CommandFrame(256, (0, 0, 0)),
        CommandFrame(-1, (0, 0, 0)),
    ],
    ids=str,
)
def test_a_value_that_does_not_fit_its_field_is_refused(frame: Frame | CommandFrame) -> None:
    """A value that does not fit its field is rejected, and the message names the kind of frame."""
    with pytest.raises(FrameError, match=type(frame).__name__):
        encode(frame)


@given(st.one_of(frames, commands), st.integers(0, 14))
def test_a_part_of_a_frame_is_not_a_frame(frame: Frame | CommandFrame, length: int) -> None:
    """The bytes of a frame whose end is missing are rejected, wherever the frame was cut."""
    data = encode(frame)
    with pytest.raises(FrameError, match="not exactly one frame"):
        decode(data[: min(length, len(data) - 1)])


@given(st.one_of(frames, commands), st.binary(min_size=1, max_size=20))
def test_a_frame_and_something_more_is_not_a_frame(
    frame: Frame | CommandFrame, more: bytes
) -> None:
    """A frame with extra bytes after it is rejected."""
    data = encode(frame)
    with pytest.raises(FrameError, match="not exactly one frame"):
        decode(data + more)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        b"\xff\xfd" + bytes(12),
        b"\xfa\xff" + bytes(12),
        bytes(14),
        b"Paused: 256 \n",
        b"Paused:  \n",
        b"Paused: x \n",
        b"paused: 1 \n",
        b"Paused: -1 \n",
        b"S",
    ],
)
def test_bytes_of_no_frame_are_refused(data: bytes) -> None:
    """Bytes that form no frame are rejected, and the message contains the bytes."""
    with pytest.raises(FrameError, match=data.hex(" ") or "no bytes"):
        decode(data)


@given(frames, st.binary(max_size=20), st.binary(max_size=20))
def test_a_frame_is_measured_wherever_it_stands(frame: Frame, before: bytes, after: bytes) -> None:
    """``measure`` returns the length of a complete frame anywhere in a stream.

    For the beginning of a frame it returns INCOMPLETE.
    """
    data = encode(frame)
    assert measure(before + data + after, len(before)) == len(data)
    for length in range(1, len(data)):
        assert measure(before + data[:length], len(before)) == INCOMPLETE


@given(st.binary(min_size=1, max_size=20))
def test_what_no_frame_begins_with_is_never_waited_for(data: bytes) -> None:
    """For bytes that cannot become a frame, ``measure`` returns NO_FRAME at once."""
    headers = (b"\xff\xfa", b"\xff\xfb", b"\xff\xfc")
    may_become = data.startswith((*headers, b"P")) or data == b"\xff"
    assert may_become or measure(data, 0) == NO_FRAME


def test_struct_sizes_are_the_lengths_of_the_manual() -> None:
    """Frames from the board have 14, 9 and 15 bytes. Frames to the board have 9 bytes."""
    zeros = (0, 0, 0)
    assert len(encode(ImuFrame(zeros, zeros))) == 14
    assert len(encode(DeltaFrame(0, 0, 0, 0))) == 9
    assert len(encode(PoseFrame(0.0, 0.0, 0.0, 0))) == 15 == 2 + 3 * struct.calcsize(">f") + 1
    assert len(encode(CommandFrame(1, zeros))) == 9
