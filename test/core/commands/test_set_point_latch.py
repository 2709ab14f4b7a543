# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the e-stop in the stream of set-points, and of its release."""

import pytest
from set_point_bench import BOTH, GO, STOP, TURN, Stream, make_stream, order, run

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.packets import packed


@pytest.fixture
def stream() -> Stream:
    return make_stream()


def test_a_new_line_hears_a_latched_estop_at_once(stream: Stream) -> None:
    """The port opens again 1 ms after an e-stop was sent on the old connection.

    The e-stop is sent at once on the new connection too.
    """
    stream.latch(1.0)
    stream.write(1.0)
    stream.connect(1.001)
    assert stream.write(1.001) == 2 * BOTH


def test_an_estop_between_two_authorities_is_all_that_goes_out(stream: Stream) -> None:
    """The e-stop is latched when another topic has just begun to command the robot.

    The driver sends only the e-stop. It sends neither the Stop between the two topics nor the
    command of the new topic.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    order(stream, TURN, 1.001, Authority.WHEELS)
    stream.latch(1.001)
    assert stream.current is None
    assert {frame for _, frame in run(stream, 1.001, 1.2)} == {2 * BOTH, BOTH}


def test_the_emergency_stop_never_waits_and_is_repeated_without_end(stream: Stream) -> None:
    """A user latches the e-stop just after a command.

    The driver sends ES and Stop at once, twice, and then repeats both without end. Both are needed:
    some firmware does not know ES.
    """
    order(stream, GO, 1.0)
    stream.write(1.0)
    stream.latch(1.001)
    assert stream.write(1.001) == 2 * BOTH
    written = run(stream, 1.001, 101.0)
    assert {frame for _, frame in written} == {BOTH}
    assert len(written) == pytest.approx(2000, abs=2)


def test_what_others_write_does_not_keep_the_emergency_stop_from_being_repeated(
    stream: Stream,
) -> None:
    """While the e-stop is latched, other requests write letters such as S (start) at 50 Hz.

    The e-stop is still repeated at 20 Hz.
    """
    stream.latch(1.0)
    written = 0
    for step in range(1000):
        now = 1.0 + step * 0.001
        if step % 20 == 7:
            stream.actuator.wrote(packed(b"S"), now)
        written += stream.write(now) in (BOTH, 2 * BOTH)
    assert written >= 20


def test_a_flood_of_emergency_stops_keeps_the_pace(stream: Stream) -> None:
    """A node requests the e-stop a thousand times in one second.

    The driver sends the e-stop only about 20 times in this second, to spare the line.
    """
    written = []
    for step in range(1000):
        now = 1.0 + step * 0.001
        stream.latch(now)
        written.append(stream.write(now))
    assert written.count(2 * BOTH) == 1
    assert written.count(BOTH) == pytest.approx(19, abs=1)


def test_a_release_sends_stop_and_forgets_what_was_commanded_before(stream: Stream) -> None:
    """A user latches the e-stop during a drive, and releases it. Then only Stop is sent."""
    order(stream, GO, 1.0)
    stream.write(1.0)
    stream.latch(1.1)
    stream.write(1.1)
    stream.release(1.2)
    assert {frame for _, frame in run(stream, 1.2, 5.0)} == {STOP}


def test_a_release_without_a_latch_does_nothing(stream: Stream) -> None:
    """A user releases an e-stop that is not latched. The robot drives on."""
    order(stream, GO, 1.0)
    stream.release(1.0)
    assert stream.write(1.0) == GO
