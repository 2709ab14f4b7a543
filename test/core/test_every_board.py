# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The motion rules, tested on every kind of board: only a fresh command moves the robot."""

import math
from collections.abc import Callable
from random import Random

import pytest
from any_board import BOARDS, MAKERS, TICK_S, AnyBench, nominal

from omnibot_driver.boards import PROFILES
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.requests import Request, RequestDone

ENDS_S = 1.0
"""Longest time that a robot needs to come to rest after it has received a stop, in s."""
STARTED = [name for name in BOARDS if Request.START in MAKERS[name]()[0].traits.requests]
"""Names of the boards that have ~/start."""


@pytest.fixture(params=BOARDS)
def bench(request: pytest.FixtureRequest) -> AnyBench:
    return nominal(request.param)


def test_every_board_of_the_driver_is_among_them() -> None:
    """``MAKERS`` has every board of the driver. Only the boards in ``MAKERS`` are tested here."""
    missing = set(PROFILES) - {name.split()[0] for name in MAKERS}
    assert not missing, "add a robot and an entry of MAKERS to test/core/any_board.py"


def assert_stands_for_good(bench: AnyBench) -> None:
    bench.run(ENDS_S)
    assert bench.robot.stands
    before = bench.robot.way_m
    bench.run(2.0)
    assert bench.robot.way_m == before


def assert_obeys(bench: AnyBench, within_s: float = 3.0) -> None:
    """Check that the robot obeys: command motion until it moves, which must be within ``within_s``.

    The default allows for a MART controller that was restarted, which needs some time.
    """
    end = bench.now + within_s
    while bench.robot.stands:
        assert bench.now < end
        bench.drive_on(seconds=0.1)


@pytest.mark.slow
def test_a_command_moves_the_robot_and_odometry_tells_how_far(bench: AnyBench) -> None:
    """A command of 0.3 m/s for 4 s moves the robot by about 1.2 m, or less if it starts late.

    Odometry has the true distance within 2 cm.
    """
    bench.drive_on(0.3, 4.0)
    bench.run(1.5)
    assert bench.robot.stands
    late_s = getattr(bench.robot, "late_s", 0.0)
    assert 0.8 * 0.3 * (4.0 - late_s) < bench.robot.way_m < 1.2 * 0.3 * 4.0
    assert bench.odometry[-1].pose.x_m == pytest.approx(bench.robot.way_m, abs=0.02)


@pytest.mark.slow
def test_every_command_is_obeyed_however_seldom_odometry_comes(bench: AnyBench) -> None:
    """The user sends fifty commands at 20 Hz.

    All of them are accepted, even on a board whose odometry arrives rarely.
    """
    for _ in range(50):
        bench.drive(0.2)
        bench.run(0.05)
    assert not bench.robot.stands


@pytest.mark.slow
def test_a_robot_stands_after_the_timeout_and_is_not_commanded_any_more(bench: AnyBench) -> None:
    """The user stops sending commands.

    After the timeout, the robot stops and does not start again.
    """
    bench.drive_on()
    assert not bench.robot.stands
    bench.run(0.6)
    assert_stands_for_good(bench)
    assert bench.session.shutdown.stands


@pytest.mark.slow
def test_a_zero_command_stops_at_once(bench: AnyBench) -> None:
    """The user commands zero while the robot drives.

    The driver accepts the command, and the robot stops.
    """
    bench.drive_on()
    for _ in range(10):
        bench.drive(0.0)
        bench.run(0.1)
    assert bench.robot.stands


@pytest.mark.slow
def test_after_a_stall_of_the_process_the_robot_stands_and_obeys_a_new_command(
    bench: AnyBench,
) -> None:
    """After a stall of up to 9 s, the robot stops and stays at rest until a new command moves it.

    During the stall, the board's data waits unread.
    """
    for seconds in (0.5, 9.0, 2.0):
        bench.drive_on()
        bench.stall(seconds)
        assert_stands_for_good(bench)
        assert_obeys(bench)


@pytest.mark.slow
def test_an_estop_stops_the_robot_and_nothing_moves_it_until_a_newer_command(
    bench: AnyBench,
) -> None:
    """While the e-stop is latched, commands are refused.

    After its release, the robot stays at rest until a new command arrives.
    """
    bench.drive_on()
    bench.estop(True)
    with pytest.raises(CommandRefused, match="e-stop"):
        bench.drive()
    assert_stands_for_good(bench)
    bench.estop(False)
    assert_stands_for_good(bench)
    bench.drive_on()
    assert not bench.robot.stands


def reconnect(bench: AnyBench) -> None:
    bench.close()
    bench.open()


@pytest.mark.slow
@pytest.mark.parametrize("name", STARTED)
def test_the_answer_to_a_start_says_that_the_estop_is_latched(name: str) -> None:
    """The user calls ~/start on a running board while the e-stop is latched.

    The start succeeds, and its answer says that the e-stop is latched. After the release, the
    answer does not say so.
    """
    bench = nominal(name)
    for latched in (True, False):
        bench.estop(latched)
        bench.session.request(Request.START, token := object(), bench.now)
        bench.run(1.0)
        (answer,) = (e for e in bench.events if isinstance(e, RequestDone) and e.token is token)
        assert answer.success
        assert answer.message.startswith("running (nominal)")
        assert ("the e-stop is latched" in answer.message) == latched


EVENTS: dict[str, Callable[[AnyBench], object]] = {
    "reconnect": reconnect,
    "stall of the driver": lambda bench: bench.session.stood_still(3.0, bench.now),
    "e-stop and release": lambda bench: (bench.estop(True), bench.estop(False)),
}


@pytest.mark.slow
def test_the_robot_moves_again_only_on_a_command_that_arrived_afterwards(bench: AnyBench) -> None:
    """After a reconnect, a stall or an e-stop, only a new command moves the robot.

    The command that was in effect before is discarded.
    """
    bench.drive_on()
    for name, event in EVENTS.items():
        event(bench)
        bench.settle()
        assert_stands_for_good(bench)
        bench.drive_on()
        assert not bench.robot.stands, name


@pytest.mark.slow
def test_a_robot_that_is_not_heard_is_driven_no_further(bench: AnyBench) -> None:
    """A driving robot sends nothing any more, but still receives. The driver stops it.

    Commands are refused until the robot sends data again.
    """
    bench.drive_on()
    bench.speaks = False
    silent = r"no data from|read nothing from|no angle of|no pose from|connecting"
    with pytest.raises(CommandRefused, match=silent):
        bench.drive_on(seconds=5.0)
    assert_stands_for_good(bench)
    assert bench.session.state == "connecting"
    bench.speaks = True
    bench.run_until(lambda: bench.session.state == "nominal")
    assert_obeys(bench)


@pytest.mark.slow
def test_a_robot_that_was_cut_off_in_both_directions_is_stopped_when_it_is_heard_again(
    bench: AnyBench,
) -> None:
    """A robot that was disconnected during a drive is stopped when it is connected again."""
    bench.drive_on()
    bench.speaks = bench.hears = False
    bench.run(5.0)
    bench.speaks = bench.hears = True
    bench.run(2.0)
    assert bench.robot.stands


@pytest.mark.slow
def test_stop_is_still_repeated_when_a_line_of_which_nothing_is_heard_works_again(
    bench: AnyBench,
) -> None:
    """In a drive, the line is cut in both directions.

    After 4 s, the board receives again, but the driver does not. The driver still repeats Stop, so
    the robot stops.
    """
    bench.drive_on()
    bench.speaks = bench.hears = False
    bench.run(4.0)
    bench.hears = True
    bench.run(2.0)
    assert bench.robot.stands


@pytest.mark.slow
def test_what_is_not_a_number_is_refused_and_stops_nothing(bench: AnyBench) -> None:
    """A command with NaN is rejected, and the command before it stays active."""
    bench.drive_on()
    with pytest.raises(CommandRefused, match="NaN or infinity"):
        bench.session.command_twist(BodyTwist(math.nan, 0.0, 0.0), bench.now)
    bench.run(0.2)
    assert not bench.robot.stands


@pytest.mark.slow
def test_no_command_is_faster_than_the_limit(bench: AnyBench) -> None:
    """If the user commands 100 m/s, the robot drives at 0.5 m/s at most, which is the limit.

    The test allows 5 % for its own measurement.
    """
    bench.drive_on(100.0, 1.0)
    before = bench.robot.way_m
    bench.drive_on(100.0, 2.0)
    assert bench.robot.way_m - before < 1.05


@pytest.mark.slow
def test_an_end_leaves_the_robot_standing(bench: AnyBench) -> None:
    """At shutdown, a driving robot stops and stays at rest. Later commands are refused.

    The driver sends Stop until the robot is at rest.
    """
    bench.drive_on()
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    bench.run_until(lambda: bench.session.shutdown.stands)
    for channel, data in bench.session.shutdown.sequence("stop", bench.now):
        bench.robot.receive(data, bench.now, channel)
    bench.speaks = bench.hears = False
    assert_stands_for_good(bench)
    with pytest.raises(CommandRefused, match="shutting down"):
        bench.drive()


@pytest.mark.slow
def test_odometry_stays_a_number_over_lines_that_come_and_go(bench: AnyBench) -> None:
    """The line is cut at random moments, while the robot drives, reverses or rests.

    The odometry stays finite and plausible.
    """
    random = Random(1)
    for vx in (0.3, -0.2, 0.0, -0.2):
        bench.drive_on(vx, random.uniform(0.1, 2.0))
        bench.close()
        for _ in range(random.randrange(150)):
            bench.now += TICK_S
            bench.robot.advance()
        bench.open()
        bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    for estimate in bench.odometry:
        errors = estimate.covariance
        assert estimate.pose.finite
        assert math.isfinite(errors.xx + errors.yy + errors.yaw_yaw)
        assert estimate.pose.way_m < 5.0
    refused = [notice for notice in bench.notices if "implausible" in notice]
    assert not refused
