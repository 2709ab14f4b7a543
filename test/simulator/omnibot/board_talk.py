# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Helpers that command a simulated board and read its output, in simulated time."""

import struct

from omnibot_driver.simulator.omnibot import BoardMode, BoardSettings, SimulatedBoard

WAKE_UP = bytes(8)
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")
ESTOP = bytes.fromhex("FF FE 10 00 00 00 00 00 00")
RUNNING = BoardSettings(running=True)

IMU, DELTA, POSE = b"\xff\xfa", b"\xff\xfb", b"\xff\xfc"


def velocity(x: int, y: int, omega: int) -> bytes:
    """Return a command of a body velocity, with values in LSB."""
    return bytes.fromhex("FF FE 01") + struct.pack(">3h", x, y, omega)


def wheels(a: int, b: int, c: int) -> bytes:
    """Return a command of wheel speeds, with values in LSB."""
    return bytes.fromhex("FF FE 02") + struct.pack(">3h", a, b, c)


def run(board: SimulatedBoard, seconds: float) -> bytes:
    """Return everything that the board sends in the next ``seconds``, in simulated time."""
    return b"".join(board.step() for _ in range(round(seconds * 100)))


def mode_of(board: SimulatedBoard) -> BoardMode:
    """Return the board's mode.

    Tests call this function, because a type checker assumes that ``board.mode`` never changes.
    """
    return board.mode


def booted(settings: BoardSettings) -> SimulatedBoard:
    """Return a board that has just become paused and has not received any bytes."""
    board = SimulatedBoard(settings)
    run(board, settings.boot_time_s)
    assert mode_of(board) is BoardMode.PAUSED
    return board


def sent(board: SimulatedBoard, header: bytes) -> list[bytes]:
    """Return the frames with this header that the board has sent."""
    return [frame.data for frame in board.sent if frame.data.startswith(header)]


def deltas(board: SimulatedBoard) -> list[tuple[int, int, int, int]]:
    """Return the values of the deltas sent so far: x and y in 0.1 mm, turn in 0.1 mrad, SEQ."""
    return [struct.unpack(">3hB", frame[2:]) for frame in sent(board, DELTA)]


def poses(board: SimulatedBoard) -> list[tuple[float, float, float, int]]:
    """Return the values of the poses sent so far: x and y in mm, heading in mrad, SEQ."""
    return [struct.unpack(">3fB", frame[2:]) for frame in sent(board, POSE)]
