# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the public server when its IMU does not respond."""

import pytest
from mart_rig import INCH_M, Rig

LOST = "fail MPU6050 connection lost"


@pytest.mark.parametrize("text", ["F", "B", "TF 24", "TB 24", "SB"])
def test_with_a_dead_imu_it_never_answers_and_does_not_move(text: str) -> None:
    """The IMU is dead, and a request that needs it comes.

    The server answers neither this request nor any later one.
    """
    rig = Rig(imu_dies_s=0.0)
    rig.say(text, "HELLO", "SM")
    rig.stop("SL")
    assert rig.run(120.0) == []
    assert rig.server.blocked
    assert not rig.server.hung
    assert rig.server.chassis.way_m == 0.0


@pytest.mark.parametrize("text", ["F", "B", "TF 24", "TB 24"])
def test_a_move_that_the_host_has_given_up_starts_when_the_imu_comes_back(text: str) -> None:
    """A move requested while the IMU is dead starts minutes later, when the IMU works again."""
    rig = Rig(imu_dies_s=0.0, imu_returns_s=300.0)
    rig.say(text)
    rig.run(299.0)
    assert rig.server.chassis.way_m == 0.0
    assert rig.run(20.0)
    assert rig.server.chassis.way_m > 0.3


@pytest.mark.parametrize("text", ["RM 30", "R", "L"])
@pytest.mark.parametrize("stops", [("SL", "SRM", "SS"), ("SM",), ("SS", "SM"), ("SL", "SL", "SRM")])
def test_without_an_imu_rm_r_and_l_start_the_motors_and_nothing_stops_them(
    text: str, stops: tuple[str, ...]
) -> None:
    """The IMU is dead. RM (forward drive), R and L (spins) start the motors.

    The server never answers them, and no stop command works.
    """
    rig = Rig(imu_dies_s=0.0)
    rig.say(text)
    rig.run(0.5)
    for stop in stops:
        if stop in ("SL", "SS"):
            rig.stop(stop)
        else:
            rig.say(stop)
    assert rig.run(60.0) == []
    assert rig.moving
    assert rig.server.blocked


@pytest.mark.parametrize("text", ["RM 30", "R"])
def test_the_start_timeout_is_dead_without_an_imu(text: str) -> None:
    """The IMU is dead and the motors are stuck.

    The server does not notice that the motors are stuck, and keeps their power on.
    """
    rig = Rig(imu_dies_s=0.0, stuck="both")
    assert rig.ask(text) is None
    assert rig.server.chassis.powered


def test_the_obstacle_check_is_dead_without_an_imu() -> None:
    """The IMU is dead.

    The server does not check for obstacles during a forward drive (RM), and the robot hits the
    wall.
    """
    rig = Rig(imu_dies_s=0.0, front_m=50 * INCH_M)
    rig.ask("RM 30")
    assert rig.server.hit_wall


def test_rm_that_was_started_without_an_imu_is_answered_when_it_comes_back() -> None:
    """A forward drive (RM) and its stop (SRM) are commanded while the IMU is dead.

    The server answers RM and SRM when the IMU works again.
    """
    rig = Rig(imu_dies_s=0.0, imu_returns_s=30.0)
    rig.say("RM 30", "SRM")
    assert rig.run(29.0) == []
    assert rig.run(5.0) == ["ok", "ok"]
    assert not rig.moving


def test_an_imu_lost_during_rm_freezes_rmra_and_it_drives_through_obstacles() -> None:
    """The IMU dies during a forward drive (RM). The reported heading stays constant.

    Obstacles are ignored. The stop (SRM) stops the motors, but is not answered.
    """
    rig = Rig(imu_dies_s=1.0, front_m=60 * INCH_M)
    rig.drive("RM 30")
    rig.ask("RMCS 4 -4")
    frozen = rig.number("RMRA")
    rig.run(1.0)
    assert rig.number("RMRA") == frozen
    rig.run(10.0)
    assert rig.number("RMRA") == frozen
    assert rig.server.hit_wall
    assert rig.moving
    assert rig.ask("SRM") is None
    assert not rig.moving
    assert rig.server.blocked
    assert rig.ask("HELLO") is None


def test_while_it_lives_rmra_changes_all_the_time_of_a_drive() -> None:
    """While the IMU works, the reported heading (RMRA) changes throughout a drive.

    So a heading that stays constant shows that the IMU is dead.
    """
    for seed in range(8):
        rig = Rig(seed=seed)
        rig.drive("RM 30", 0.0)
        seen = [rig.number("RMRA") for _ in range(100) if rig.run(0.095) == []]
        assert all(len(set(seen[at : at + 5])) > 1 for at in range(95))


@pytest.mark.parametrize(("imu_dies_s", "answer"), [(float("inf"), "ok"), (0.0, LOST)])
def test_mcr_slow_0_proves_in_half_a_second_whether_it_lives(
    imu_dies_s: float, answer: str
) -> None:
    """A turn by 0 degrees (MCR SLOW 0) shows in 0.5 s whether the IMU works.

    The robot does not move.
    """
    rig = Rig(imu_dies_s=imu_dies_s)
    assert rig.ask("MCR SLOW 0") == answer
    assert rig.took_s == pytest.approx(0.5, abs=0.05)
    assert rig.server.chassis.way_m == rig.yaw_deg == 0.0


def test_rst_imu_proves_it_in_0_13_s() -> None:
    """RST IMU shows in 0.13 s whether the IMU works.

    While the robot moves, the server refuses RST IMU.
    """
    rig = Rig()
    assert rig.ask("RST IMU") == "ok"
    rig.server.imu.alive = False
    assert rig.ask("RST IMU") == "fail could not init"
    assert rig.took_s == pytest.approx(0.13, abs=0.01)
    rig.server.imu.alive = True
    assert rig.ask("RST IMU") == "ok"
    rig.drive("R")
    assert rig.ask("RST IMU") == "fail conflicting action in progress"


def test_an_imu_that_was_given_up_stays_dead_until_it_is_reset_or_calibrated() -> None:
    """The server has stopped using a dead IMU. Then the IMU works again.

    The server uses it again only after a successful reset (RST IMU) or calibration (SB).
    """
    for cure in ("RST IMU", "SB"):
        rig = Rig()
        rig.server.imu.alive = False
        assert rig.ask("RST IMU") == "fail could not init"
        assert rig.ask("SB") == "fail"
        rig.server.imu.alive = True
        assert rig.ask("MCR SLOW 0") == LOST
        assert rig.ask(cure) == "ok"
        assert rig.ask("MCR SLOW 0") == "ok"


def test_mcr_fails_in_half_a_second_if_it_is_dead() -> None:
    """The IMU is dead. A controlled turn (MCR) fails after half a second, and the motors stop."""
    rig = Rig(imu_dies_s=0.0)
    assert rig.ask("MCR 90") == LOST
    assert rig.took_s == pytest.approx(0.5, abs=0.05)
    rig.run(1.0)
    assert not rig.moving


@pytest.mark.parametrize("text", ["TF 200", "TB 200", "MCR 1000", "MCL 1000"])
def test_a_loss_within_a_controlled_move_fails_after_1_5_s(text: str) -> None:
    """The IMU dies during a controlled move. The move continues for 1.5 s and then fails."""
    rig = Rig(imu_dies_s=2.0)
    assert rig.ask(text) == LOST
    assert rig.took_s == pytest.approx(3.5, abs=0.05)
    rig.run(1.0)
    assert not rig.moving


@pytest.mark.parametrize("start", ["F", "R"])
def test_an_imu_lost_in_f_or_r_stops_by_sm_but_without_an_answer(start: str) -> None:
    """The IMU dies during a drive (F) or a spin (R).

    SM stops the robot, but is answered only when the IMU works again.
    """
    rig = Rig(imu_dies_s=1.0, imu_returns_s=40.0)
    rig.drive(start, 2.0)
    assert rig.ask("SM") is None
    assert not rig.moving
    assert rig.run(39.0 - rig.now) == []
    assert [answer.split()[0] for answer in rig.run(5.0)] == ["ok"]


def test_the_bias_drifts_until_sb_finds_it() -> None:
    """The gyro's bias makes the angle drift.

    The calibration (SB) measures the bias in 0.53 s, and the drift ends.
    """
    rig = Rig(gyro_bias_dps=0.5)
    rig.run(100.0)
    assert rig.number("RMRA") == pytest.approx(50.0, abs=1.0)
    assert rig.ask("SB") == "ok"
    assert rig.took_s == pytest.approx(0.53, abs=0.01)
    before = rig.number("RMRA")
    rig.run(100.0)
    assert rig.number("RMRA") == before
