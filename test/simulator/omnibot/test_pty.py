# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated OmniBot in real time behind a real pseudo-terminal."""

import os
import select
import time
from collections.abc import Callable

import pytest

from omnibot_driver.simulator.omnibot import BoardMode, BoardSettings, PtyBoard, SimulatedBoard

PATIENCE_S = 20.0
RUNNING = BoardSettings(running=True)


def read_until(descriptor: int, wanted: bytes) -> bytes:
    """Return the bytes read from ``descriptor`` until they contain ``wanted``."""
    data = b""
    deadline_s = time.monotonic() + PATIENCE_S
    while wanted not in data:
        ready, _, _ = select.select([descriptor], [], [], deadline_s - time.monotonic())
        assert ready, f"{wanted!r} did not come, only {data[-100:]!r}"
        data += os.read(descriptor, 4096)
    return data


def is_in(mode: BoardMode) -> Callable[[SimulatedBoard], bool]:
    """Return a function that returns whether a board is in the mode ``mode``."""
    return lambda board: board.mode is mode


def test_a_program_can_wake_start_and_stop_the_board_through_the_terminal() -> None:
    """A program wakes, stops and starts the board through the terminal.

    Bytes such as FF pass unchanged.
    """
    with PtyBoard(SimulatedBoard()) as pty:
        port = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        try:
            assert read_until(port, b"\n").startswith(b"Paused: 0 \n")
            opening = bytes(8) + bytes.fromhex("FF FE 02 00 00 00 00 00 00") + b"S"
            os.write(port, opening)
            read_until(port, b"\xff\xfb")
            assert pty.wait_for(is_in(BoardMode.NOMINAL), PATIENCE_S)
            with pty.lock:
                assert pty.board.received == opening
        finally:
            os.close(port)


@pytest.mark.slow
def test_the_stream_read_is_the_stream_sent() -> None:
    """A program reads the terminal. No byte is changed, added or lost."""
    with PtyBoard(SimulatedBoard(RUNNING)) as pty:
        port = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
        try:
            data = b""
            while len(data) < 1000:
                data += os.read(port, 4096)
        finally:
            os.close(port)
        with pty.lock:
            sent = b"".join(frame.data for frame in pty.board.sent)
            assert pty.dropped == 0
    assert sent.startswith(data)


def test_the_terminal_outlives_the_program_that_opened_it() -> None:
    """One program pauses the board and closes the terminal.

    A second program opens it and starts the board.
    """
    with PtyBoard(SimulatedBoard(RUNNING)) as pty:
        for letter, mode in ((b"P", BoardMode.PAUSED), (b"S", BoardMode.NOMINAL)):
            port = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
            os.write(port, letter)
            os.close(port)
            assert pty.wait_for(is_in(mode), PATIENCE_S)
