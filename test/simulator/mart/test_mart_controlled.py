# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the public server's controlled moves over a given distance or angle.

TF and TB drive straight (distance in inches), MCR and MCL turn (angle in degrees).
"""

from dataclasses import replace

import pytest
from mart_rig import INCH_M, Rig

from omnibot_driver.simulator.mart import FIRMWARE


@pytest.mark.parametrize(("text", "sign"), [("TF 12", 1), ("TB 12", -1)])
def test_ok_echoes_the_target_12_for_15_8_inches_driven(text: str, sign: int) -> None:
    """The reply to TF 12 (drive 12 inches) is "ok 12", although the robot has driven 15.8 inches.

    The server computes the distance from the time.
    """
    rig = Rig()
    assert rig.ask(text) == "ok 12"
    assert sign * rig.x_in == pytest.approx(15.8, abs=0.2)
    assert rig.ask("TD") == "ok 12"


@pytest.mark.parametrize("volts", [20.0, 26.0])
def test_it_echoes_it_at_any_voltage(volts: float) -> None:
    """At any battery voltage the reply to TF 24 (drive 24 inches) is "ok 24".

    The true distance depends on the voltage.
    """
    rig = Rig(volts=volts)
    assert rig.ask("TF 24") == "ok 24"
    assert abs(rig.x_in - 30.3) > 2


def test_tf_24_slow_runs_at_normal_speed() -> None:
    """In TF 24 SLOW (drive 24 inches), the speed word comes after the distance.

    The server ignores this word and drives at normal speed.
    """
    fast, normal, slow = Rig(), Rig(), Rig()
    assert fast.ask("TF 24 SLOW") == normal.ask("TF NORMAL 24") == "ok 24"
    assert slow.ask("TF SLOW 24") == "ok 24"
    assert fast.took_s == normal.took_s < 0.7 * slow.took_s


@pytest.mark.parametrize("text", ["TF 0", "TF x", "TF SLOW x", "TB 0", "TB NORMAL y", "TF FAST 12"])
def test_tf_0_or_a_word_is_unlimited_motion(text: str) -> None:
    """The distance of a straight move (TF or TB) is 0 or a word.

    The robot drives until it is stopped.
    """
    rig = Rig()
    assert rig.ask(text, 60.0) is None
    assert rig.moving
    rig.stop("SL")
    assert rig.wait() is not None


def test_sdr_limits_an_unlimited_move_alone() -> None:
    """A move without a distance ends after the distance that the command SDR gives.

    The distance is counted from the start of the move. A move with a distance ignores SDR.
    """
    rig = Rig()
    rig.say("TF 0")
    rig.run(1.0)
    rig.stop("SDR 24")
    assert rig.wait() == "ok 24"
    rig.say("TF 24")
    rig.run(1.0)
    rig.stop("SDR 100")
    assert rig.wait() == "ok 24"


def test_a_negative_distance_is_refused() -> None:
    """The reply to a negative distance is "fail bad distance value"."""
    assert Rig().ask("TF -5") == "fail bad distance value"
    assert Rig().ask("TB SLOW -5") == "fail bad distance value"


@pytest.mark.parametrize("text", ["TF 0", "TB 0", "MCF 0", "MCB 0", "MCF far"])
def test_a_distance_of_zero_is_refused_or_unlimited(text: str) -> None:
    """A move with the distance zero, or a word as distance, has no limit on the public server.

    Without the quirk ``zero_distance_is_unlimited``, the server rejects the move.
    """
    rig = Rig(replace(FIRMWARE, zero_distance_is_unlimited=False))
    assert rig.ask(text) == "fail bad distance value"
    rig = Rig()
    assert rig.ask(text, 30.0) is None
    assert rig.moving


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("TF", "fail command missng parameter"),
        ("TF SLOW", "fail command missng parameter"),
        ("TB", "fail command missng parameter"),
        ("MCR", "fail command missing parameter"),
        ("MCL SLOW", "fail command missing parameter"),
    ],
)
def test_a_distance_that_is_missing_is_told(text: str, answer: str) -> None:
    """The server rejects a command in which the distance or the angle is missing.

    Its reply says "missing parameter", but "missing" is misspelt in the replies to TF and TB.
    """
    assert Rig().ask(text) == answer


@pytest.mark.parametrize(("front_in", "driven_in"), [(15.0, 0.3), (17.0, 0.3)])
def test_near_an_obstacle_tf_fails_after_0_6_s_and_0_3_inches(
    front_in: float, driven_in: float
) -> None:
    """A straight move (TF) begins near an obstacle, and fails after about 0.6 s.

    The robot moves 0.3 inches before the server reads the front sonar.
    """
    rig = Rig(front_m=front_in * INCH_M)
    assert rig.ask("TF 24") == "fail Insufficient front clearance."
    assert rig.took_s == pytest.approx(0.55, abs=0.06)
    assert rig.x_in == pytest.approx(driven_in, abs=0.15)


def test_near_an_obstacle_tb_fails_likewise() -> None:
    """A straight move backward (TB) fails if an obstacle is behind the robot at its start.

    The server notices the obstacle by the rear sonar.
    """
    rig = Rig(rear_m=12 * INCH_M)
    assert rig.ask("TB 24") == "fail Insufficient rear clearance."


@pytest.mark.parametrize("text", ["TF SLOW NCC 30", "TF DOCK 30"])
def test_ncc_and_dock_see_no_obstacle(text: str) -> None:
    """The words NCC and DOCK in a straight move (TF) switch the obstacle check off.

    The robot hits the wall.
    """
    rig = Rig(front_m=20 * INCH_M)
    assert rig.ask(text, 60.0) == "ok 30"
    assert rig.server.hit_wall


def test_tf_dock_stops_at_the_dock() -> None:
    """A docking move (TF DOCK) ends at the dock.

    The distance in its reply is computed from the time, not measured.
    """
    rig = Rig(dock_m=20 * INCH_M)
    assert rig.ask("DOCKED") == "ok false"
    answer = rig.ask("TF DOCK 60", 60.0)
    assert answer is not None
    assert 8 < int(answer.split()[1]) < 20
    assert rig.x_in == pytest.approx(20.5, abs=0.8)
    assert rig.ask("DOCKED") == "ok true"


def test_tfsfc_sets_the_clearance_of_the_next_tf_alone() -> None:
    """TFSFC sets the obstacle clearance of the next straight move (TF) only.

    For the move after that, the clearance is 19 inches again.
    """
    rig = Rig(front_m=60 * INCH_M)
    assert rig.ask("TFSFC 40") == "ok"
    assert rig.ask("TF 60") == "fail Insufficient front clearance."
    assert rig.x_in == pytest.approx(21, abs=2)
    assert rig.ask("TF 60") == "fail Insufficient front clearance."
    assert rig.x_in == pytest.approx(43, abs=2)


def test_tf_holds_its_course_with_unequal_motors() -> None:
    """The motors are unequal. The controlled move TF corrects its course by the gyro.

    The uncontrolled drive F does not correct its course.
    """
    rig = Rig(motor_inequality=0.05)
    assert rig.ask("TF 80", 60.0) == "ok 80"
    assert abs(rig.yaw_deg) < 4
    free = Rig(motor_inequality=0.05)
    free.drive("F", rig.took_s)
    assert abs(free.yaw_deg) > 15


def test_a_wheel_that_stops_turns_tf_away_until_it_gives_up() -> None:
    """One wheel stops during a straight move (TF), and the robot turns away.

    The move ends with "fail excessive gyro correct".
    """
    rig = Rig()
    rig.say("TF 80")
    rig.run(1.0)
    rig.server.chassis.change(stuck="left")
    assert rig.wait() == "fail excessive gyro correct"


@pytest.mark.parametrize(("text", "sign"), [("MCR 90", -1), ("MCL 90", 1), ("MCL SLOW 90", 1)])
def test_mcr_turns_right_and_mcl_left(text: str, sign: int) -> None:
    """MCR turns right and MCL left. The manual describes MCL differently."""
    rig = Rig()
    assert rig.ask(text) == "ok"
    assert sign * rig.yaw_deg == pytest.approx(93, abs=5)


def test_mcr_normal_90_parses_as_0() -> None:
    """The server reads the request MCR NORMAL 90 as a turn by 0 degrees.

    It answers ok without turning the robot.
    """
    rig = Rig()
    assert rig.ask("MCR NORMAL 90") == "ok"
    assert rig.took_s == pytest.approx(0.5, abs=0.05)
    assert rig.yaw_deg == 0.0


def test_less_than_10_degrees_are_turned_slowly() -> None:
    """A turn of less than 10 degrees is slow, even if the command does not have SLOW."""
    rig, slow = Rig(), Rig()
    rig.ask("MCR 9")
    slow.ask("MCR SLOW 9")
    assert rig.yaw_deg == slow.yaw_deg < 0


@pytest.mark.parametrize("text", ["PTF 12 4 0.05 10", "PTF SLOW 12 4 0 10", "MCF 12", "MCB 12"])
def test_undocumented_moves_answer_ok(text: str) -> None:
    """The server answers undocumented moves with ok, without a distance."""
    rig = Rig()
    assert rig.ask(text) == "ok"
    assert abs(rig.x_in) > 8


def test_the_port_is_silent_during_a_controlled_move() -> None:
    """The straight move TF SLOW 80 takes 20 s.

    Requests that come in this time are answered afterwards.
    """
    rig = Rig()
    rig.say("TF SLOW 80", "ENC", "RMRA")
    assert rig.run(15.0) == []
    assert len(rig.run(10.0)) == 3
