# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated OmniBot in the driver's own process."""

import time
from contextlib import closing

import pytest

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.transports.simulated import SimulatedTransport, check_address

pytestmark = pytest.mark.usefixtures("nothing_left_behind")

OMNIBOT = "omnibot_driver.simulator.omnibot"
PATIENCE_S = 20.0


def read(transport: SimulatedTransport) -> bytes:
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        if data := transport.read()[1]:
            return data
    raise AssertionError("the board says nothing")


def test_a_board_boots_and_obeys() -> None:
    """The board boots and sends the text "Paused: 0".

    After it is woken and started, it sends data frames.
    """
    with closing(SimulatedTransport("sim://", OMNIBOT)) as transport:
        assert read(transport) == b"Paused: 0 \n"
        transport.write([(0, bytes(8)), (0, b"S")])
        assert read(transport).startswith(b"\xff\xfa")


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("sim://?wheels=4", "there is no option 'wheels=4'"),
        ("sim://?imu", "there is no option 'imu'"),
        ("sim://?lose=2", "'2' is not a probability; give a number from 0 to 1"),
        ("sim://?seed=first", "invalid int value: 'first'"),
        ("sim://?imu_only=maybe", "--imu-only: ignored explicit argument 'maybe'"),
        ("sim://imu_only", "'imu_only' must come after a question mark"),
    ],
)
def test_options_that_it_does_not_know_are_refused(url: str, why: str) -> None:
    """A URL has a wrong option.

    The error message says what is wrong, and names the command that lists the options.
    """
    with pytest.raises(ParameterError) as refusal:
        check_address(url, OMNIBOT)
    assert why in str(refusal.value)
    assert "simulator --help" in str(refusal.value)
