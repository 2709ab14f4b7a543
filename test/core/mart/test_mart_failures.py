# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of failures, such as a dead IMU, an obstacle or a stuck motor: the robot is stopped."""

import pytest
from honesty import nees
from mart_bench import MartBench
from mart_campaign import FIRMWARES

from omnibot_driver.core.mart import MartSettings
from omnibot_driver.simulator.mart import Firmware, Kind
from omnibot_driver.simulator.mart.settings import Stuck

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("wish", [(0.3, 0.0), (0.0, 0.5), "goal"])
def test_a_dead_imu_refuses_motion_until_it_is_back(
    firmware: Firmware, wish: tuple[float, float] | str
) -> None:
    """The IMU is dead. The driver starts no motor, and reports the reason.

    When the IMU works again, motion is allowed if the server has the command RST IMU.
    """
    bench = MartBench(firmware).ready()
    bench.server.imu.alive = False
    if isinstance(wish, str):
        bench.go_to(0.5, 0.5, 0.0)
        bench.run(3.0)
    else:
        bench.command(*wish, 3.0)
    assert bench.server.chassis.way_m == 0.0
    assert bench.server.chassis.yaw_rad == 0.0
    assert b"RM" not in {data.split()[0] for data in bench.said()}
    assert any("IMU" in notice for notice in bench.notices)
    assert "IMU" in bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.run(1.5)
    bench.command(0.3, 0.0, 2.0)
    assert bench.robot.stands is (firmware == "documented")


def test_one_failed_reset_of_the_imu_is_not_a_dead_imu() -> None:
    """RST IMU fails once, and the driver repeats it. Only a third failure would mean a dead IMU."""
    bench = MartBench("source").ready()
    bench.server.imu.alive = False
    bench.try_command(0.3, 0.0)
    bench.run_until(lambda: bench.server.imu.closed, 2.0)
    bench.run_until(lambda: not bench.server.busy, 2.0)
    bench.server.imu.alive = True
    bench.command(0.3, 0.0, 1.5)
    assert not bench.robot.stands
    assert bench.notices == []


def test_an_rm_that_fails_once_after_a_slow_stop_is_tried_again() -> None:
    """After a stop that took 0.56 s to 0.6 s, the server rejects the next forward drive (RM).

    The driver sends RM again.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed" in notice for notice in bench.notices)
    assert bench.board.refusal == ""
    assert not bench.robot.stands


def test_a_drive_whose_rm_has_failed_once_is_as_fast_as_commanded_two_seconds_after_its_step() -> (
    None
):
    """The server rejects the start of a forward drive. The driver soon sends the start again.

    Two seconds after the command, the speed is right.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.0, 3.0)
    bench.command(0.0, 0.0, 1.0)
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 2.0)
    assert any("RM failed" in notice for notice in bench.notices)
    from_m = bench.server.chassis.x_m
    bench.command(0.3, 0.0, 2.0)
    assert bench.server.chassis.x_m - from_m == pytest.approx(0.6, rel=0.05)


def test_an_rm_that_failed_before_a_good_one_does_not_make_a_push_a_defect() -> None:
    """The robot moves without a command. The driver does not take this for a defect of the server.

    A defective server rejects a forward drive (RM), and moves the robot nevertheless. Here, the
    server rejected an RM some time ago, but it has obeyed another RM since then. So the driver
    still allows motion.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 1.4)
    assert not bench.robot.stands
    bench.command(0.0, 0.0, 1.0)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(3.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.board.refusal == ""


def test_a_slow_drive_that_is_blocked_teaches_nothing_about_the_motors() -> None:
    """Something holds both wheels in a slow drive. The driver learns nothing about the motors.

    The next slow drive is soon as fast as commanded, and not faster.
    """
    bench = MartBench("source").ready()
    bench.command(0.06, 0.0, 3.0)
    bench.server.chassis.change(stuck="both")
    bench.command(0.06, 0.0, 3.0)
    assert any("does not" in notice for notice in bench.notices)
    bench.server.chassis.change(stuck="none")
    bench.command(0.0, 0.0, 1.0)
    bench.command(0.06, 0.0, 1.0)
    assert not bench.robot.stands
    for _ in range(20):
        bench.command(0.06, 0.0, 0.1)
        assert bench.robot.board.facts["speed_mps"] == pytest.approx(0.06, abs=0.015)


def test_an_rm_that_fails_by_the_obstacle_of_the_last_b_is_tried_again() -> None:
    """The server rejects a forward drive (RM), and gives an old error as the reason.

    The old error is an obstacle that ended a backward drive. The front sonar shows no obstacle, so
    the driver repeats RM.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.LINEAR].error = "insufficent clearence"
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 4.0)
    assert any("RM failed (insufficent clearence)" in notice for notice in bench.notices)
    assert not any("obstacle in front" in notice for notice in bench.notices)
    assert not bench.robot.stands


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
    """The IMU dies in a motion. The driver stops the robot, and reports that the server is lost.

    It refuses motion until the server is restarted. The server variant "source" reports headings
    only in forward drives, so this variant is tested with forward drives only.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    assert not bench.robot.stands
    bench.server.imu.alive = False
    bench.command(*motion, 1.2)
    assert bench.robot.stands
    bench.run(6.0)
    assert any("heading does not change" in notice for notice in bench.notices)
    assert any(notice.startswith("server lost: ") for notice in bench.notices)
    assert bench.try_command(0.3, 0.0)
    bench.server.imu.alive = True
    bench.server.restart()
    bench.run(8.0)
    bench.command(0.3, 0.0, 2.0)
    assert not bench.robot.stands


def test_an_obstacle_ends_the_way_forward_and_leaves_the_others() -> None:
    """The controller stops the robot at an obstacle, but does not report this.

    The driver reports the obstacle, and still allows driving backward.
    """
    bench = MartBench(front_m=1.4).ready()
    bench.command(0.3, 0.0, 6.0)
    assert bench.robot.stands
    assert not bench.server.hit_wall
    assert any("obstacle in front" in notice for notice in bench.notices)
    bench.command(-0.2, 0.0, 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("bits", [4, 8, 16, 32])
def test_a_trip_or_a_short_halts_and_is_told_by_name(bits: int) -> None:
    """The motor board reports a trip or a short circuit while the robot drives.

    The driver stops the robot, names the fault and refuses motion.
    """
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.server.chassis.motor_status = bits
    bench.command(0.3, 0.0, 2.0)
    assert b"SRM" in bench.said()
    name = bench.session.figures(bench.now).board.own["Motor board"]
    assert name.startswith("motor ")
    assert name in bench.try_command(0.3, 0.0)


@pytest.mark.parametrize(
    ("driving", "stuck", "firmware"),
    [
        ((n + m) % 2 == 1, stuck, firmware)
        for n, stuck in enumerate(("left", "right", "both"))
        for m, firmware in enumerate(FIRMWARES)
    ],
)
def test_a_stuck_motor_is_not_a_motion_that_goes_on(
    driving: bool, stuck: Stuck, firmware: Firmware
) -> None:
    """One or both motors are stuck, so the driver switches both motors off.

    If only the right motor is stuck, the left wheel may turn the robot before the motors are off.
    The covariance of the odometry includes this turn.
    """
    bench = MartBench(firmware).ready()
    if driving:
        bench.command(0.3, 0.1, 3.0)
    bench.server.chassis.change(stuck=stuck)
    bench.command(0.3, 0.1, 5.0)
    assert bench.server.chassis.right == bench.server.chassis.left == 128
    assert any("check" in notice or "stuck" in notice for notice in bench.notices)
    stood = bench.truth
    bench.command(0.3, 0.1, 2.0)
    assert bench.truth == stood
    assert nees(bench) < 16.0
    bench.server.chassis.change(stuck="none")
    bench.command(0.0, 0.0, 1.0)
    bench.command(0.3, 0.1, 2.0)
    assert not bench.robot.stands


def test_a_server_whose_rm_fails_although_it_moves_is_stopped_and_refused() -> None:
    """The server rejects a forward drive (RM), but the robot moves.

    The driver sends a stop. The server does not obey it, because it knows of no motion. So the
    driver switches the motors off, and then refuses motion.
    """
    bench = MartBench(reference_start_fails=True).ready()
    bench.command(0.3, 0.0, 8.0)
    assert bench.robot.stands
    assert bench.server.chassis.way_m < 1.0
    bench.run(10.0)
    assert bench.robot.stands
    assert bench.try_command(0.3, 0.0)


def test_a_push_long_after_an_rm_that_failed_is_not_a_defect_of_the_server() -> None:
    """The server rejects a forward drive (RM). Five seconds later, a person pushes the robot.

    The driver does not regard the server as defective. A defective server would reject RM, and move
    the robot at once. Here the robot moves much later, so the driver still allows motion.
    """
    bench = MartBench("source").ready()
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 0.3)
    bench.command(0.0, 0.0, 5.0)
    assert any("RM failed" in notice for notice in bench.notices)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.run(5.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.try_command(0.3, 0.0) == ""
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


def test_a_copy_of_a_start_on_a_network_that_loses_replies_is_not_a_defect_of_the_server() -> None:
    """The server rejects a forward drive (RM). Later, it obeys a late copy of this RM.

    At this time, the network also loses replies. The driver stops the robot. It does not regard the
    server as defective, so it does not refuse motion permanently.
    """
    bench = MartBench("source").ready()
    usual = bench.server.motions[Kind.REFERENCE].samples
    bench.server.motions[Kind.REFERENCE].samples = 58
    bench.command(0.3, 0.0, 0.3)
    bench.server.motions[Kind.REFERENCE].samples = usual
    assert any("RM failed" in notice for notice in bench.notices)
    bench.command(0.0, 0.0, 0.6)
    bench.server.receive(b"RM 30", 0, None, bench.robot.board.now_s)
    bench.speaks = False
    bench.command(0.0, 0.0, 0.2)
    bench.speaks = True
    bench.run(6.0)
    assert any("moves without a command" in notice for notice in bench.notices)
    assert bench.robot.stands
    assert bench.try_command(0.3, 0.0) == ""
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


def test_a_stop_by_another_program_is_told_as_that_and_the_robot_drives_on() -> None:
    """Another program stops the robot. The server rejects the next change of speed (RMCS).

    The driver reports that another program may be the cause, and the robot drives on.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.0, 2.0)
    bench.server.receive(b"SRM", 0, None, bench.robot.board.now_s)
    bench.command(0.2, 0.2, 1.0)
    assert any("another program has stopped the robot" in notice for notice in bench.notices)
    bench.command(0.2, 0.2, 3.0)
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_robot_that_rolls_out_after_a_failed_move_does_not_move_without_a_command(
    firmware: Firmware,
) -> None:
    """The server reports a failed move at once, while the wheels still coast.

    The driver does not report the coasting as a motion without a command.
    """
    bench = MartBench(firmware, motor_lag_s=0.12).ready()
    bench.go_to(1.5, 0.0, 0.0)
    bench.run(2.4)
    bench.server.imu.alive = False
    bench.run(5.0)
    assert bench.robot.stands
    assert [notice for notice in bench.notices if "MPU6050 connection lost" in notice]
    assert not [notice for notice in bench.notices if "without a command" in notice]


@pytest.mark.parametrize("twist", [(0.15, 0.5), (0.05, 0.0), (0.0, 0.3), (-0.05, 0.1)])
@pytest.mark.parametrize(("dead_units", "firmware"), [(8.0, "source"), (10.0, "firmware")])
def test_motors_that_need_many_units_are_started_with_more_after_a_start_that_failed(
    twist: tuple[float, float], dead_units: float, firmware: Firmware
) -> None:
    """The motors need more units to start than the driver assumes, so the first start fails.

    The next start is stronger.
    """
    bench = MartBench(firmware, dead_zone_units=dead_units).ready()
    bench.command(*twist, 6.0)
    assert not bench.robot.stands
    assert not any("stuck" in notice or "IMU" in notice for notice in bench.notices)
    assert len(bench.notices) <= 1


@pytest.mark.parametrize(
    ("encoder_sign", "settings", "parameter"),
    [
        (-1, MartSettings(), "encoder_inverted"),
        (1, MartSettings(heading_sign=-1), "heading_inverted"),
        (1, MartSettings(metres_per_count=0.001), "metres_per_count"),
    ],
)
def test_a_wrong_sign_or_scale_stops_the_robot_and_is_told_by_its_parameter(
    encoder_sign: int, settings: MartSettings, parameter: str
) -> None:
    """A parameter has a wrong sign or scale.

    The driver stops the robot, and a notice names the parameter.
    """
    bench = MartBench(settings=settings, encoder_sign=encoder_sign, motor_inequality=0.03).ready()
    bench.command(0.3, 0.0, 6.0)
    assert bench.robot.stands
    assert any(f"check `{parameter}`" in notice for notice in bench.notices)


def test_another_server_is_refused_by_its_name() -> None:
    """A different server answers HELLO with its own name.

    The driver refuses motion, and a notice contains this name.
    """
    bench = MartBench()
    bench.open()
    bench.run(0.5)
    for _ in range(30):
        bench.session.inbound.receive(b"ok ROVER", bench.now)
        bench.run(0.1)
    assert "ROVER" in bench.session.board.refusal
    assert any("ROVER" in notice for notice in bench.notices)


def test_nobody_answers() -> None:
    """A controller that never answers is reported once, and motion is refused."""
    bench = MartBench()
    bench.speaks = False
    bench.open()
    bench.run(12.0)
    assert bench.session.state == "connecting"
    assert sum("no data from the board" in notice for notice in bench.notices) == 1
    assert bench.try_command(0.3, 0.0)


@pytest.mark.parametrize("word", [b"ENC", b"L"])
def test_a_command_that_the_server_does_not_know_is_named_as_the_reason(word: bytes) -> None:
    """The manual lists neither ENC nor L, so a server may refuse them as not supported.

    The driver says that the server is the cause. It does not blame an obstacle or another program,
    and it is not silent.
    """
    bench = MartBench("documented")
    inner = bench.robot.receive

    def receive(data: bytes, now: float, channel: int) -> None:
        # the simulated server refuses the word "NO" as not supported
        inner(b"NO" if data.split()[0] == word else data, now, channel)

    bench.robot.receive = receive
    bench.ready()
    bench.command(0.0, 0.4, 2.0)
    assert bench.robot.stands
    said = [*bench.notices, bench.try_command(0.0, 0.4)]
    assert any("does not know the command" in each for each in said), said
    assert not any("obstacle" in each for each in said), said
