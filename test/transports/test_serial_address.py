# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of what the driver refuses at its start, because no later attempt could open the port."""

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
    """No path and no URL of pyserial. The text names the parameter and gives examples."""
    with pytest.raises(ParameterError) as refusal:
        check_address(url, "front_port")
    assert str(refusal.value).startswith(f"front_port '{url}' is not valid: give the whole path of")


@pytest.mark.parametrize(
    "url",
    [
        "/dev/no-such-device",
        "/dev/null",  # to know this, the driver would have to open the device
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
    """A missing device may be plugged in later, and an unknown host may come to the network."""
    check_address(url)


def test_a_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    """The path leads to something that is not a device, also through a symbolic link."""
    link = tmp_path / "link"
    link.symlink_to(tmp_path)
    for path in (str(tmp_path), str(link), __file__):
        with pytest.raises(ParameterError, match=rf"{path} is not a serial port.*set `port`"):
            check_address(path)


def test_a_link_whose_device_is_unplugged_is_not_refused(tmp_path: Path) -> None:
    """A symbolic link leads nowhere, as after an adapter was unplugged."""
    link = tmp_path / "omnibot"
    link.symlink_to("/dev/no-such-device")
    check_address(str(link))


@pytest.mark.parametrize("url", ["loop://", "rfc2217://localhost:5000"])
def test_a_port_without_descriptor_is_refused_for_a_board_with_several(url: str) -> None:
    """Several lines are polled together, so each of them needs a file descriptor."""
    check_address(url)
    with pytest.raises(ParameterError, match="does not work for a board with several ports"):
        check_address(url, pollable=True)


@pytest.mark.parametrize("url", ["/dev/ttyACM0", "socket://localhost:5000", "spy:///dev/ttyACM0"])
def test_a_port_with_a_descriptor_is_accepted_for_a_board_with_several(url: str) -> None:
    """These kinds of ports have file descriptors when they are open."""
    check_address(url, pollable=True)


def test_a_check_opens_nothing() -> None:
    """The terminal would be exclusive, and a board might restart, if the check opened the port."""
    ours, theirs = os.openpty()
    try:
        before = os.listdir("/proc/self/fd")
        check_address(os.ttyname(theirs))
        assert os.listdir("/proc/self/fd") == before
    finally:
        os.close(ours)
        os.close(theirs)
