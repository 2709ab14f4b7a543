# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the driver with the simulated controller: motions, their starts, and odometry."""

import math
import re

import pytest
from mart_bench import MartBench, steer_along

from omnibot_driver.core.mart import MartSettings
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import BatteryReading, DockedReading, SonarReading
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("left", "firmware"), [(True, "source"), (False, "firmware")])
def test_a_square_of_two_metres_ends_where_it_began(left: bool, firmware: Firmware) -> None:
    """The robot drives a square and returns to within 10 cm of its start.

    The odometry's error is below 6 cm.
    """
    bench = MartBench(firmware, motor_inequality=0.05).ready()
    side = 2.0 if left else -2.0
    steer_along(bench, [(2.0, 0.0), (2.0, side), (0.0, side), (0.0, 0.0)])
    bench.run(2.0)
    assert bench.truth.way_m < 0.1
    assert bench.error.way_m < 0.06
    assert bench.server.chassis.way_m > 7.5


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_quiet_gyro_on_a_straight_way_is_not_a_dead_imu(firmware: Firmware) -> None:
    """On a straight drive with a gyro without noise, the driver does not report a failed IMU.

    The driver steers a little, so that the heading changes.
    """
    bench = MartBench(firmware, gyro_noise_dps=0.0, gyro_bias_dps=0.0).ready()
    bench.command(0.3, 0.0, 6.0)
    assert bench.notices == []
    assert bench.server.chassis.x_m > 1.4
    assert abs(bench.server.chassis.y_m) < 0.03


def test_each_motion_is_begun_and_stopped_by_its_own_words() -> None:
    """For each motion the driver sends one check of the IMU, one start and one stop.

    Before a turn on the spot, it also sends SSP, which sets the speed of the turn.
    """
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
    """A start reaches the server at most 0.2 s, plus network delays, after the end of an IMU check.

    The network is slow and loses datagrams.
    """
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


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_start_that_is_lost_after_a_turn_is_said_again(firmware: Firmware) -> None:
    """If the start of a drive after a curve is lost, the driver sends the start again.

    Meanwhile, the server reports the last heading of the curve. The odometry does not take this
    heading for a turn.
    """
    bench = MartBench(firmware, gyro_noise_dps=0.0).ready()
    bench.command(0.3, 0.4, 3.0)
    bench.run(2.0)
    inner, starts = bench.robot.receive, 0

    def receive(data: bytes, now: float, channel: int) -> None:
        nonlocal starts
        starts += data.startswith(b"RM ")
        if not (data.startswith(b"RM ") and starts == 1):
            inner(data, now, channel)

    bench.robot.receive = receive  # type: ignore[method-assign]
    bench.command(0.3, 0.0, 6.0)
    assert starts == 2
    assert not bench.robot.stands
    assert bench.error.way_m < 0.05
    assert abs(bench.error.yaw_rad) < 0.05


@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_a_heading_that_begins_where_the_last_one_ended_is_of_the_new_motion(
    rate: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first heading of a drive is used even if it equals the last heading before the drive.

    It could be an old heading, but the encoder shows that the drive has begun.
    """
    bench = MartBench("source", gyro_noise_dps=0.0).ready()
    bench.command(0.3, 0.4, 3.0)
    bench.run(2.0)
    monkeypatch.setattr(bench.server, "zero_heading", lambda: None)
    yaw_rad = bench.truth.yaw_rad
    bench.command(0.3, rate, 3.0)
    assert bench.notices == []
    assert bench.truth.yaw_rad - yaw_rad == pytest.approx(2.5 * rate, abs=0.1)
    assert bench.error.way_m < 0.05
    assert abs(bench.error.yaw_rad) < 0.05


def test_a_goal_and_a_job_show_how_far_they_are() -> None:
    """The driver shows the progress of goals and jobs in /diagnostics, under "Goal" and "Job"."""
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


def test_diagnostics_have_the_rate_of_odom() -> None:
    """The topic /diagnostics contains the rate that the user set for ``odom``.

    The report tool needs this rate.
    """
    assert MartBench(settings=MartSettings(odom_rate_hz=10.0)).board.figures.odom_hz == 10.0


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_goals_are_turned_to_and_reached(firmware: Firmware) -> None:
    """The robot reaches two goals within 10 cm and 6 degrees.

    During the drive to a third goal, a twist command replaces this goal.
    """
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
    """During a controlled move, the server does not answer, so the driver does not know the motion.

    Therefore the covariance is large. After the move it is small again.
    """
    bench = MartBench().ready()
    bench.go_to(1.5, 0.0, 0.0)
    bench.run_until(lambda: bench.server.chassis.x_m > 0.6, 15.0)
    guess = bench.odometry[-1]
    assert guess.covariance.xx > (guess.pose.x_m - bench.truth.x_m) ** 2
    bench.run(15.0)
    assert bench.odometry[-1].covariance.xx < 0.01
    assert bench.error.way_m < 0.05


def test_odometry_is_told_twenty_times_a_second_and_sonars_only_while_still() -> None:
    """The driver reports odometry 20 times a second. It queries the sonars only at rest.

    A sonar without an obstacle in range reports an infinite distance.
    """
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


def test_a_negative_scale_corrects_an_inverted_encoder() -> None:
    """The encoder of the robot counts down in forward motion.

    With a negative ``metres_per_count``, the pose is right.
    """
    settings = MartSettings(metres_per_count=-0.0004)
    bench = MartBench("source", settings=settings, encoder_sign=-1).ready()
    bench.command(0.3, 0.2, 3.0)
    bench.run(2.0)
    assert bench.error.way_m < 0.02
