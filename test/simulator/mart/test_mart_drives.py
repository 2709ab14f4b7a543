# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the public server's uncontrolled motions: F, B, RM, R and L.

F and RM drive forward, B backward; R and L turn on the spot. SM stops F, B, R and L; SRM stops RM.
"""

import pytest
from mart_rig import INCH_M, Rig

from omnibot_driver.simulator.mart import FIRMWARE, Kind


def test_rm_answers_in_71_ms() -> None:
    """The reply to RM, a forward drive, comes after 71 ms.

    The encoder shows that the wheel already turns at this time.
    """
    rig = Rig()
    assert rig.ask("RM 30") == "ok"
    assert rig.took_s == pytest.approx(0.071, abs=0.01)
    assert rig.moving


def test_f_answers_in_220_ms_and_r_in_61_ms() -> None:
    """The reply to the drive F comes after 220 ms, and the reply to the turn R after 61 ms."""
    rig = Rig()
    assert rig.ask("F") == "ok"
    assert rig.took_s == pytest.approx(0.22, abs=0.015)
    rig = Rig()
    assert rig.ask("R") == "ok"
    assert rig.took_s == pytest.approx(0.061, abs=0.01)


def test_a_build_that_answers_fail_to_rm_moves_all_the_same() -> None:
    """Some servers answer RM (drive forward) with a failure, but the robot moves.

    The stop SRM then fails. Only MCS, the direct control of the motors, stops the robot.
    """
    rig = Rig(reference_start_fails=True)
    assert rig.ask("RM 30") == "fail "
    rig.run(1.0)
    assert rig.moving
    assert rig.in_progress is None
    assert rig.ask("SRM") == "fail no motion in progress"
    assert rig.ask("RMCS 0 0") == "fail no motion in progress"
    rig.stop("SL")
    rig.run(1.0)
    assert rig.moving
    assert rig.ask("MCS 128 128") == "ok"
    rig.run(1.0)
    assert not rig.moving
    assert rig.ask("MSM") == "ok"


@pytest.mark.parametrize("change", ["1 1", "-1 -1", "5 -5", "0 1", "40 40"])
def test_rm_minus_20_drives_backward_but_any_rmcs_that_is_not_zero_stops_it(change: str) -> None:
    """RM usually drives forward. With the speed -20, it drives backward.

    The speed change RMCS 0 0 then has no effect. Any other RMCS stops the motors or drives them
    forward.
    """
    rig = Rig()
    rig.drive("RM -20")
    assert rig.x_in < -1
    assert rig.server.chassis.right == 148
    rig.ask("RMCS 0 0")
    rig.run(1.0)
    assert rig.moving
    rig.ask(f"RMCS {change}")
    rig.run(2.0)
    right, left = (int(number) for number in change.split())
    chassis = rig.server.chassis
    stops = right <= 20 and left <= 20
    assert rig.moving is not stops
    assert (chassis.right, chassis.left) == (min(148 - right, 128), min(148 - left, 128))


def test_rm_200_drives_backward_at_56() -> None:
    """RM usually drives forward. With the speed 200, it drives backward at 56 units.

    After that, even the smallest speed change (RMCS) makes the robot drive forward at full speed.
    """
    rig = Rig()
    rig.drive("RM 200")
    assert rig.server.chassis.right == 128 + 56
    assert rig.x_in < -1
    rig.ask("RMCS 1 1")
    assert (rig.server.chassis.right, rig.server.chassis.left) == (0, 0)


@pytest.mark.parametrize("speed", [1, 30, 127])
def test_rm_1_to_127_drives_forward(speed: int) -> None:
    """RM drives forward at speeds from 1 to 127. The motor register is 128 minus the speed."""
    rig = Rig()
    rig.drive(f"RM {speed}")
    assert rig.server.chassis.right == 128 - speed
    assert rig.x_in > 0


def test_a_stuck_motor_can_hang_rm() -> None:
    """After a fast drive, one motor is stuck. The next RM (a forward drive) hangs the server.

    While the server hangs, it answers no command, and the other motor turns.
    """
    rig = Rig()
    rig.drive("RM 110")
    assert rig.ask("SRM") == "ok"
    rig.server.chassis.change(stuck="right")
    assert rig.ask("RM 30") is None
    assert rig.moving
    assert rig.server.chassis.powered
    rig.say("SRM")
    rig.stop("SL")
    assert rig.run(60.0) == []
    assert rig.moving


def test_a_stuck_motor_makes_the_first_rm_fail_without_a_reason() -> None:
    """The right motor is stuck, and the drive RM fails without a reason.

    Then the drive F fails with the reason "start timedout", and so does the next RM.
    """
    rig = Rig(stuck="right")
    assert rig.ask("RM 30") == "fail "
    assert rig.took_s == pytest.approx(0.6, abs=0.03)
    assert rig.ask("F") == "fail start timedout"
    assert rig.ask("RM 30") == "fail start timedout"
    assert not rig.server.chassis.powered
    assert rig.in_progress is None


def test_rm_0_is_a_motor_that_does_not_turn() -> None:
    """A forward drive (RM) fails if its speed is zero, or too low to turn the motors."""
    assert Rig().ask("RM 0") == "fail "
    assert Rig(dead_zone_units=4.0).ask("RM 3") == "fail "
    assert Rig(dead_zone_units=4.0).ask("RM 5") == "ok"


@pytest.mark.parametrize(
    ("text", "seconds"), [("R", 0.6), ("L", 0.6), ("MCR 20", 0.6), ("F", 0.76), ("TF 12", 0.76)]
)
def test_a_stuck_motor_is_told_of(text: str, seconds: float) -> None:
    """A motor is stuck, so the start of a motion fails.

    After the failure, the motors are off, and no motion is in progress.
    """
    rig = Rig(stuck="right")
    assert rig.ask(text) == "fail start timedout"
    assert rig.took_s == pytest.approx(seconds, abs=0.02)
    rig.run(1.0)
    assert rig.in_progress is None
    assert not rig.server.chassis.powered


def test_a_stuck_left_motor_is_not_noticed() -> None:
    """The left motor is stuck.

    The server does not notice it, because only the right wheel has an encoder.
    """
    rig = Rig(stuck="left")
    rig.drive("F")
    assert rig.yaw_deg > 20


@pytest.mark.parametrize(("start", "change"), [("RM 30", "RMCS"), ("F", "CS"), ("B", "CS")])
def test_cs_and_rmcs_are_right_first_and_positive_is_more_forward(start: str, change: str) -> None:
    """CS and RMCS change the speed of the right motor (first number) and of the left motor.

    A positive number makes a motor turn more forward, also in the backward drive B.
    """
    rig = Rig()
    rig.drive(start)
    before = rig.server.chassis.copy()
    answer = rig.ask(f"{change} 5 -6")
    assert answer is not None
    assert answer.startswith("ok")
    rig.run(1.0)
    chassis = rig.server.chassis
    unit = rig.server.settings.speed_mps_per_unit
    assert chassis.right_mps - before.right_mps == pytest.approx(5 * unit, abs=0.001)
    assert chassis.left_mps - before.left_mps == pytest.approx(-6 * unit, abs=0.001)


def test_cs_5_minus_5_turns_left() -> None:
    """The speed change CS 5 -5 makes the right wheel faster, so the robot turns left."""
    rig = Rig()
    rig.drive("F")
    assert rig.ask("CS 5 -5") == "ok"
    rig.run(1.0)
    assert rig.yaw_deg > 5


@pytest.mark.parametrize(
    ("start", "change", "registers"),
    [
        ("F", "CS -100 -100", (128, 128)),
        ("B", "CS 100 100", (128, 128)),
        ("RM 30", "RMCS -100 0", (128, 98)),
        ("RM 120", "RMCS 20 0", (0, 20)),
        ("F FAST", "CS 100 60", (0, 40)),
        ("B FAST", "CS -100 -60", (255, 215)),
    ],
)
def test_cs_and_rmcs_clamp_at_stop(start: str, change: str, registers: tuple[int, int]) -> None:
    """A speed change (CS or RMCS) that would reverse a motor stops the motor instead.

    If one motor would exceed full speed, the other motor becomes slower instead.
    """
    rig = Rig()
    rig.drive(start, 0.5)
    rig.ask(change)
    assert (rig.server.chassis.right, rig.server.chassis.left) == registers


def test_rmcs_0_0_just_reads_the_angle() -> None:
    """RMCS 0 0 is a speed change by zero. It changes no speed.

    It only returns the angle, as the query RMRA does.
    """
    rig = Rig()
    rig.drive("RM 30")
    rig.ask("RMCS 4 -4")
    rig.run(1.0)
    registers = rig.server.chassis.right, rig.server.chassis.left
    assert rig.ask("RMCS 0 0") == f"ok {rig.server.imu.heading_deg:.2f}"
    assert (rig.server.chassis.right, rig.server.chassis.left) == registers


@pytest.mark.parametrize("turn", ["RMCS 4 -4", "RMCS -4 4"])
def test_rmra_is_the_angle_since_rm_and_positive_is_left(turn: str) -> None:
    """The query RMRA returns the angle since the start of RM, positive to the left."""
    rig = Rig(gyro_bias_dps=0.0)
    rig.drive("L")
    rig.ask("SM")
    before = rig.yaw_deg
    rig.drive("RM 30")
    rig.ask(turn)
    rig.run(3.0)
    assert abs(rig.yaw_deg - before) > 20
    assert rig.number("RMRA") == pytest.approx(rig.yaw_deg - before, abs=1.5)
    assert (rig.number("RMRA") > 0) is (turn == "RMCS 4 -4")


@pytest.mark.parametrize("start", ["F", "B", "RM 30", "R"])
def test_rmra_works_at_any_time(start: str) -> None:
    """The query of the angle (RMRA) is answered before the first motion, and during any motion."""
    rig = Rig()
    assert rig.number("RMRA") == 0.0
    rig.drive(start)
    if start in ("F", "B"):
        rig.ask("CS 6 -6")
    elif start == "RM 30":
        rig.ask("RMCS 6 -6")
    rig.run(1.0)
    assert rig.number("RMRA") == pytest.approx(rig.yaw_deg, abs=1.5)
    assert abs(rig.yaw_deg) > 5


def test_enc_counts_the_right_wheel_alone_and_has_a_sign() -> None:
    """The query ENC returns the count of the right wheel, with its sign, after 5 ms."""
    rig = Rig(metres_per_count=0.001)
    rig.drive("R")
    spun = rig.number("ENC")
    assert rig.took_s == pytest.approx(0.005)
    assert spun < -50
    assert spun * 0.001 == pytest.approx(rig.server.chassis.yaw_rad * 0.4 / 2, abs=0.003)
    inverted = Rig(encoder_sign=-1)
    inverted.drive("F")
    assert inverted.number("ENC") < -100


@pytest.mark.parametrize("start", ["F", "B", "RM 30", "R", "L", "TF 2", "MCR 5", "MCR 0"])
def test_enc_is_zeroed_at_each_motion_start(start: str) -> None:
    """The encoder keeps its count after a motion. The start of the next motion sets it to zero."""
    rig = Rig()
    rig.drive("F")
    rig.ask("SM")
    long = rig.number("ENC")
    assert long > 400
    assert rig.number("ENC") == long
    rig.ask(start)
    assert abs(rig.number("ENC")) < 350


@pytest.mark.parametrize(("start", "side"), [("F", "front_m"), ("B", "rear_m")])
def test_in_f_and_b_an_obstacle_stops_it_without_a_message(start: str, side: str) -> None:
    """An obstacle ends the drives F and B, but the server does not send a message about it.

    Only the reply to the stop SM reports the obstacle.
    """
    rig = Rig(**{side: 45 * INCH_M})
    rig.drive(start, 10.0)
    assert not rig.moving
    assert not rig.server.hit_wall
    assert rig.replies[1:] == []
    assert rig.in_progress is Kind.LINEAR
    assert rig.ask("SM") == "fail insufficent clearence"
    assert rig.in_progress is None


def test_an_obstacle_ends_rm_and_srm_tells() -> None:
    """An obstacle ends a forward drive (RM).

    The next speed change (RMCS) and the stop (SRM) fail with "insufficient clearance".
    """
    rig = Rig(front_m=45 * INCH_M)
    rig.drive("RM 30", 10.0)
    assert not rig.moving
    assert rig.ask("RMCS 0 0") == "fail insufficient clearance"
    assert rig.ask("SRM") == "fail insufficient clearance"
    assert not rig.server.hit_wall


def test_backward_rm_sees_no_obstacle() -> None:
    """RM with a negative speed drives backward. The server does not read the rear sonar during RM.

    So it does not notice an obstacle behind, and the robot hits the wall.
    """
    rig = Rig(rear_m=20 * INCH_M)
    rig.drive("RM -20", 6.0)
    assert rig.server.hit_wall


@pytest.mark.parametrize(("front_in", "stops"), [(19.5, False), (18.5, True)])
def test_the_front_threshold_is_19_inches(front_in: float, stops: bool) -> None:
    """A forward drive (RM) ends if the front sonar measures less than 19 inches.

    The sonar measures whole inches: for an obstacle at 18.5 inches, it reports 18.
    """
    rig = Rig(front_m=front_in * INCH_M)
    rig.drive("RM 1", 0.3)
    assert rig.server.chassis.powered is not stops


@pytest.mark.parametrize(("rear_in", "stops"), [(18.0, False), (15.5, True)])
def test_the_rear_threshold_is_15_inches(rear_in: float, stops: bool) -> None:
    """A backward drive (B) ends if the rear sonar measures less than 15 inches.

    The robot moves 2 inches before the first measurement, so an obstacle at 15.5 inches ends the
    drive.
    """
    rig = Rig(rear_m=rear_in * INCH_M)
    rig.drive("B SLOW", 0.3)
    assert rig.server.chassis.powered is not stops


@pytest.mark.parametrize("volts", [20.0, 24.0, 26.0])
@pytest.mark.parametrize("inequality", [-0.05, 0.0, 0.05])
def test_voltage_and_unequal_motors_change_the_speed_of_a_unit(
    volts: float, inequality: float
) -> None:
    """The motors have no speed regulator. So their speed is not the same for equal commands.

    It depends on the battery voltage and on the motor.
    """
    rig = Rig(volts=volts, motor_inequality=inequality)
    rig.drive("RM 40")
    chassis = rig.server.chassis
    speed = 40 * rig.server.settings.speed_mps_per_unit * volts / 24.0
    assert (chassis.right_mps + chassis.left_mps) / 2 == pytest.approx(speed, rel=0.01)
    assert chassis.left_mps / chassis.right_mps == pytest.approx(1 + inequality, rel=0.003)
    assert rig.number("VOLTS") == volts


def test_mcs_sets_registers_once_and_everything_is_refused_until_msm() -> None:
    """MCS controls the motors directly: it sets their registers, the right motor's register first.

    After MCS, the server refuses another MCS and all motions until the command MSM comes.
    """
    rig = Rig()
    assert rig.ask("MCS 100 120") == "ok"
    assert (rig.server.chassis.right, rig.server.chassis.left) == (100, 120)
    assert rig.ask("MCS 128 128") == "fail conflicting action in progress"
    assert rig.ask("F") == "fail conflicting action in progress"
    assert rig.ask("MSM") == "ok"
    rig.run(1.0)
    assert not rig.moving
    assert rig.ask("F") == "ok"


def test_the_firmware_is_what_is_played_by_default() -> None:
    """By default, the simulated controller behaves like the public server.

    The manual of the controller describes another behaviour in some points.
    """
    assert Rig().server.quirks == FIRMWARE
