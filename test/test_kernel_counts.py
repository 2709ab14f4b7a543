# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the kernel's counters for ports and threads."""

import fcntl
import os
import struct
import threading

import pytest

from omnibot_driver.kernel_counts import TIOCGICOUNT, overruns, waited_s


def test_a_pseudo_terminal_counts_no_overruns() -> None:
    """A pseudo-terminal counts no overruns: if its buffer is full, the writing program waits."""
    ours, theirs = os.openpty()
    try:
        assert overruns(theirs) is None
    finally:
        os.close(ours)
        os.close(theirs)


def test_overruns_of_the_chip_and_of_the_buffer_are_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of overruns is the sum of two numbers that the kernel gives.

    These are the eighth and the eleventh number in ``serial_icounter_struct`` of linux/serial.h.
    """

    def ioctl(_descriptor: int, request: int, _data: bytes) -> bytes:
        assert request == TIOCGICOUNT
        return struct.pack("20i", 1, 1, 1, 1, 500, 500, 7, 2, 7, 7, 3, *[0] * 9)

    monkeypatch.setattr(fcntl, "ioctl", ioctl)
    assert overruns(0) == 5


def test_a_thread_has_waited_and_one_that_is_none_is_not_known() -> None:
    """``waited_s`` returns how long a thread was ready to run but did not run, in s.

    The result is None if the thread does not exist, or if the kernel does not measure this time.
    """
    waited = waited_s(threading.get_native_id())
    assert waited is None or waited >= 0.0
    assert waited_s(0) is None
