# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The wire format: every frame the board sends or obeys, as bytes and as values.

Source: the board's manual ver. 0.3, "Serial Command (Rx)", "Serial Data Output (Tx)" and
"Appendix". Words are signed, 16 bit, big-endian.

This module knows layouts; it does not know what a value means in SI units.
"""

import re
import struct
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.errors import FrameError

ByteOrder = Literal["big", "little"]
Words = tuple[int, int, int]

IMU_HEADER: Final = b"\xff\xfa"
DELTA_HEADER: Final = b"\xff\xfb"
POSE_HEADER: Final = b"\xff\xfc"
COMMAND_HEADER: Final = b"\xff\xfe"
LENT: Final = (0xFF, 0xFA, 0xFB, 0xFC)
"""The bytes that occur in frame headers. If a frame seems to end with one of them, it may have lost
a byte: its last byte may belong to the next header."""

_IMU: Final = struct.Struct(">2s6h")
_DELTA: Final = struct.Struct(">2s3hB")
_POSE: Final[dict[str, struct.Struct]] = {
    "big": struct.Struct(">2s3fB"),
    "little": struct.Struct("<2s3fB"),
}
_COMMAND: Final = struct.Struct(">2sB3h")
_PAUSED_WORD: Final = b"Paused: "
_PAUSED_LENGTH: Final = len(b"Paused: 255 \r\n")
_PAUSED: Final = re.compile(_PAUSED_WORD + rb"(\d{1,3}) ?\r?\n")
_PAUSED_COUNT_BEGUN: Final = re.compile(rb"\d{0,3} ?\r?")

_HEADER_BEGIN: Final = IMU_HEADER[0]
_TEXT_BEGIN: Final = _PAUSED_WORD[0]
IMU_LENGTH: Final = _IMU.size
DELTA_LENGTH: Final = _DELTA.size
POSE_LENGTH: Final = _POSE["big"].size
_LENGTH_BY_TYPE: Final[dict[int, int]] = {
    IMU_HEADER[1]: IMU_LENGTH,
    DELTA_HEADER[1]: DELTA_LENGTH,
    POSE_HEADER[1]: POSE_LENGTH,
}

INCOMPLETE: Final = 0
NO_FRAME: Final = -1

VELOCITY_MODE: Final = 0x01
WHEEL_MODE: Final = 0x02
EMERGENCY_STOP_MODE: Final = 0x10

FORCE_START: Final = b"S"
TOGGLE_PAUSE: Final = b"P"
RESET: Final = b"R"


@dataclass(frozen=True, slots=True)
class ImuFrame:
    """Raw registers of the MPU6050, sent at 100 Hz. Full scale is 32768 counts."""

    accel: Words
    gyro: Words


@dataclass(frozen=True, slots=True)
class DeltaFrame:
    """Motion since the last delta, in 0.1 mm and 0.1 mrad, usually at 25 Hz; ``seq`` is 0..255."""

    dx: int
    dy: int
    dtheta: int
    seq: int


@dataclass(frozen=True, slots=True)
class PoseFrame:
    """The board's own pose in its earth frame, in mm and mrad, sent at 5 Hz; ``seq`` is 0..255."""

    x: float
    y: float
    theta: float
    seq: int


@dataclass(frozen=True, slots=True)
class PausedFrame:
    """The text «Paused: i», sent at 1 Hz while the board is initialising or paused.

    ``count``: the number i, 0..255.
    """

    count: int


@dataclass(frozen=True, slots=True)
class CommandFrame:
    """A command from the host: a mode byte and three words."""

    mode: int
    values: Words


Frame = ImuFrame | DeltaFrame | PoseFrame | PausedFrame

STOP: Final = CommandFrame(WHEEL_MODE, (0, 0, 0))
EMERGENCY_STOP: Final = CommandFrame(EMERGENCY_STOP_MODE, (0, 0, 0))


def command(mode: int, a: int, b: int, c: int) -> bytes:
    """Return the bytes of a command frame. ``a``, ``b`` and ``c`` must fit into 16 bits."""
    return _COMMAND.pack(COMMAND_HEADER, mode, a, b, c)


def last_command(data: bytes) -> tuple[int, int, int, int]:
    """Return mode and words of the command frame at the end of ``data``; zeros if there is none."""
    header, mode, a, b, c = _COMMAND.unpack(data[-_COMMAND.size :].rjust(_COMMAND.size, b"\0"))
    return (mode, a, b, c) if header == COMMAND_HEADER else (0, 0, 0, 0)


def encode(frame: Frame | CommandFrame, pose_byte_order: ByteOrder = "big") -> bytes:
    """Return the bytes of one frame. Raises FrameError when a value does not fit its field."""
    try:
        match frame:
            case ImuFrame(accel, gyro):
                return _IMU.pack(IMU_HEADER, *accel, *gyro)
            case DeltaFrame(dx, dy, dtheta, seq):
                return _DELTA.pack(DELTA_HEADER, dx, dy, dtheta, seq)
            case PoseFrame(x, y, theta, seq):
                return _POSE[pose_byte_order].pack(POSE_HEADER, x, y, theta, seq)
            case CommandFrame(mode, values):
                return command(mode, *values)
            case PausedFrame(count):
                if not 0 <= count <= 255:
                    raise FrameError(f"{frame} cannot be encoded: the count must be 0 to 255")
                return b"Paused: %d \n" % count
    except (struct.error, OverflowError) as error:
        raise FrameError(f"{frame} cannot be encoded: {error}") from error


def measure(data: bytes | bytearray, at: int) -> int:
    """Return the length in bytes of the frame that begins at position ``at``.

    INCOMPLETE: more bytes may complete a frame. NO_FRAME: no frame begins with these bytes.
    """
    if data[at] == _TEXT_BEGIN:
        return _measure_paused(data, at)
    if data[at] != _HEADER_BEGIN:
        return NO_FRAME
    if at + 1 == len(data):
        return INCOMPLETE
    length = _LENGTH_BY_TYPE.get(data[at + 1], NO_FRAME)
    return length if at + length <= len(data) else INCOMPLETE


def length_begun(data: bytes | bytearray, at: int) -> int:
    """Return the length in bytes of a frame whose header is at position ``at``, or NO_FRAME."""
    return _LENGTH_BY_TYPE.get(data[at + 1], NO_FRAME)


def is_text(data: bytes | bytearray, at: int) -> bool:
    """Return whether a «Paused» text, and not a frame, begins with the byte at position ``at``."""
    return data[at] == _TEXT_BEGIN


def _measure_paused(data: bytes | bytearray, at: int) -> int:
    whole = _PAUSED.match(data, at)
    if whole is not None:
        return len(whole[0]) if int(whole[1]) <= 255 else NO_FRAME
    tail = bytes(data[at : at + _PAUSED_LENGTH])
    word = len(_PAUSED_WORD)
    begun = _PAUSED_WORD.startswith(tail[:word]) and _PAUSED_COUNT_BEGUN.fullmatch(tail, word)
    return INCOMPLETE if begun else NO_FRAME


def decode_measured(data: bytes | bytearray, pose_byte_order: ByteOrder = "big") -> Frame:
    """Decode ``data``, which ``measure`` has found to be exactly one frame."""
    if data[0] == _TEXT_BEGIN:
        return PausedFrame(int(data[len(_PAUSED_WORD) :]))
    if data[1] == IMU_HEADER[1]:
        _, ax, ay, az, gx, gy, gz = _IMU.unpack(data)
        return ImuFrame((ax, ay, az), (gx, gy, gz))
    if data[1] == DELTA_HEADER[1]:
        return DeltaFrame(*_DELTA.unpack(data)[1:])
    return PoseFrame(*_POSE[pose_byte_order].unpack(data)[1:])


def decode(data: bytes, pose_byte_order: ByteOrder = "big") -> Frame | CommandFrame:
    """Decode one frame or command. Raises FrameError for any other ``data``."""
    if data and measure(data, 0) == len(data):
        return decode_measured(data, pose_byte_order)
    if data[:2] == COMMAND_HEADER and len(data) == _COMMAND.size:
        _, mode, a, b, c = _COMMAND.unpack(data)
        return CommandFrame(mode, (a, b, c))
    raise FrameError(f"not exactly one frame of this board: {data.hex(' ') or 'no bytes'}")
