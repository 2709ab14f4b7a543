# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a single serial port: errors with advice, exclusive use, and complete writes."""

import fcntl
import os
import termios
import threading
from pathlib import Path

import pytest
from listener import PATIENCE_S, STOP
from terminal import Terminal

from omnibot_driver.core.errors import LinkError
from omnibot_driver.core.packets import packed
from omnibot_driver.transports.serial_port import SerialPort

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@pytest.mark.parametrize(
    ("error", "advice"),
    [
        (PermissionError(13, "Permission denied"), "group dialout"),
        (FileNotFoundError(2, "No such file"), "by-id"),
        (BlockingIOError(11, "Resource temporarily unavailable"), "fuser"),
        (OSError(16, "Device or resource busy"), "fuser"),
        (ValueError("invalid URL"), "socket://"),
        (ValueError("Failed to set custom baud rate (12345): [Errno 22]"), "`baudrate`"),
        (ValueError("remote rejected value for option 'baudrate'"), "`baudrate` and the server"),
        (termios.error(5, "Input/output error"), "USB0: the device does not respond"),
        (termios.error(25, "Inappropriate ioctl for device"), "is not a serial port"),
        (IsADirectoryError(21, "Is a directory"), "is not a serial port"),
        (OSError(5, "Input/output error"), "USB0: Input/output error; check the parameter"),
        (OSError("it said so"), "USB0: it said so; check the parameter"),
    ],
)
def test_every_way_a_port_can_refuse_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, error: Exception, advice: str
) -> None:
    """For each error that prevents the opening of a port, the message has advice."""

    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("serial.serial_for_url", refuse)
    with pytest.raises(LinkError, match=advice) as caught:
        SerialPort("/dev/ttyUSB0", 115200)
    assert caught.value.__cause__ is error


@pytest.mark.parametrize("path", ["/dev/no-such-port", "/dev/null", "spy://a:b"])
def test_a_port_that_cannot_be_had_names_the_parameter_to_set(path: str) -> None:
    """A port of a board with several lines cannot be opened.

    The message names the parameter of this port.
    """
    with pytest.raises(LinkError) as refused:
        SerialPort(path, 115200, "front_port")
    assert "front_port" in str(refused.value)
    assert "`port`" not in str(refused.value)


def test_a_second_user_of_a_port_is_told_who_has_it(terminal: Terminal) -> None:
    """A second program opens a port that is in use.

    The error names the process that uses the port. The driver finds this process in the kernel's
    list of locks.
    """
    port = SerialPort(terminal.path, 115200)
    with pytest.raises(LinkError, match=rf"in use by another program \(process {os.getpid()}, "):
        SerialPort(terminal.path, 115200)
    port.close()


def test_the_name_of_a_user_of_a_port_may_be_cut_within_a_character(terminal: Terminal) -> None:
    """The kernel keeps only 15 bytes of a process's name. Here, a two-byte letter is cut.

    The error still names the process that has locked the port.
    """
    own = Path("/proc/self/comm")
    before = own.read_bytes()
    port = SerialPort(terminal.path, 115200)
    own.write_bytes("fourteen bytesä".encode())
    try:
        with pytest.raises(LinkError, match=rf"\(process {os.getpid()}, fourteen bytes"):
            SerialPort(terminal.path, 115200)
    finally:
        own.write_bytes(before.strip())
        port.close()


def test_closing_a_port_does_not_hang_up(terminal: Terminal) -> None:
    """A port is closed. DTR stays as it was.

    Otherwise, a board that is wired to DTR would restart.
    """
    near = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)
    attributes = termios.tcgetattr(near)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(near, termios.TCSANOW, attributes)
    SerialPort(terminal.path, 115200).close()
    assert not termios.tcgetattr(near)[2] & termios.HUPCL
    os.close(near)


def test_a_real_terminal_is_exclusive_until_it_is_closed(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A port on a real terminal makes the terminal exclusive until the port is closed.

    Only root can then open the terminal, which also stops programs that ignore locks. A
    pseudo-terminal is not made exclusive.
    """

    def exclusive() -> bool:
        near = os.open(terminal.path, os.O_RDWR | os.O_NOCTTY)  # root may open it
        answer = fcntl.ioctl(near, TIOCGEXCL, bytes(4))
        os.close(near)
        return answer != bytes(4)

    port = SerialPort(terminal.path, 115200)
    assert not exclusive()
    port.close()
    monkeypatch.setattr("omnibot_driver.transports.serial_port.PSEUDO_TERMINALS", ())
    port = SerialPort(terminal.path, 115200)
    assert os.geteuid() != 0 or exclusive()
    port.close()
    assert not exclusive()


TIOCGEXCL = 0x80045440
"""Linux's ioctl that shows whether a terminal is exclusive.

The module ``termios`` does not have it.
"""


def test_after_a_failed_write_nothing_old_stands_in_the_way(terminal: Terminal) -> None:
    """After a failed write, the port discards the unsent data, so the next write succeeds.

    The write fails because the buffer of the line is full.
    """
    port = SerialPort(terminal.path, 115200)
    terminal.fill()
    with pytest.raises(LinkError, match="while writing"):
        port.write(packed(STOP))
    port.write(packed(STOP))
    port.close()


def test_a_write_that_is_taken_in_pieces_is_completed(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The port completes a long write that the kernel accepts only in parts."""
    monkeypatch.setattr("omnibot_driver.transports.serial_port.WRITE_TIMEOUT_S", PATIENCE_S)
    port = SerialPort(terminal.path, 115200)
    message = b"".join(b"%05d" % number for number in range(8000))
    reader = threading.Thread(target=lambda: heard.append(terminal.read_until(b"07999")))
    heard: list[bytes] = []
    reader.start()
    port.write(packed(message))
    reader.join(PATIENCE_S)
    assert heard == [message]
    port.close()
