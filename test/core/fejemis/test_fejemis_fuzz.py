# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests with random input from the boards.

No input makes the driver raise an error, loop for ever or move the robot.
"""

import contextlib
import random

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal
from test_fejemis_lines import GOLDEN

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.readings import Job
from omnibot_driver.core.fejemis.sums import with_sum
from omnibot_driver.core.requests import Request


def any_line(chance: random.Random) -> bytes:
    """Return random bytes, or a line that one of the boards could send, often damaged."""
    text = chance.choice(list(GOLDEN)).encode()
    fields = text.split()
    for at in range(1, len(fields)):
        if chance.random() < 0.3:
            fields[at] = b"%.*f" % (
                chance.randrange(6),
                chance.gauss(0.0, 10.0 ** chance.randrange(-3, 7)),
            )
    text = b" ".join(fields) if chance.random() < 0.5 else text
    line = bytearray((with_sum(text) if chance.random() < 0.5 else text) + b"\n")
    for _ in range(chance.choice([0, 0, 1, 2])):
        line[chance.randrange(len(line))] = chance.randrange(256)
    return chance.randbytes(chance.randrange(300)) if chance.random() < 0.05 else bytes(line)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_no_input_raises_or_keeps_the_session_busy(seed: int) -> None:
    """Bytes, lost ports, commands and requests come in random order. The session raises no error.

    The time at which the session must run next is always in the future.
    """
    chance = random.Random(seed)
    bench = Bench()
    bench.open()
    for _ in range(1500):
        bench.now += chance.choice([0.0, 1e-4, 0.005, 0.005, 0.02, 0.1, 2.0])
        session = bench.session
        with contextlib.suppress(CommandRefused, RequestRefused):
            match chance.randrange(30):
                case 0:
                    session.request(chance.choice([Request.START, Request.PAUSE]), None, bench.now)
                case 1:
                    session.estop(chance.random() < 0.5, bench.now)
                case 2:
                    bench.close()
                    bench.open()
                case 3 | 4 | 5:
                    bench.drive(chance.uniform(-1, 1), chance.uniform(-2, 2))
                case 6:
                    bench.board.services.ask(chance.choice(list(Job)), None, bench.now)
                case 7:
                    bench.board.services.set_brush(True, bench.now)
                case 8:
                    bench.board.services.lift(chance.uniform(-20, 20), bench.now)
                case _:
                    channel = chance.choice([DRIVE, FRONT])
                    session.inbound.receive(any_line(chance), bench.now, channel)
        bench.settle()
        for _ in range(3):
            if bench.now >= session.wake_at:
                session.tick(bench.now)
                bench.settle()
        assert session.wake_at > bench.now, session.state
        session.board.last_words()
        session.figures(bench.now)


def test_bytes_that_come_before_anything_is_known_move_nothing() -> None:
    """Before its first heartbeat, a board sends lines that a previous driver has requested.

    The driver stays in ``connecting`` and publishes no odometry.
    """
    bench = Bench()
    bench.open()
    for line in (b"fwl 10.50 0x0 0x3c2\n", b"pose 1.0 0 0 0\n", b"gyro 1 2 3\nacc 0 0 9.8\n"):
        bench.session.inbound.receive(line, bench.now, DRIVE)
        bench.session.inbound.receive(line, bench.now, FRONT)
    bench.settle()
    assert bench.session.state == "connecting"
    assert not bench.odometry


def test_many_lines_that_are_not_understood_are_told_once() -> None:
    """Many unknown lines arrive, as from a help text or a damaged cable. One notice appears."""
    bench = nominal()
    for _ in range(3):
        bench.session.inbound.receive(
            60 * b"   veri and 'sub ver N'    get version\n", bench.now, DRIVE
        )
        bench.run(0.5)
    assert sum("not understood" in text for text in bench.notices) == 1
    assert bench.session.state == "nominal"


@pytest.mark.slow
def test_a_stream_that_the_firmware_does_not_know_is_told_and_not_asked_for_again() -> None:
    """The firmware does not know one stream: ``tofd``, from the time-of-flight sensor.

    A notice says so, and the driver no longer subscribes to this stream.
    """
    bench = nominal()
    del bench.robot.drive._items["tofd"]
    bench.robot.drive.reboot()
    bench.run(6.0)
    assert any("does not know tofd" in text for text in bench.notices)
    mark = bench.now
    bench.run(3.0)
    assert not [text for text in bench.lines(DRIVE, mark) if "tofd" in text]
