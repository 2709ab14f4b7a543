# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of foreign data on the port of a LOIS ECU: one notice appears."""

from random import Random

import pytest
from any_board import MAKERS, TICK_S, AnyBench

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.lois_ecu.board import LoisEcuBoard
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings

OMNIBOT = b"\xff\xfa" + bytes(range(12)) + b"\x55\xff\xfb" + bytes(range(8))
NMEA = b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n"
SHORT = b":0200140014\n"
LONG = b":02001400140038\n"
SUMLESS_SUM = b":0200140014ff\n"

WRONG = {
    "another board": (OMNIBOT, "OmniBot board's frames: set board to omnibot"),
    "NMEA": (NMEA, "NMEA sentences"),
    "noise": (Random(1).randbytes(500), "the bytes are not text: check baudrate"),
    "too short": (SHORT, "lines arrive without checksums"),
    "too long": (LONG, "lines of 16 characters come instead of lines of 14"),
    "a wrong checksum": (SUMLESS_SUM, "lines arrive with wrong checksums"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("data", "sentence"), WRONG.values(), ids=WRONG)
def test_what_is_not_this_boards_is_named_and_refuses_motion(data: bytes, sentence: str) -> None:
    """Foreign data arrives. One notice names its likely source, and motion is refused.

    When the LOIS ECU sends data, the robot can be driven.
    """
    board, robot = MAKERS["lois_ecu"]()
    bench = AnyBench(board, robot)
    bench.speaks = False
    bench.open()
    for _ in range(500):
        bench.run(TICK_S)
        bench.session.inbound.receive(data[:40], bench.now)
        bench.session.inbound.receive(data[40:], bench.now)
        bench.settle()
    assert bench.session.state == "connecting"
    with pytest.raises(CommandRefused, match="connecting"):
        bench.drive()
    assert robot.stands
    assert len([notice for notice in bench.notices if sentence in notice]) == 1, bench.notices
    bench.speaks = True
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.drive_on(seconds=2.0)
    assert not robot.stands


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["lois_ecu", "lois_ecu as documented"])
@pytest.mark.parametrize("checks", [True, False])
def test_a_board_whose_checksum_is_set_otherwise_is_set_right(
    firmware: str, *, checks: bool
) -> None:
    """The board has a wrong setting for checksums. The driver corrects this setting."""
    _, robot = MAKERS[firmware]()
    robot.board._reader.checks = not checks
    bench = AnyBench(LoisEcuBoard(LoisEcuSettings(with_sum=checks)), robot)
    bench.open()
    bench.run(8.0)
    bench.drive_on(seconds=2.0)
    assert not robot.stands


def test_a_board_without_checksums_is_set_right_although_its_ticks_are_lost() -> None:
    """Another program has switched the checksums off, and the line loses all tick reports.

    Within ten seconds, the driver switches the checksums on, and sends a Stop that the board obeys.
    """
    _, robot = MAKERS["lois_ecu"]()
    robot.board.receive(b":11000000043e\n")
    bench = AnyBench(LoisEcuBoard(LoisEcuSettings()), robot)
    bench.speaks = False
    bench.run(3.0)
    bench.open()
    robot.board.commands.clear()
    for _ in range(round(10.0 / TICK_S)):
        bench.run(TICK_S)
        bench.session.inbound.receive(b":100000005a6f\n", bench.now)
    assert robot.board._reader.checks
    bench.run(1.0)
    mode = [(one.command, one.payload) for one in robot.board.commands]
    assert (1, 0) in mode[mode.index((0x11, 0)) :]
