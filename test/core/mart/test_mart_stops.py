# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that every motion of the simulated controller can be stopped, on any network."""

import math

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES
from mart_goals import drops

from omnibot_driver.core.mart import State
from omnibot_driver.core.mart.states import ROLLING
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("motion", [(0.3, 0.0), (0.3, 0.4), (-0.2, 0.0), (0.0, 0.5)])
def test_a_stop_leaves_the_robot_standing_within_half_a_second(
    firmware: Firmware, motion: tuple[float, float]
) -> None:
    """An e-stop during any kind of motion brings the robot to rest within 0.5 s."""
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    assert not bench.robot.stands
    bench.estop(True)
    assert bench.until_it_stands() < 0.5
    bench.run(2.0)
    assert bench.robot.stands
    assert bench.session.shutdown.stands


@pytest.mark.parametrize(
    ("after_s", "firmware"),
    [
        (after_s, FIRMWARES[(n + m) % 3])
        for n, after_s in enumerate((0.02, 0.12, 0.17, 0.22, 0.35, 0.56))
        for m in range(2)
    ],
)
def test_a_stop_in_the_middle_of_a_start_leaves_the_robot_standing(
    after_s: float, firmware: Firmware
) -> None:
    """An e-stop in the middle of a start leaves the robot at rest.

    The e-stop comes during the check of the IMU, or before the answer to the start.
    """
    bench = MartBench(firmware, faults=NetworkFaults(delay_s=0.02), seed=1).ready()
    for vx, yaw_rate in ((0.3, 0.0), (-0.2, 0.0), (0.0, 0.5)):
        bench.try_command(vx, yaw_rate)
        bench.run(after_s)
        bench.estop(True)
        bench.run(1.5)
        assert bench.robot.stands
        way_m = bench.server.chassis.way_m
        bench.run(1.0)
        assert bench.server.chassis.way_m == way_m
        bench.estop(False)
        bench.run(0.5)
    assert not bench.server.hung


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "faults",
    [
        NetworkFaults(lose=0.1),
        NetworkFaults(lose=0.1, duplicate=0.1, delay_s=0.05),
        NetworkFaults(lose=0.1, duplicate=0.1, delay_s=0.3),
    ],
    ids=["lost", "lost, doubled, late by 50 ms", "lost, doubled, late by 300 ms"],
)
def test_a_bad_network_neither_hangs_the_server_nor_leaves_the_robot_driving(
    faults: NetworkFaults, seed: int
) -> None:
    """On a bad network, the robot is at rest within 3 s after the shutdown begins.

    Several motions precede the shutdown, and the server does not hang.
    """
    bench = MartBench(FIRMWARES[seed % 3], faults=faults, seed=seed).ready()
    for vx, yaw_rate in ((0.3, 0.0), (0.0, 0.5), (-0.2, 0.1), (0.2, -0.4)):
        bench.command(vx, yaw_rate, 2.5)
    bench.go_to(0.5, 0.5, 1.0)
    bench.run(4.0)
    bench.session.shutdown.begin(bench.now)
    bench.settle()
    bench.run(1.0)
    assert bench.until_it_stands() < 2.0
    way_m = bench.server.chassis.way_m
    bench.run(3.0)
    assert bench.server.chassis.way_m - way_m < 0.01
    assert not bench.server.hung
    assert not any("lost" in notice for notice in bench.notices)


def test_a_late_copy_of_a_start_is_seen_and_stopped_within_a_second() -> None:
    """The robot is at rest. A late copy of a start command then moves it.

    The driver's regular queries show the motion, and the driver stops it.
    """
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    assert bench.robot.stands
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(0.15)
    assert not bench.robot.stands
    assert bench.until_it_stands() < 0.85
    assert any("moves without a command" in notice for notice in bench.notices)


def test_a_late_copy_of_a_controlled_move_is_stopped_within_a_second() -> None:
    """If a late copy of a command repeats a controlled move, the e-stop ends this move within 1 s.

    The server does not answer the copy.
    """
    bench = MartBench().ready()
    bench.go_to(0.6, 0.0, 0.0)
    bench.run_until(lambda: b"TF" in bench.server.executed[-1].encode(), 10.0)
    bench.server.receive(bench.server.executed[-1].encode(), 0, None, bench.robot.board.now_s)
    bench.run_until(lambda: bench.board._pilot.state is State.STILL, 20.0)
    bench.estop(True)
    assert bench.until_it_stands() < 1.0
    bench.run(2.0)
    assert bench.robot.stands
    assert not bench.server.hung


def test_a_move_of_which_the_name_comes_before_the_reply_is_over_as_usual(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An answer to HELLO that comes before the reply of a move does not end the move."""
    bench = MartBench().ready()
    receive = bench.session.inbound.receive
    late: list[bytes] = []

    def reorder(data: bytes, now: float, channel: int) -> None:
        moves = bench.board._pilot.state is State.MOVING
        if moves and not late and data != b"ok BBB":
            late.append(data)
        else:
            receive(data, now, channel)

    monkeypatch.setattr(bench.session.inbound, "receive", reorder)
    bench.go_to(0.5, 0.0, 0.0)
    bench.run_until(lambda: bool(late), 20.0)
    bench.run(0.25)
    assert bench.board._pilot.state is State.MOVING
    receive(late[0], bench.now, 0)
    bench.settle()
    assert bench.board._pilot.state is State.STILL
    assert bench.said()[-1].startswith(b"TF")


def test_a_number_that_was_asked_for_before_is_not_the_reply_to_a_lost_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The stop of a turn is lost, and a late encoder count arrives.

    The driver does not take the count for the angle in the reply to the stop, although the numbers
    are equal.
    """
    bench = MartBench().ready()
    bench.command(0.0, 0.5, 3.0)
    lost: list[bytes] = []
    receive = bench.robot.receive

    def cut(data: bytes, now: float, channel: int) -> None:
        if lost or data == b"ENC":
            lost.append(data)
        else:
            receive(data, now, channel)

    monkeypatch.setattr(bench.robot, "receive", cut)
    while not lost:
        bench.command(0.0, 0.5, 0.1)
    bench.try_command(0.0, 0.0)
    assert b"SM" in lost
    degrees = round(math.degrees(bench.truth.yaw_rad))
    bench.session.inbound.receive(f"ok {degrees}".encode(), bench.now, 0)
    assert bench.board._pilot.state is State.STOPPING
    monkeypatch.undo()
    assert bench.until_it_stands() < 1.0


@pytest.mark.parametrize(
    ("start", "twist"), [(b"RM", (0.3, 0.0)), (b"L", (0.0, 0.5)), (b"B", (-0.2, 0.0))]
)
def test_a_copy_of_the_starts_ok_is_not_the_reply_to_a_lost_stop(
    start: bytes, twist: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The server's "ok" to a start command arrives twice. Before the second "ok", a stop is lost.

    The driver does not take the second "ok" for the reply to the stop.
    """
    bench = MartBench().ready()
    while not bench.said()[-1].startswith(start):
        bench.try_command(*twist)
        bench.run(0.01)
    bench.speaks = False
    bench.command(*twist, 0.4)
    bench.session.inbound.receive(b"ok", bench.now, 0)
    assert bench.board._pilot.state in ROLLING
    monkeypatch.setattr(bench.robot, "receive", lambda *_: None)
    bench.try_command(0.0, 0.0)
    bench.run(0.05)
    bench.session.inbound.receive(b"ok", bench.now, 0)
    assert bench.board._pilot.state is State.STOPPING
    monkeypatch.undo()
    bench.speaks = True
    assert bench.until_it_stands() < 1.0


@pytest.mark.parametrize("number", range(3))
def test_a_lost_reply_does_not_make_a_stop_look_like_a_restart(number: int) -> None:
    """The network loses replies to queries; later, a drive is stopped as soon as it begins.

    The driver suspects no restart of the server, and sends no MCS to switch the motors off.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.0, 1.0)
    lost: list[bytes] = drops(
        bench.robot.network[0].from_board, lambda data: data[:3] == b"ok " and len(lost) <= number
    )
    bench.command(0.3, 0.0, 0.5)
    bench.command(0.0, 0.0, 1.0)
    since, appeared_s = len(bench.written), bench.board._pilot.appeared_s
    bench.command_until(0.3, 0.0, lambda: not bench.robot.stands)
    bench.command(0.0, 0.0, 2.0)
    assert len(lost) == number + 1
    assert bench.board._pilot.appeared_s == appeared_s
    assert b"MCS 128 128" not in bench.said(since)


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_on_a_good_network_the_next_motion_begins_within_one_and_a_half_seconds(
    firmware: Firmware,
) -> None:
    """On a good network, the robot has the speed of the next motion within 1.5 s.

    The driver reports no restart of the server when the server answers a second stop with "no
    motion".
    """
    bench = MartBench(firmware, dead_zone_units=2.0).ready()
    bench.command(0.3, 0.3, 4.0)
    bench.command(-0.2, 0.0, 4.0)
    turns = [(0.0, rate) for rate in (0.5, -0.5, 0.3, -0.4, 0.45, -0.45)]
    reverses = [(-0.2, 0.0), (0.0, 0.5), (-0.1, 0.2), (0.3, 0.0), (-0.15, -0.2), (0.0, -0.5)]
    for vx, yaw_rate in turns + reverses:
        bench.command(vx, yaw_rate, 1.5)
        facts = bench.robot.board.facts
        assert facts["yaw_rate_radps"] == pytest.approx(yaw_rate, abs=0.1), (vx, yaw_rate)
        assert facts["speed_mps"] == pytest.approx(vx, abs=0.05), (vx, yaw_rate)
        bench.command(vx, yaw_rate, 1.0)
    assert bench.notices == []


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_estop_is_repeated_while_it_is_latched(firmware: Firmware) -> None:
    """While the e-stop is latched, the driver sends the stop ten times a second.

    So a motion that another program starts is stopped soon.
    """
    bench = MartBench(firmware).ready()
    bench.estop(True)
    bench.run(1.0)
    seen = len(bench.written)
    bench.run(2.0)
    assert bench.said(seen).count(b"SRM") == pytest.approx(20, abs=3)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(0.1)
    assert bench.until_it_stands() < 0.6
    assert not bench.server.hung


@pytest.mark.parametrize("motion", [(0.3, 0.0), (-0.2, 0.0), (0.0, 0.5)])
def test_the_stop_port_is_used_a_network_delay_after_the_last_stop(
    motion: tuple[float, float],
) -> None:
    """The IMU dies in a motion.

    The driver waits for 0.3 s after the last SM or SRM (stops), and then uses the stop port: an
    earlier use could hang the server.
    """
    bench = MartBench("firmware").ready()
    bench.command(*motion, 2.5)
    bench.server.imu.alive = False
    bench.command(*motion, 6.0)
    received = bench.server.received
    first_s = min(at_s for at_s, port, _ in received if port == 1)
    stops = [at_s for at_s, _, data in received if data in (b"SM", b"SRM") and at_s <= first_s]
    assert first_s - max(stops) > 0.3
    assert {port for _, port, _ in received} == {0, 1}


def test_a_restarted_driver_stops_what_it_meets() -> None:
    """The robot already moves when a driver starts. The driver stops the robot.

    This also works in a controlled move, during which the server does not answer.
    """
    for begun in (b"RM 30", b"B SLOW", b"L SLOW", b"TF 200", b"MCR 300"):
        bench = MartBench()
        bench.server.receive(begun, 0, None, 0.0)
        bench.run(1.0)
        assert not bench.robot.stands
        bench.open()
        bench.run(15.0)
        assert bench.session.state == "nominal"
        assert bench.robot.stands, begun


@pytest.mark.parametrize("wish", ["forward", "backward", "left", "goal ahead", "goal aside"])
def test_a_driver_that_is_killed_at_any_moment_is_followed_by_a_guard_that_stops_the_robot(
    wish: str,
) -> None:
    """The driver is killed at any moment of a motion.

    The guard repeats the driver's stop commands for one second, and the robot rests.
    """
    twists = {"forward": (0.3, 0.2), "backward": (-0.2, 0.0), "left": (0.0, 0.5)}
    seen = set()
    for tenths in [*range(2, 8), 9, 11, 13, 15, 25, 40]:
        network = NetworkFaults(delay_s=0.03)
        bench = MartBench(FIRMWARES[tenths % 3], network, seed=tenths).ready()
        if wish in twists:
            bench.command(*twists[wish], tenths * 0.1)
            bench.try_command(*twists[wish])
        else:
            bench.go_to(1.5, 0.0 if wish == "goal ahead" else 1.5, 0.0)
            bench.run(tenths * 0.1)
        seen.add(bench.board._pilot.state)
        words = bench.board.stop()
        for tick in range(300):
            if tick < 100 and tick % 5 == 0:
                for channel, data in words:
                    bench.robot.receive(data, bench.now, channel)
            bench.robot.advance()
        assert bench.robot.stands, (wish, tenths, words)
        assert not bench.server.hung
    assert len(seen) >= 2 or wish.startswith("goal")


def test_the_replies_to_a_repeated_estop_count_as_unmatched_not_as_late() -> None:
    """The e-stop is latched, so the driver repeats its stops on a good network.

    In the board's figures, only the number of unmatched replies changes.
    """
    bench = MartBench().ready()
    before = bench.board.figures.own
    bench.estop(True)
    bench.run(1.0)
    after = bench.board.figures.own
    assert {name for name in after if after[name] != before[name]} == {"Unmatched replies"}


def test_a_robot_that_is_pushed_under_the_estop_gets_stops_only() -> None:
    """Someone pushes the robot while the e-stop is latched. The driver sends only stops."""
    bench = MartBench().ready()
    bench.estop(True)
    bench.run(1.0)
    since = len(bench.written)
    for _ in range(30):
        bench.server.chassis.counts += 50
        bench.run(0.1)
    assert {data.split()[0] for data in bench.said(since)} <= {b"SRM", b"SM"}


@pytest.mark.parametrize("motion", ["twist", "goal"])
def test_a_network_that_is_cut_while_a_command_waits_is_reported(motion: str) -> None:
    """A command waits for the check of the IMU, and the network is cut.

    The driver reports that no data comes from the board.
    """
    bench = MartBench().ready()
    bench.robot.receive = lambda *_: None  # type: ignore[method-assign]
    if motion == "goal":
        bench.go_to(2.0, 0.0, 0.0)
        bench.run(8.0)
    else:
        bench.command(0.3, 0.0, 8.0)
    assert bench.session.state != "nominal"
    assert any("no data from the board" in notice for notice in bench.notices)
