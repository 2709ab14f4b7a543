# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of output to the terminal.

The driver never waits for the terminal. It loses a text only if the terminal or the disk does not
accept it.
"""

import fcntl
import os
import struct
import subprocess
import sys
import termios
import threading
import time

import pytest

from omnibot_driver.output import _copy

PATIENCE_S = 60.0


def taken(pipe: int) -> None:
    end = time.monotonic() + PATIENCE_S
    while fcntl.ioctl(pipe, termios.FIONREAD, bytes(4)) != struct.pack("i", 0):
        assert time.monotonic() < end
        time.sleep(0.001)  # no event says that a pipe is empty


def test_a_line_that_a_full_disk_refuses_is_lost_and_the_next_is_not() -> None:
    """The disk is full, so a line of output is lost.

    When the disk has space again, the next line is written.
    """
    (source, pipe), (heard, room) = os.pipe(), os.pipe()
    disk = os.open("/dev/full", os.O_WRONLY)
    copier = threading.Thread(target=_copy, args=(source, disk))
    copier.start()
    for _ in range(2):  # when the second is taken, the first has been refused
        os.write(pipe, b"lost\n")
        taken(pipe)
    os.dup2(room, disk)
    os.write(pipe, b"kept\n")
    os.close(pipe)
    copier.join(PATIENCE_S)
    assert os.read(heard, 100).endswith(b"kept\n")
    for descriptor in (heard, room, disk):
        os.close(descriptor)


def test_output_that_is_not_read_does_not_block_the_program() -> None:
    """The program prints more than all buffers can hold, and its output is not read.

    The program does not block.
    """
    program = """
import contextlib, os
from omnibot_driver.output import UnblockedOutput
with UnblockedOutput():
    for _ in range(100):
        with contextlib.suppress(BlockingIOError):
            os.write(2, bytes(4096))
"""
    unread, pipe = os.pipe()
    done = subprocess.run(
        [sys.executable, "-c", program], stderr=pipe, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0
    os.close(unread)
    os.close(pipe)


@pytest.mark.parametrize("lines", [16, 100])
def test_what_is_printed_at_the_end_is_not_held_up_either(lines: int) -> None:
    """A message at the program's end does not block, even if nothing reads the output.

    16 blocks of 4096 bytes fill the pipe exactly; 100 blocks are more than the pipe can hold.
    """
    program = f"""
import contextlib, os, time
from omnibot_driver.output import UnblockedOutput
with UnblockedOutput():
    for _ in range({lines}):
        time.sleep(1e-3)  # the copying thread takes the lines one by one, without an event
        with contextlib.suppress(BlockingIOError):
            os.write(2, bytes(4096))
raise SystemExit("the last words")
"""
    unread, pipe = os.pipe()
    done = subprocess.run(
        [sys.executable, "-c", program], stderr=pipe, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 1
    os.close(unread)
    os.close(pipe)


def test_what_is_printed_at_the_end_is_seen_where_it_is_read() -> None:
    """Text that is printed at the program's end comes after all earlier text."""
    program = """
import os
from omnibot_driver.output import UnblockedOutput
with UnblockedOutput():
    os.write(2, b"first, ")
raise SystemExit("then the last words")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.stderr == b"first, then the last words\n"


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_port_never_takes_the_place_of_a_closed_standard_output(closed: str) -> None:
    """Standard streams are closed, so their descriptors are free. A port must not get one of them.

    Otherwise text that the program prints would go to the board.
    """
    program = """
import os, sys
from omnibot_driver.output import UnblockedOutput
with UnblockedOutput():
    print("without a reader", file=sys.stderr)
    port = os.open("/dev/null", os.O_RDWR)
sys.exit(port <= 2)
"""
    command = f'exec "$0" -c "$1" {closed}'
    done = subprocess.run(
        ["sh", "-c", command, sys.executable, program],
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0
