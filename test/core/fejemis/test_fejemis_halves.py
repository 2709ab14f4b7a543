# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the two boards of one robot: swapped ports, and a restart or silence of one board."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, drive_until_refused, nominal

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.readings import Job
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import SimulatedFejemis

HALVES = {"drive": DRIVE, "front": FRONT}


def assert_stands(bench: Bench) -> None:
    bench.run(0.8)
    assert bench.robot.standing
    before = bench.robot.truth.x_m
    bench.run(0.3)
    assert bench.robot.truth.x_m == before


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_the_ports_may_be_in_any_order(*, swapped: bool) -> None:
    """The two boards are connected in either order.

    The driver finds the order by the heartbeats.
    """
    bench = nominal(Simulated(swapped=swapped))
    bench.drive_on()
    assert bench.robot.truth.speed_mps == pytest.approx(0.3, abs=0.01)
    assert bench.board.traits.channels == (("front", "drive") if swapped else ("drive", "front"))
    assert any("swapped" in text for text in bench.notices) is swapped
    bench.estop(True)
    bench.run(1.0)
    assert bench.robot.drive.source == -1
    assert not bench.board.figures.own.get("Front lines unknown")


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_a_half_that_falls_silent_stops_the_robot_and_is_named(half: str) -> None:
    """One board becomes silent. The robot is stopped, and a notice names the board.

    When both boards send again, a new command moves the robot.
    """
    bench = nominal()
    bench.drive_on()
    bench.speaks = {1 - HALVES[half]}
    assert drive_until_refused(bench) <= (0.11 if half == "front" else 0.31)
    bench.run(2.0)
    assert bench.session.state == "connecting"
    assert any(f"the {half} board is silent" in text for text in bench.notices)
    with pytest.raises(CommandRefused, match=f"check the {half} board"):
        bench.drive()
    with pytest.raises(RequestRefused, match=f"check the {half} board"):
        bench.board.services.set_brush(True, bench.now)
    with pytest.raises(RequestRefused, match=f"check the {half} board"):
        bench.board.services.ask(Job.SAVE, None, bench.now)
    assert_stands(bench)
    bench.speaks = {DRIVE, FRONT}
    bench.run_until(lambda: bench.session.state == "nominal")
    assert_stands(bench)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.slow
@pytest.mark.parametrize("lost", [(), (DRIVE,), (FRONT,)])
def test_a_stall_of_the_driver_is_not_blamed_on_the_boards(lost: tuple[int, ...]) -> None:
    """After a stall, the driver calls a board silent only if the board still sends nothing."""
    bench = nominal()
    bench.drive_on()
    bench.now += 3.0
    bench.session.stood_still(3.0, bench.now)
    bench.settle()
    bench.speaks = {DRIVE, FRONT} - set(lost)
    bench.run(2.5)
    named = [half for half in HALVES if any(f"{half} board is silent" in t for t in bench.notices)]
    assert named == [half for half, channel in HALVES.items() if channel in lost]
    assert_stands(bench)


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_a_half_that_restarts_is_subscribed_again(half: str) -> None:
    """One board restarts while the robot drives.

    The robot stops, and the driver subscribes to the board's messages again. A new command then
    moves the robot.
    """
    bench = nominal()
    bench.drive_on()
    before = dict(bench.robot.half(half).subscriptions)
    bench.robot.half(half).reboot()
    drive_until_refused(bench)
    bench.run(1.5)
    assert any(f"the {half} board has restarted" in text for text in bench.notices)
    bench.run_until(lambda: bench.session.state == "nominal")
    assert bench.robot.half(half).subscriptions == before
    assert_stands(bench)
    odom, truth = bench.odometry[-1].pose, bench.robot.truth
    assert odom.x_m == pytest.approx(truth.x_m, abs=0.06)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_a_half_whose_port_is_gone_is_missed_and_the_other_hears_the_stop(half: str) -> None:
    """The port of one board disappears while the robot drives. The other board receives a stop.

    Motion is refused until both ports are open.
    """
    bench = nominal()
    bench.drive_on()
    mark = bench.now
    channel = HALVES[half]
    bench.close()
    bench.hears = bench.speaks = {1 - channel}
    bench.open(missing=f"the port '{half}' is missing")
    bench.run(0.5)
    assert "rc 2 0 0" in bench.lines(1 - channel, mark)
    assert bench.session.state == "connecting"
    with pytest.raises(CommandRefused, match=half):
        bench.drive()
    bench.close()
    bench.hears = bench.speaks = {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.5)
    assert_stands(bench)
    odom, truth = bench.odometry[-1].pose, bench.robot.truth
    assert (odom.x_m, odom.y_m) == pytest.approx((truth.x_m, truth.y_m), abs=0.002)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.slow
def test_boards_that_only_change_their_ports_have_not_restarted() -> None:
    """Both cables are unplugged, and plugged in again in the other order.

    The driver reports no restart, and ``odom`` continues.
    """
    bench = nominal()
    bench.drive_on()
    bench.close()
    bench.robot._at_port = bench.robot._at_port[::-1]
    bench.run(2.0)
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.5)
    assert any("the ports are swapped" in text for text in bench.notices)
    assert not any("restarted" in text for text in bench.notices)
    odom, truth = bench.odometry[-1].pose, bench.robot.truth
    assert (odom.x_m, odom.y_m) == pytest.approx((truth.x_m, truth.y_m), abs=0.002)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ids", "sentence"),
    [
        ((90, 90), "both ports lead to a drive board"),
        ((91, 91), "both ports lead to a front board"),
        ((90, 7), "has the id 7"),
        ((0, 91), "has the id 0"),
    ],
)
def test_boards_that_are_no_pair_are_not_driven(ids: tuple[int, int], sentence: str) -> None:
    """The two boards do not form a pair; for example, both are drive boards.

    One notice reports this, and motion is refused.
    """
    bench = Bench(Simulated(ids=ids))
    bench.open()
    bench.run(6.0)
    assert sum(sentence in text for text in bench.notices) == 1
    assert bench.session.state == "connecting"
    assert not any("swapped" in text for text in bench.notices)
    with pytest.raises(CommandRefused, match=sentence):
        bench.drive()


@pytest.mark.slow
@pytest.mark.parametrize("ids", [(7, 91), (90, 7)])
def test_a_board_of_another_robot_receives_only_stops_and_questions(ids: tuple[int, int]) -> None:
    """One port leads to a board of another robot.

    This board receives only lines that stop something, and requests for its heartbeat.
    """
    bench = Bench(Simulated(ids=ids))
    bench.open()
    bench.run(6.0)
    received = set(bench.lines(ids.index(7)))
    assert received == {"rc 2 0 0", "motv 0 0", "brush 0", "hbti"}


@pytest.mark.parametrize("half", HALVES)
def test_a_board_that_never_speaks_is_missed(half: str) -> None:
    """One board never sends anything. One notice names this board."""
    bench = Bench()
    bench.speaks = {1 - HALVES[half]}
    bench.open()
    bench.run(5.0)
    assert sum(f"no data from the {half} board" in text for text in bench.notices) == 1


@pytest.mark.slow
@pytest.mark.parametrize("estop", [False, True])
@pytest.mark.parametrize(("ids", "speaks"), [((90, 91), {DRIVE}), ((90, 90), {DRIVE, FRONT})])
def test_the_stop_for_boards_that_are_no_pair_is_not_repeated_for_ever(
    ids: tuple[int, int], speaks: set[int], *, estop: bool
) -> None:
    """One board is silent, or both are drive boards.

    After 5 s, the driver sends Stop only twice a second, when it tries to start the boards. With
    the e-stop, the driver sends Stop 20 times a second.
    """
    bench = Bench(Simulated(ids=ids))
    bench.speaks = speaks
    bench.open()
    bench.estop(estop)
    bench.run(7.0)
    mark = bench.now
    bench.run(1.0)
    assert bench.lines(DRIVE, mark).count("rc 2 0 0") <= (22 if estop else 5)


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_a_board_that_is_silent_after_a_reconnect_is_missed(half: str) -> None:
    """After a reconnect one port is silent. The driver remembers which board was at this port.

    One notice names that board.
    """
    bench = nominal()
    bench.close()
    bench.speaks = {1 - HALVES[half]}
    bench.open()
    bench.run(5.0)
    assert sum(f"no data from the {half} board" in text for text in bench.notices) == 1
    assert len(bench.notices) == 1


def test_no_board_is_named_after_a_reconnect_if_both_are_silent() -> None:
    """After a reconnect both boards are silent. One notice says so and names neither."""
    bench = nominal()
    bench.close()
    bench.speaks = set()
    bench.open()
    bench.run(5.0)
    (notice,) = bench.notices
    assert "no data from the board for" in notice


@pytest.mark.slow
def test_ports_that_change_places_while_they_are_away_are_found_out_each_time() -> None:
    """After each exchange of ports, the driver finds out which board is where, and can drive."""
    bench = nominal()
    for swapped in (True, False, True):
        bench.close()
        bench.robot = SimulatedFejemis(Simulated(swapped=swapped))
        bench.open()
        bench.run_until(lambda: bench.session.state == "nominal")
        bench.run(0.4)
        assert bench.board.advice is None
        bench.drive_on()
        assert not bench.robot.standing
    assert not any("both ports" in text for text in bench.notices)


@pytest.mark.slow
def test_what_a_board_told_before_a_reconnect_is_not_shown_as_current() -> None:
    """After a reconnect another board may be at the port.

    So the diagnostics no longer show the old values.
    """
    bench = nominal()
    bench.run(5.0)
    told = {"Drive ver", "Drive bat", "Drive cvdrive", "Front id"}
    assert told <= bench.board.figures.own.keys()
    bench.close()
    bench.speaks = set()
    bench.open()
    bench.run(1.0)
    assert not told & bench.board.figures.own.keys()


@pytest.mark.slow
@pytest.mark.parametrize("ahead_s", [0.4, -0.4, 5.0])
def test_ports_that_change_places_leave_each_board_its_own_time(ahead_s: float) -> None:
    """After the boards have exchanged ports, the drive board's stamps still use its own clock.

    ``ahead_s``: time by which the front board's clock is ahead, in s.
    """
    bench = Bench()
    bench.robot.front._restart(ahead_s)
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.5)
    bench.close()
    bench.robot._at_port = bench.robot._at_port[::-1]
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal", 1.0)
    bench.run(1.0)
    assert bench.now - bench.odometry[-1].stamp_s < 0.05
    assert not any("restarted" in text for text in bench.notices)


def test_a_board_that_says_that_it_starts_when_the_port_opens_has_restarted() -> None:
    """When the port opens, the board's start message arrives before its first heartbeat.

    The driver reports the restart.
    """
    bench = nominal()
    bench.close()
    bench.session.opened(bench.now)
    bench.session.inbound.receive(b"# Starting main loop\n", bench.now, DRIVE)
    bench.run(3.0)
    assert any("drive board has restarted" in text for text in bench.notices)


@pytest.mark.parametrize("half", HALVES)
def test_a_board_that_restarts_at_the_port_of_the_other_is_named(half: str) -> None:
    """Two boards come back at exchanged ports, and one of them has restarted.

    After this board's first heartbeat, the driver reports that this board, and no other, has
    restarted.
    """
    bench = nominal()
    bench.close()
    bench.robot._at_port = bench.robot._at_port[::-1]
    restarted = bench.robot.drive if half == "drive" else bench.robot.front
    restarted._restart(0.0)
    bench.open()
    bench.run_until(lambda: bench.board._ports.halves[1 - HALVES[half]].heartbeat is not None)
    assert f"the {half} board has restarted; robot stopped" in bench.notices
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(1.0)
    assert sum("restarted" in text for text in bench.notices) == 1
