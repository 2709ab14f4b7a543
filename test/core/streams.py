# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Byte streams of the simulated board, and functions that evaluate the streams.

Some functions divide a stream into frames by the manual's tables. Other functions use the driver's
decoder.
"""

import struct
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from random import Random

from omnibot_driver.core.omnibot import FrameDecoder, ImuFrame, decode, encode
from omnibot_driver.core.omnibot.frames import CommandFrame, Frame
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

TICK_S = 0.01
BYTE_S = 10 / 115200

REST = ImuFrame((120, -80, -16384), (1, 2, 3))
HEADER_BYTES = b"\xff\xfa\xfb\xfc"
LEAD_IN = encode(REST) * 2
"""Frames that are enough to synchronize a decoder. They have no bytes that look like a header."""


def velocity(x: int, y: int, omega: int) -> bytes:
    """Return the frame of a body velocity command, by the layout in the manual."""
    return bytes.fromhex("FF FE 01") + struct.pack(">3h", x, y, omega)


def record(board: SimulatedBoard, seconds: float) -> list[bytes]:
    """Run the board for ``seconds``. Return what it sends in each tick."""
    return [board.step() for _ in range(round(seconds * 100))]


def drive(board: SimulatedBoard, seconds: float) -> list[bytes]:
    """Drive the board with a new random velocity every 0.5 s. Return what it sends in each tick."""
    random, ticks = Random(7), []
    for _ in range(round(seconds * 2)):
        board.receive(velocity(*(random.randint(-24, 24) for _ in range(2)), random.randint(-9, 9)))
        ticks += record(board, 0.5)
    return ticks


def life(board: SimulatedBoard) -> list[bytes]:
    """Let the board pass through all its modes. Return what it sends in each tick."""
    ticks = record(board, 2.6)
    board.receive(bytes(8) + b"S")
    ticks += drive(board, 2.0)
    for letter in (b"P", b"P", b"R"):
        board.receive(letter)
        ticks += record(board, 2.37)
    return ticks


RUNNING = BoardSettings(running=True)
STREAMS: dict[str, Callable[[], list[bytes]]] = {
    "at rest": lambda: record(SimulatedBoard(RUNNING), 4.0),
    "driving": lambda: drive(SimulatedBoard(RUNNING), 4.0),
    "look-alike gyro": lambda: record(
        SimulatedBoard(BoardSettings(running=True, gyro_stuck=(-6, -5, -4))), 4.0
    ),
    "IMU only": lambda: record(SimulatedBoard(BoardSettings(running=True, imu_only=True)), 4.0),
    "IMU only, look-alike gyro": lambda: record(
        SimulatedBoard(BoardSettings(running=True, imu_only=True, gyro_stuck=(-6, -5, -4))), 4.0
    ),
    "IMU ends in FF": lambda: record(
        SimulatedBoard(BoardSettings(running=True, gyro_stuck=(3, -1, -1))), 4.0
    ),
    "paused": lambda: record(SimulatedBoard(), 12.0),
    "all modes": lambda: life(SimulatedBoard()),
}
RUNNING_STREAMS = [name for name in STREAMS if name not in ("paused", "all modes")]


@cache
def ticks_of(name: str) -> tuple[bytes, ...]:
    return tuple(STREAMS[name]())


def lengths_of(stream: bytes) -> list[int]:
    """Return the lengths of the frames of an undamaged stream, according to the manual's tables."""
    lengths, at = [], 0
    while at < len(stream):
        kind = stream[at + 1]
        text = stream.index(b"\n", at) + 1 - at if stream[at] == 0x50 else 0
        lengths.append({0xFA: 14, 0xFB: 9, 0xFC: 15}.get(kind, text))
        at += lengths[-1]
    assert at == len(stream)
    return lengths


def frames_of(stream: bytes) -> list[tuple[int, Frame]]:
    """Return each frame of an undamaged stream with the position at which it begins."""
    found, at = [], 0
    for length in lengths_of(stream):
        frame = decode(stream[at : at + length])
        assert not isinstance(frame, CommandFrame)
        found.append((at, frame))
        at += length
    return found


def decoded(chunks: Iterable[bytes], *, step_s: float = TICK_S) -> list[Frame]:
    """Return all frames that a new decoder decodes from chunks that arrive ``step_s`` apart."""
    made, now, found = FrameDecoder(), 100.0, []
    for chunk in chunks:
        found += made.feed(chunk, now)
        now += step_s
    return found + made.flush(now)


def byte_by_byte(ticks: Sequence[bytes]) -> list[Frame]:
    """Decode the bytes one by one, at the pace of 115200 baud. Return the frames."""
    made, found = FrameDecoder(), []
    for number, tick in enumerate(ticks):
        for place in range(len(tick)):
            now = number * TICK_S + place * BYTE_S
            found += made.feed(tick[place : place + 1], now)
    return found + made.flush(len(ticks) * TICK_S)


def is_subsequence(some: Sequence[Frame], of: Sequence[Frame]) -> bool:
    remaining = iter(of)
    return all(frame in remaining for frame in some)
