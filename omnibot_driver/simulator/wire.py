# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The wire as the board sees it: the frames it sends and the bytes it understands.

Knows the byte layouts of the manual (sections Serial Command and Serial Data Output), written from
the manual alone. Must not know modes, motion or time, and shares no code with the driver's codec.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

WAKE_UP_BYTES = 3
"""Serial Command: "Serial initialization: 3 arbitrary byte"."""

_IMU = struct.Struct(">2B6h")
_DELTA = struct.Struct(">2B3hB")
_POSE = {"big": struct.Struct(">2B3fB"), "little": struct.Struct("<2B3fB")}
_COMMAND = struct.Struct(">2BB3h")

ByteOrder = Literal["big", "little"]
Triple = tuple[int, int, int]


class StateLetter(IntEnum):
    """The system state commands."""

    START = 0x53
    PAUSE = 0x50
    RESET = 0x52


class ControlMode(IntEnum):
    """The MODE byte of a control data frame."""

    VELOCITY = 0x01
    WHEELS = 0x02
    ESTOP = 0x10


@dataclass(frozen=True, slots=True)
class ControlFrame:
    """A complete control data frame; `mode` may be a number that the manual does not name."""

    mode: int
    values: Triple


_LETTERS = {int(letter): letter for letter in StateLetter}


def imu_frame(accel: Triple, gyro: Triple) -> bytes:
    """Encode the 14 bytes of the 100 Hz frame from raw sensor counts (int16)."""
    return _IMU.pack(0xFF, 0xFA, *accel, *gyro)


def delta_frame(difference: Triple, seq: int) -> bytes:
    """Encode the 9 bytes of the 25 Hz frame from 0.1 mm, 0.1 mm and 1e-4 rad (int16)."""
    return _DELTA.pack(0xFF, 0xFB, *difference, seq)


def pose_frame(
    x_mm: float, y_mm: float, theta_mrad: float, seq: int, byte_order: ByteOrder = "big"
) -> bytes:
    """Encode the 15 bytes of the 5 Hz frame; SEQ is its last byte."""
    return _POSE[byte_order].pack(0xFF, 0xFC, x_mm, y_mm, theta_mrad, seq)


def paused_text(count: int) -> bytes:
    """Encode the 1 Hz system info, `count` being a uint8."""
    return b"Paused: %d \n" % count


class CommandReceiver:
    """The firmware's receiver: one byte in, at most one command out.

    After power-up it swallows the wake-up bytes unseen. A control frame is recognised only where
    the caller says so; elsewhere each of its bytes is looked at for a state letter.
    """

    def __init__(self, *, awake: bool = False) -> None:
        self._to_swallow = 0 if awake else WAKE_UP_BYTES
        self._frame = bytearray()

    def feed(self, byte: int, *, control_frames: bool) -> StateLetter | ControlFrame | None:
        """Take one byte; return the command that it completes, if any."""
        if self._to_swallow:
            self._to_swallow -= 1
            return None
        if control_frames:
            if len(self._frame) == 1 and byte != 0xFE:
                self._frame.clear()
            if self._frame or byte == 0xFF:
                return self._collect(byte)
        return _LETTERS.get(byte)

    def _collect(self, byte: int) -> ControlFrame | None:
        self._frame.append(byte)
        if len(self._frame) < _COMMAND.size:
            return None
        _, _, mode, a, b, c = _COMMAND.unpack(self._frame)
        self._frame.clear()
        return ControlFrame(mode, (a, b, c))
