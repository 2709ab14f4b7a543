# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the check of a port's address. The check rejects an address that can never be opened."""

import os
from pathlib import Path

import pytest

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.transports.serial_address import check_address


@pytest.mark.parametrize(
    "url",
    [
        "nonsense://board",
        "sim",
        "ttyUSB0",
        "COM3",
        "udp:/host",
        "udp://192.168.1.50:5000",
        "socket://nohost",
        "socket://localhost:99999",
        "socket://two..dots:5000",
        "rfc2217://localhost",
        "rfc2217://localhost:5000?timeout=long",
        "loop://?nonsense=1",
        "alt://?class=Nonsense",
        "spy:///dev/ttyUSB0?nonsense=1",
        "hwgrep://[",
    ],
)
def test_a_name_that_is_no_address_is_refused(url: str) -> None:
    """A port that is neither a path nor a URL of pyserial is rejected.

    The message names the parameter and shows a valid port.
    """
    with pytest.raises(ParameterError) as refusal:
        check_address(url, "front_port")
    assert str(refusal.value).startswith(f"front_port '{url}' is not valid: give the whole path of")


@pytest.mark.parametrize(
    "url",
    [
        "/dev/no-such-device",
        "/dev/null",  # only opening it shows that it is not a serial port
        "/dev/ptmx",
        "socket://localhost:1",
        "socket://no-such-host.invalid:5000",
        "rfc2217://[::1]:5000",
        "loop://",
        "hwgrep://no-such-adapter",
        "spy:///dev/no-such-device",
        "alt:///dev/no-such-device?class=PosixPollSerial",
    ],
)
def test_what_may_appear_later_is_not_refused(url: str) -> None:
    """A port is accepted if a later attempt to open it may succeed.

    Examples: the device is missing, the host is unknown, or only opening shows whether the port
    works.
    """
    check_address(url)


def test_a_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    """The path of a folder, of a symbolic link to a folder, or of a file is rejected as a port."""
    link = tmp_path / "link"
    link.symlink_to(tmp_path)
    for path in (str(tmp_path), str(link), __file__):
        with pytest.raises(ParameterError, match=rf"{path} is not a serial port.*set `port`"):
            check_address(path)


def test_a_link_whose_device_is_unplugged_is_not_refused(tmp_path: Path) -> None:
    """The port is a symbolic link to a device that is unplugged. It is accepted."""
    link = tmp_path / "omnibot"
    link.symlink_to("/dev/no-such-device")
    check_address(str(link))


@pytest.mark.parametrize("url", ["loop://", "rfc2217://localhost:5000"])
def test_a_port_without_descriptor_is_refused_for_a_board_with_several(url: str) -> None:
    """For a board with several lines, a port without a file descriptor is rejected.

    The driver polls all lines together, by their descriptors.
    """
    check_address(url)
    with pytest.raises(ParameterError, match="does not work for a board with several ports"):
        check_address(url, pollable=True)


@pytest.mark.parametrize("url", ["/dev/ttyACM0", "socket://localhost:5000", "spy:///dev/ttyACM0"])
def test_a_port_with_a_descriptor_is_accepted_for_a_board_with_several(url: str) -> None:
    """A board has several lines. Ports that have a file descriptor when open are accepted."""
    check_address(url, pollable=True)


def test_a_check_opens_nothing() -> None:
    """The check of a port's address does not open the port.

    Opening could restart the board, and would keep other programs from opening the port.
    """
    ours, theirs = os.openpty()
    try:
        before = os.listdir("/proc/self/fd")
        check_address(os.ttyname(theirs))
        assert os.listdir("/proc/self/fd") == before
    finally:
        os.close(ours)
        os.close(theirs)
