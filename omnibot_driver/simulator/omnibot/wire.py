# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The serial protocol from the board's side: layouts of the frames it sends and receives.

Source: the manual's Serial Command and Serial Data Output. The module shares no code with the
driver.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

BYTE_S = 10 / 115200
"""Duration of a byte with its start and stop bit, in s."""

_IMU = struct.Struct(">2B6h")
_DELTA = struct.Struct(">2B3hB")
_POSE = {"big": struct.Struct(">2B3fB"), "little": struct.Struct("<2B3fB")}
_COMMAND = struct.Struct(">2BB3h")

COMMAND_HEADER = b"\xff\xfe"
COMMAND_LENGTH = _COMMAND.size

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
    """A complete control data frame. ``mode`` may be a number that the manual does not name."""

    mode: int
    values: Triple


LETTERS = {int(letter): letter for letter in StateLetter}
"""State letters by their byte."""


def imu_frame(accel: Triple, gyro: Triple) -> bytes:
    """Encode the 14 bytes of the 100 Hz frame from raw sensor counts, which are int16."""
    return _IMU.pack(0xFF, 0xFA, *accel, *gyro)


def delta_frame(difference: Triple, seq: int) -> bytes:
    """Encode the 9 bytes of the delta frame, which is sent at 25 Hz.

    ``difference``: displacement in 0.1 mm and 0.1 mrad, or counts of the three wheels, as int16.
    """
    return _DELTA.pack(0xFF, 0xFB, *difference, seq)


def pose_frame(
    x_mm: float, y_mm: float, theta_mrad: float, seq: int, byte_order: ByteOrder = "big"
) -> bytes:
    """Encode the 15 bytes of the 5 Hz frame; SEQ is its last byte."""
    return _POSE[byte_order].pack(0xFF, 0xFC, x_mm, y_mm, theta_mrad, seq)


def paused_text(count: int) -> bytes:
    """Encode the text that the board sends at 1 Hz while paused. ``count`` is a uint8."""
    return b"Paused: %d \n" % count


def control_frame(data: bytes) -> ControlFrame:
    """Decode the nine bytes of a control data frame."""
    _, _, mode, a, b, c = _COMMAND.unpack(data)
    return ControlFrame(mode, (a, b, c))
