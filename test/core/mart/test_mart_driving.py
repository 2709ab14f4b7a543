# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver's half against the simulated controller: what is commanded is driven, and stopped."""

import math
import re
from statistics import mean
from typing import Final

import pytest
from mart_bench import MartBench, steer_along

from omnibot_driver.core.mart import MartSettings, State
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import BatteryReading, DockedReading, SonarReading
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware, Kind

pytestmark = pytest.mark.slow

FIRMWARES: Final[tuple[Firmware, ...]] = ("documented", "firmware", "source")
STEPS = [(0.3, 0.0), (0.15, 0.0), (0.3, 0.3), (0.3, -0.3), (-0.2, 0.0), (-0.2, 0.2), (0.0, 0.5)]


@pytest.mark.parametrize(
    ("volts", "unequal", "firmware"),
    [(20.0, 0.05, "source"), (24.0, 0.0, "documented"), (26.0, -0.05, "firmware")],
)
def test_speed_and_turn_rate_are_within_five_per_cent_two_seconds_after_a_step(
    volts: float, unequal: float, firmware: Firmware
) -> None:
    """By its mean over the next two."""
    bench = MartBench(firmware, volts=volts, motor_inequality=unequal).ready()
    for vx, yaw_rate in STEPS:
        if firmware == "documented" and not vx:
            continue  # without SSP a turn on the spot has one speed
        bench.command(vx, yaw_rate, 2.0)
        speeds, rates = [], []
        for _ in range(20):
            bench.command(vx, yaw_rate, 0.1)
            facts = bench.robot.board.facts
            speeds.append(facts["speed_mps"])
            rates.append(facts["yaw_rate_radps"])
        assert mean(speeds) == pytest.approx(vx, rel=0.05, abs=0.004), (vx, yaw_rate)
        assert mean(rates) == pytest.approx(yaw_rate, rel=0.05, abs=0.015), (vx, yaw_rate)
    assert bench.notices == []


@pytest.mark.parametrize(("left", "firmware"), [(True, "source"), (False, "firmware")])
def test_a_square_of_two_metres_ends_where_it_began(left: bool, firmware: Firmware) -> None:
    """In both directions, within 5 % of its side; odometry knows where to 6 cm of 8 m."""
    bench = MartBench(firmware, motor_inequality=0.05).ready()
    side = 2.0 if left else -2.0
    steer_along(bench, [(2.0, 0.0), (2.0, side), (0.0, side), (0.0, 0.0)])
    bench.run(2.0)
    assert bench.truth.way_m < 0.1
    assert bench.error.way_m < 0.06
    assert bench.server.chassis.way_m > 7.5


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_quiet_gyro_on_a_straight_way_is_no_dead_imu(firmware: Firmware) -> None:
    """Nothing turns the robot but the driver, which does so to see it."""
    bench = MartBench(firmware, gyro_noise_dps=0.0, gyro_bias_dps=0.0).ready()
    bench.command(0.3, 0.0, 6.0)
    assert bench.notices == []
    assert bench.server.chassis.x_m > 1.4
    assert abs(bench.server.chassis.y_m) < 0.03


def test_each_motion_is_begun_and_stopped_by_its_own_words() -> None:
    """Each after a check of the IMU, and with as few exchanges as that takes."""
    bench = MartBench().ready()
    for vx, yaw_rate in ((0.3, 0.0), (-0.17, 0.0), (0.0, 0.5), (0.3, 0.0)):
        bench.command(vx, yaw_rate, 2.0)
    bench.run(2.0)
    said = [data.split()[0] for data in bench.said() if not data.startswith((b"RMCS", b"CS"))]
    said = said[said.index(b"RST") :]
    said = [word for word, before in zip(said, [b"", *said], strict=False) if word != before]
    assert said == [
        *(b"RST", b"RM", b"SRM"),
        *(b"RST", b"B", b"SM"),
        *(b"SSP", b"RST", b"L", b"SM"),
        *(b"RST", b"RM", b"SRM"),
    ]


def test_no_motion_begins_without_a_proof_of_the_imu_that_is_younger_than_a_fifth_of_a_second() -> (
    None
):
    """By what the server has received, on a slow network too."""
    bench = MartBench(faults=NetworkFaults(lose=0.05, delay_s=0.05), seed=3).ready()
    for vx, yaw_rate in ((0.3, 0.0), (0.0, 0.5), (-0.2, 0.0)) * 2:
        bench.command(vx, yaw_rate, 3.0)
        bench.run(1.5)
    starts = [
        (at_s, data)
        for at_s, port, data in bench.server.received
        if port == 0 and data.split()[0] in (b"RM", b"B", b"L", b"R")
    ]
    assert len(starts) >= 4
    checks = [at_s for at_s, _, data in bench.server.received if data == b"RST IMU"]
    for at_s, _ in starts:
        ended_s = max(check for check in checks if check < at_s) + 0.1
        assert at_s - ended_s < 0.2 + 0.05 + 0.05


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("motion", [(0.3, 0.0), (0.3, 0.4), (-0.2, 0.0), (0.0, 0.5)])
def test_a_stop_leaves_the_robot_standing_within_half_a_second(
    firmware: Firmware, motion: tuple[float, float]
) -> None:
    """From the e-stop to standstill."""
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    assert not bench.robot.stands
    bench.estop(True)
    assert bench.until_it_stands() < 0.5
    bench.run(2.0)
    assert bench.robot.stands
    assert bench.session.stands


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("after_s", [0.02, 0.12, 0.17, 0.22, 0.35, 0.56])
def test_a_stop_in_the_middle_of_a_start_leaves_the_robot_standing(
    after_s: float, firmware: Firmware
) -> None:
    """While the IMU is checked, while RM is on its way, while its reply is outstanding."""
    bench = MartBench(firmware, faults=NetworkFaults(delay_s=0.02), seed=1).ready()
    for vx, yaw_rate in ((0.3, 0.0), (-0.2, 0.0), (0.0, 0.5)):
        bench.try_command(vx, yaw_rate)
        bench.run(after_s)
        bench.estop(True)
        bench.run(2.5)
        assert bench.robot.stands
        way_m = bench.server.chassis.way_m
        bench.run(2.0)
        assert bench.server.chassis.way_m == way_m
        bench.estop(False)
        bench.run(0.5)
    assert not bench.server.hung


@pytest.mark.parametrize("seed", range(6))
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
    """Motions of all kinds, one after the other, then an end."""
    bench = MartBench(FIRMWARES[seed % 3], faults=faults, seed=seed).ready()
    for vx, yaw_rate in ((0.3, 0.0), (0.0, 0.5), (-0.2, 0.1), (0.2, -0.4)):
        bench.command(vx, yaw_rate, 2.5)
    bench.go_to(0.5, 0.5, 1.0)
    bench.run(4.0)
    bench.session.leave(bench.now)
    bench.settle()
    bench.run(1.0)
    assert bench.until_it_stands() < 2.0
    way_m = bench.server.chassis.way_m
    bench.run(3.0)
    assert bench.server.chassis.way_m - way_m < 0.01
    assert not bench.server.hung
    assert not any("lost" in notice for notice in bench.notices)


def test_a_late_copy_of_a_start_is_seen_and_stopped_within_a_second() -> None:
    """The driver believes that the robot stands."""
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
    """It keeps the command port silent, so nothing else tells of it."""
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


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("wish", [(0.3, 0.0), (0.0, 0.5), "goal"])
def test_a_dead_imu_refuses_motion_until_it_is_back(
    firmware: Firmware, wish: tuple[float, float] | str
) -> None:
    """Nothing is sent that would start the motors; a server with RST IMU is asked again."""
    bench = MartBench(firmware).ready()
    bench.server.imu.alive = False
    if isinstance(wish, str):
        bench.go_to(0.5, 0.5, 0.0)
        bench.run(3.0)
    else:
        bench.command(*wish, 3.0)
    assert bench.server.chassis.way_m == 0.0
    assert bench.server.chassis.yaw_rad == 0.0
    assert any("IMU" in notice for notice in bench.notices)
    assert "IMU" in bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.run(1.5)
    bench.command(0.3, 0.0, 2.0)
    assert bench.robot.stands is (firmware == "documented")


def test_one_failed_reset_of_the_imu_is_no_dead_imu() -> None:
    """It leaves the IMU closed, so it is said again; the third one would count."""
    bench = MartBench("source").ready()
    bench.server.imu.alive = False
    bench.try_command(0.3, 0.0)
    bench.run_until(lambda: bench.server.imu.closed, 2.0)
    bench.run_until(lambda: not bench.server.busy, 2.0)
    bench.server.imu.alive = True
    bench.command(0.3, 0.0, 1.5)
    assert not bench.robot.stands
    assert bench.notices == []


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_estop_is_repeated_while_it_is_latched(firmware: Firmware) -> None:
    """Ten times a second, and a motion that another program starts does not get far."""
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


def test_an_rm_that_fails_once_after_a_slow_stop_is_tried_again() -> None:
    """The server's count goes on from a stop of 0.56 s to 0.6 s."""
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed" in notice for notice in bench.notices)
    assert bench.board.refusal == ""
    assert not bench.robot.stands


def test_an_rm_that_fails_by_the_obstacle_of_the_last_b_is_tried_again() -> None:
    """The server gives the reason of the last B; the front sonar sees nothing."""
    bench = MartBench("source").ready()
    bench.server.motions[Kind.LINEAR].error = "insufficent clearence"
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed (insufficent clearence)" in notice for notice in bench.notices)
    assert not any("obstacle in front" in notice for notice in bench.notices)
    assert not bench.robot.stands


def test_a_goal_and_a_job_show_how_far_they_are() -> None:
    """In /diagnostics."""
    bench = MartBench().ready()
    shown = set()
    bench.go_to(0.6, 0.4, 0.0)
    for _ in range(60):
        bench.run(0.2)
        shown.add(bench.board.figures.own["Goal"].split(",")[0])
    assert {"move 1", "move 2", "over"} <= shown
    bench.go_to(1.5, 0.4, 0.0)
    bench.run(3.0)
    bench.estop(True)
    bench.run(2.0)
    assert bench.board.figures.own["Goal"] == "none"
    bench.estop(False)
    bench.run(1.0)
    bench.board.ask(Job.DOCK, "token", bench.now, "DOCK", 20)
    bench.run(2.0)
    assert re.fullmatch(r"docking: [23] s of at most 90 s", bench.board.figures.own["Job"])


def test_a_dead_imu_is_told_when_a_command_comes() -> None:
    """No word is sent that starts."""
    bench = MartBench().ready()
    bench.server.imu.alive = False
    bench.command(0.3, 0.0, 3.0)
    assert bench.robot.stands
    assert b"RM" not in {data.split()[0] for data in bench.said()}
    assert any("IMU" in notice for notice in bench.notices)
    assert "IMU" in bench.try_command(0.3, 0.0)


@pytest.mark.parametrize(
    ("motion", "firmware"),
    [
        ((0.3, 0.0), "firmware"),
        ((0.3, 0.0), "source"),
        ((-0.2, 0.0), "firmware"),
        ((0.0, 0.5), "firmware"),
    ],
)
def test_an_imu_that_dies_while_the_robot_moves_stops_it_and_loses_the_server(
    motion: tuple[float, float], firmware: Firmware
) -> None:
    """The heading is frozen: half a second, and the time of a stop. By the source it moves in RM
    alone, so nothing tells of it elsewhere.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    assert not bench.robot.stands
    bench.server.imu.alive = False
    bench.command(*motion, 1.2)
    assert bench.robot.stands
    bench.run(6.0)
    assert any("heading does not change" in notice for notice in bench.notices)
    assert any(notice.startswith("lost: ") for notice in bench.notices)
    assert bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.server.restart()
    bench.run(8.0)
    bench.command(0.3, 0.0, 2.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("motion", [(0.3, 0.0), (-0.2, 0.0), (0.0, 0.5)])
def test_the_stop_port_is_used_a_network_delay_after_the_last_stop(
    motion: tuple[float, float],
) -> None:
    """Right behind SM or SRM it would race with them, and hang a port."""
    bench = MartBench("firmware").ready()
    bench.command(*motion, 2.5)
    bench.server.imu.alive = False
    bench.command(*motion, 6.0)
    received = bench.server.received
    first_s = min(at_s for at_s, port, _ in received if port == 1)
    stops = [at_s for at_s, _, data in received if data in (b"SM", b"SRM") and at_s <= first_s]
    assert first_s - max(stops) > 0.3
    assert {port for _, port, _ in received} == {0, 1}


def test_an_obstacle_ends_the_way_forward_and_leaves_the_others() -> None:
    """The controller stops by itself, and says nothing until it is asked."""
    bench = MartBench(front_m=1.4).ready()
    bench.command(0.3, 0.0, 6.0)
    assert bench.robot.stands
    assert not bench.server.hit_wall
    assert any("obstacle in front" in notice for notice in bench.notices)
    bench.command(-0.2, 0.0, 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("bits", [4, 8, 16, 32])
def test_a_trip_or_a_short_halts_and_is_told_by_name(bits: int) -> None:
    """Until the motor board is well again."""
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.server.chassis.motor_status = bits
    bench.command(0.3, 0.0, 2.0)
    assert b"SRM" in bench.said()
    name = bench.session.figures(bench.now).board.own["Motor board"]
    assert name.startswith("motor ")
    assert name in bench.try_command(0.3, 0.0)


@pytest.mark.parametrize("stuck", ["left", "right", "both"])
def test_a_stuck_motor_is_no_motion_that_goes_on(stuck: str) -> None:
    """Whichever it is; RM may hang by it, and then the server is lost."""
    bench = MartBench(stuck=stuck).ready()
    bench.command(0.3, 0.0, 8.0)
    bench.run(3.0)
    assert bench.server.chassis.right == bench.server.chassis.left == 128
    assert bench.notices


def test_a_server_whose_rm_fails_although_it_moves_is_stopped_and_refused() -> None:
    """SRM finds no motion there; a controlled turn takes the motors over, and ends."""
    bench = MartBench(reference_start_fails=True).ready()
    bench.command(0.3, 0.0, 8.0)
    assert bench.robot.stands
    assert bench.server.chassis.way_m < 1.0
    bench.run(10.0)
    assert bench.robot.stands
    assert bench.try_command(0.3, 0.0)


def test_a_restarted_driver_stops_what_it_meets() -> None:
    """A motion by RM, and a controlled move that keeps the port silent."""
    for begun in (b"RM 30", b"B SLOW", b"L SLOW", b"TF 200", b"MCR 300"):
        bench = MartBench()
        bench.server.receive(begun, 0, None, 0.0)
        bench.run(1.0)
        assert not bench.robot.stands
        bench.open()
        bench.run(15.0)
        assert bench.session.state == "nominal"
        assert bench.robot.stands, begun


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_goals_are_turned_to_and_reached(firmware: Firmware) -> None:
    """Within 10 cm and 5 degrees; the newest authority wins."""
    bench = MartBench(firmware).ready()
    for x_m, y_m, yaw_rad in ((0.8, 0.4, 1.0), (0.0, 0.0, 0.0)):
        bench.go_to(x_m, y_m, yaw_rad)
        bench.run(28.0)
        assert math.dist((bench.truth.x_m, bench.truth.y_m), (x_m, y_m)) < 0.1
        assert abs(math.remainder(bench.truth.yaw_rad - yaw_rad, math.tau)) < math.radians(6)
    assert not any(data.startswith(b"TB") for data in bench.said())
    bench.go_to(3.0, 0.0, 0.0)
    bench.run_until(lambda: bench.server.chassis.right_mps > 0.05, 10.0)
    bench.command(0.0, 0.4, 3.0)
    assert b"SL" in bench.said()
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.4, rel=0.15)


def test_the_covariance_of_a_controlled_move_says_that_nothing_is_known() -> None:
    """Until the encoder is answered again."""
    bench = MartBench().ready()
    bench.go_to(1.5, 0.0, 0.0)
    bench.run_until(lambda: bench.server.chassis.x_m > 0.6, 15.0)
    guess = bench.odometry[-1]
    assert guess.covariance.xx > (guess.pose.x_m - bench.truth.x_m) ** 2
    bench.run(15.0)
    assert bench.odometry[-1].covariance.xx < 0.01
    assert bench.error.way_m < 0.05


def test_odometry_is_told_twenty_times_a_second_and_sonars_only_while_still() -> None:
    """The rest at a slower pace."""
    bench = MartBench(front_m=3.0).ready()
    seen = len(bench.odometry)
    bench.run(2.0)
    assert len(bench.odometry) - seen == pytest.approx(40, abs=2)
    front = [sonar for sonar in bench.extras(SonarReading) if sonar.side == "front"]
    assert front[-1].distance_m == pytest.approx(3.0, abs=0.03)
    assert math.isinf(
        [sonar for sonar in bench.extras(SonarReading) if sonar.side == "rear"][-1].distance_m
    )
    assert bench.extras(BatteryReading)[-1].volts == pytest.approx(24.0, abs=0.01)
    assert bench.extras(DockedReading)[-1] == DockedReading(False)
    bench.command(0.3, 0.0, 1.5)
    before = len(bench.extras(SonarReading))
    bench.command(0.3, 0.0, 1.5)
    assert len(bench.extras(SonarReading)) == before


def test_inverted_encoder_and_gyro_are_parameters() -> None:
    """Forward counts down."""
    settings = MartSettings(metres_per_count=-0.0004)
    bench = MartBench("source", settings=settings, encoder_sign=-1).ready()
    bench.command(0.3, 0.2, 3.0)
    bench.run(2.0)
    assert bench.error.way_m < 0.02


@pytest.mark.parametrize("wish", ["forward", "backward", "left", "goal ahead", "goal aside"])
def test_a_driver_that_is_killed_at_any_moment_is_followed_by_a_guard_that_stops_the_robot(
    wish: str,
) -> None:
    """In every state: the guard repeats the words it had before the last datagram, for a second."""
    twists = {"forward": (0.3, 0.2), "backward": (-0.2, 0.0), "left": (0.0, 0.5)}
    seen = set()
    for tenths in [*range(2, 16), 25, 40]:
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
