# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a network that delays or duplicates replies.

The driver must not take the reply to one request for the reply to another.
"""

import math
from collections.abc import Callable
from typing import Any

import pytest
from mart_bench import MartBench
from mart_goals import drops, on, reach

from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.ground import MOST_GREETINGS
from omnibot_driver.core.mart.replies import Ok
from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.core.mart.stopping import Stopping
from omnibot_driver.core.mart.words import Form
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


def texts(bench: MartBench, since: int = 0) -> list[str]:
    """Return the texts of the driver's notices, from the event with the number ``since`` on."""
    return [each.text for each in bench.events[since:] if isinstance(each, Notice)]


def once(chosen: Callable[[bytes], bool]) -> Callable[[bytes], bool]:
    """Return a function that is true only for the first datagram for which ``chosen`` is true."""
    seen: list[bytes] = []

    def first(data: bytes) -> bool:
        if seen or not chosen(data):
            return False
        seen.append(data)
        return True

    return first


def twice(path: Any, copied: Any, later_s: float) -> None:
    """Let ``path`` deliver a copy of each datagram for which ``copied`` is true.

    The copy arrives ``later_s`` after the datagram, in s.
    """
    real = path.send

    def send(data: bytes, at_s: float) -> None:
        real(data, at_s)
        if copied(data):
            real(data, at_s + later_s)

    path.send = send


def test_a_count_that_follows_the_stop_of_a_turn_is_not_its_angle() -> None:
    """An encoder query arrives after the stop of a turn.

    The driver does not use the count as the angle of the turn, and does not learn the motors' speed
    from it.
    """
    bench = on(NetworkFaults(), "source")
    path = bench.robot.network[0].to_board
    real = path.send
    path.send = lambda data, at_s: real(data, at_s + (0.03 if data == b"ENC" else 0.0))
    bench.command(0.0, 0.5, 4.0)
    lines = [(line.slope, line.offset) for line in bench.board._pilot.loop.lines()]
    pilot = bench.board._pilot

    def waits_for_count() -> bool:
        pending = pilot.conversation.pending
        return pending is not None and pending.word is words.ENC

    bench.run_until(waits_for_count)
    bench.try_command(0.0, 0.0)
    since = len(bench.odometry)
    bench.run(2.0)
    assert bench.said()[-1] == b"SM"
    errors = [abs(math.remainder(each.pose.yaw_rad - 2.0, math.tau)) for each in bench.odometry]
    assert max(errors[since:]) < 1.0
    for before, line in zip(lines, pilot.loop.lines(), strict=True):
        assert line.slope == pytest.approx(before[0], rel=0.3)
    bench.command(-0.2, 0.0, 4.0)
    assert texts(bench) == []


def test_a_likely_number_is_preferred_as_the_angle_of_a_turn() -> None:
    """After the stop of a turn, two numbers arrive: the angle, and a late reply.

    The number with a plausible value is regarded as the angle.
    """
    stopping = Stopping(Motion.SPIN, 10.0, delay_s=0.3, started_s=0.0, owed=1)
    stopping.doubt(Ok(Form.INTEGER, "137"))
    assert stopping.doubtful_result is None
    stopping.doubt(Ok(Form.INTEGER, "1214"), likely=False)
    assert stopping.doubtful_result == Ok(Form.INTEGER, "137")


def test_a_copy_of_a_refusal_does_not_refuse_the_next_check() -> None:
    """The network delivers each reply "not supported" twice.

    The driver does not take the copy for the result of the next check of the IMU, and obeys the
    command to turn.
    """
    bench = on(NetworkFaults(), "documented")
    twice(bench.robot.network[0].from_board, lambda data: b"not supported" in data, 0.1)
    bench.command(0.3, 0.0, 3.0)  # from now on, the driver checks the IMU by MCR SLOW 0
    bench.run(2.0)
    bench.command(0.0, 0.9, 4.0)
    assert not bench.robot.stands
    assert not any("check of the IMU failed" in each for each in texts(bench))


def test_a_copy_of_the_reply_to_a_stopped_move_is_not_a_count() -> None:
    """A copy of the reply to a stopped move is not taken for the encoder count that follows."""
    bench = on(NetworkFaults(), "firmware")
    network, pilot = bench.robot.network[0].from_board, bench.board._pilot
    real = network.send

    def send(data: bytes, at_s: float) -> None:
        number = data[3:].isdigit()
        late = number and bench.written[-1][1] == b"ENC" and pilot._rested_s > bench.now - 0.2
        real(data, at_s + (0.1 if late else 0.0))
        if number and pilot._stopping is not None:
            real(data, at_s + 0.05)

    network.send = send
    bench.go_to(2.0, 0.0, 0.0)
    bench.run_until(lambda: bench.truth.x_m > 0.5)
    bench.try_command(0.0, 0.0)
    bench.run(4.0)
    assert bench.error.way_m < 0.05
    assert texts(bench) == []


@pytest.mark.parametrize("copied", [False, True])
def test_late_replies_after_a_move_do_not_discard_the_goal(copied: bool) -> None:
    """All replies come 0.28 s late. The driver does not discard the goal.

    ``copied``: whether the network duplicates the move. If so, the driver reports this, and the
    odometry contains both runs.
    """
    bench = on(NetworkFaults(), "source")
    assert reach(bench, Pose(0.6, 0.0, 0.0)) == ""
    network = bench.robot.network[0]
    real = network.from_board.send
    # The server needs at least 0.3 s to stop a second run, so a reply after 0.28 s excludes one.
    network.from_board.send = lambda data, at_s: real(data, at_s + 0.28)
    pilot = bench.board._pilot
    drops(network.to_board, lambda data: data == b"HELLO" and pilot.state is State.MOVING)
    if copied:
        twice(network.to_board, lambda data: data.startswith(b"TF"), 0.1)
    said = reach(bench, Pose(2.1, 0.0, 0.0))
    assert b"SL" in bench.said()
    assert ("delivered a controlled move twice" in said) is copied
    assert bench.error.way_m < 0.25
    if not copied:
        assert said == ""
        assert bench.truth.way_to(Pose(2.1, 0.0, 0.0)).way_m < 0.12


def test_a_late_reply_to_a_start_does_not_prove_the_stop() -> None:
    """A copy of an earlier reply looks like the reply to B, which starts a reverse drive.

    The driver then sends SM (stop), which is lost. The late reply to B does not prove the stop.
    """
    bench = on(NetworkFaults(), "firmware")
    network = bench.robot.network[0]
    real = network.from_board.send

    def send(data: bytes, at_s: float) -> None:
        said = bench.said()[-1]
        real(data, at_s + (0.28 if data == b"ok" and said in (b"B SLOW", b"SM") else 0.0))
        if data == b"ok" and said == b"RST IMU":
            real(data, at_s + 0.1)
            real(data, at_s + 0.11)
        elif bench.written[-1][1] == b"RMRA" and data != b"ok":
            real(data, at_s + 0.005)

    network.from_board.send = send
    bench.run(1.0)
    stops = drops(network.to_board, once(lambda data: data == b"SM"))
    bench.command(-0.17, 0.0, 0.1)  # at this speed, no CS is needed
    bench.run_until(lambda: bench.said()[-1] == b"B SLOW")
    began_s = bench.now
    while bench.now < began_s + 0.35:
        bench.command(-0.17, 0.0, 0.1)
    bench.try_command(0.0, 0.0)
    bench.run(0.2)
    assert stops
    bench.run(1.0)
    assert bench.robot.stands
    assert texts(bench) == []  # the driver has not taken the motion for that of another program


def test_a_server_that_stays_silent_for_long_costs_no_memory() -> None:
    """A lost server answers no HELLO. The driver remembers only the last HELLOs that it sent."""
    bench = on(NetworkFaults(lose=1.0), "firmware")
    bench.run(120.0)
    greetings = sum(data == b"HELLO" for _, data in bench.written)
    assert greetings > 50
    assert len(bench.board._pilot._greetings) <= MOST_GREETINGS


@pytest.mark.parametrize("reply", [b"", b"ok " + 55 * b"7" + b".00"], ids=["lost", "unreadable"])
def test_a_heading_that_never_comes_does_not_block_the_other_queries(reply: bytes) -> None:
    """Unusable replies to RMRA (heading query) block neither encoder queries nor the next drive.

    The driver reports that the server does not report the heading.
    """
    bench = on(NetworkFaults(), "source")
    network = bench.robot.network[0].from_board
    real = network.send

    def send(data: bytes, at_s: float) -> None:
        if bench.written[-1][1] != b"RMRA":
            real(data, at_s)
        elif reply:
            real(reply, at_s)

    network.send = send
    bench.command(0.3, 0.0, 3.0)
    bench.run(4.0)
    began_m = bench.truth.x_m
    bench.command(0.3, 0.0, 2.0)
    assert bench.truth.x_m > began_m + 0.1
    told = [each for each in texts(bench) if "does not report the relative heading" in each]
    assert len(told) >= 2
    assert not any("another server" in each for each in texts(bench))


@pytest.mark.parametrize("firmware", ["documented", "source"])
def test_a_drive_whose_last_heading_is_unread_leaves_an_uncertain_heading(
    firmware: Firmware,
) -> None:
    """If the last headings of a curve are lost, the covariance covers the unmeasured turn."""
    bench = on(NetworkFaults(), firmware)
    bench.command(0.3, 0.5, 2.5)
    drops(bench.robot.network[0].to_board, lambda data: data == b"RMRA")
    bench.command(0.3, 0.5, 0.5)
    bench.run(6.0)
    assert bench.board._pilot.odometry.motion is Motion.NONE
    error_rad = abs(math.remainder(bench.error.yaw_rad, math.tau))
    assert error_rad > 0.05
    assert error_rad < 3 * bench.odometry[-1].covariance.yaw_yaw ** 0.5


def lose_and_copy_a_check(bench: MartBench, lost: tuple[bytes, ...]) -> None:
    """Let the network lose some commands and duplicate the next RST IMU.

    ``lost``: the beginnings of the lost commands. The copy of RST IMU comes 0.29 s late, and so
    does the reply to the copy.
    """
    receive, advance, board = bench.robot.receive, bench.robot.advance, bench.robot.board
    copies: list[float] = []
    replies: list[float] = []

    def lossy(data: bytes, now: float, channel: int) -> None:
        if data.startswith(b"RST IMU") and not copies:
            copies.append(board.now_s + 0.29)
        if not data.startswith(lost):
            receive(data, now, channel)

    def late() -> list[Packet]:
        if copies and copies[0] <= board.now_s:
            receive(b"RST IMU", board.now_s, 0)
            copies[0] = math.inf
        out: list[Packet] = []
        for packet in advance():
            if packet[1] == b"ok" and copies == [math.inf]:
                replies.append(board.now_s + 0.29)
            else:
                out.append(packet)
        due = [at for at in replies if at <= board.now_s]
        replies[:] = [at for at in replies if at > board.now_s]
        return out + [(0, b"ok")] * len(due)

    bench.robot.receive = lossy  # type: ignore[method-assign]
    bench.robot.advance = late  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("firmware", "before", "stops_s"),
    [
        (firmware, ((0.0, 0.5), (0.25, 0.0))[(n + m) % 2], stops_s)
        for n, firmware in enumerate(("firmware", "source"))
        for m, stops_s in enumerate((0.1, 0.3, None))
    ],
)
def test_a_late_ok_of_the_check_does_not_confirm_a_move_that_was_lost(
    firmware: Firmware, before: tuple[float, float], stops_s: float | None
) -> None:
    """A late ok to an IMU check does not confirm a turn whose command was lost.

    The encoder count is still that of the previous motion. The odometry does not add this
    count again.
    """
    bench = MartBench(firmware).ready()
    bench.command(*before, 3.0)
    bench.command(0.0, 0.0, 1.5)
    lose_and_copy_a_check(bench, (b"MC",))
    here = bench.odometry[-1].pose
    bench.go_to(here.x_m, here.y_m, here.yaw_rad - 2.0)
    bench.run_until(lambda: bench.board._pilot.motion is Motion.TURN, 5.0)
    bench.run(stops_s or 3.0)
    bench.command(0.0, 0.0, 3.0)
    assert bench.error.way_m < 0.05
    assert abs(bench.error.yaw_rad) < 0.05


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_late_ok_of_the_check_does_not_confirm_a_drive_that_was_lost(firmware: Firmware) -> None:
    """A late ok to an IMU check does not confirm a backward drive whose command was lost.

    The network has just duplicated replies, so the driver regards the ok as a possible copy.
    """
    bench = MartBench(firmware).ready()
    bench.command(-0.2, 0.0, 3.0)
    replies = bench.robot.network[0].from_board
    replies._faults = NetworkFaults(duplicate=1.0)
    bench.command(0.0, 0.0, 3.0)
    replies._faults = NetworkFaults()
    receive = bench.robot.receive
    lose_and_copy_a_check(bench, (b"B", b"ENC"))
    bench.command(-0.2, 0.0, 1.0)
    bench.robot.receive = receive  # type: ignore[method-assign]
    bench.command(0.0, 0.0, 4.0)
    assert bench.error.way_m < 0.05
