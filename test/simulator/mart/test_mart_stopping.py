# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of stops on the public server: what each stop ends, and which sequences hang the server.

F, B and RM are drives, R and L spins. SM and SRM are stops on the command port, SL and SS on the
stop port, on which the server never replies.
"""

import pytest
from mart_rig import Rig

from omnibot_driver.simulator.mart import Kind

CONFLICT = "fail conflicting action in progress"


@pytest.mark.parametrize("start", ["F", "F SLOW", "F FAST", "B", "B SLOW", "B FAST", "B NORMAL"])
def test_sm_ends_f_and_b_on_the_command_port_in_0_4_s(start: str) -> None:
    """SM ends the drives F and B in about 0.4 s. The robot is at rest when the reply comes."""
    rig = Rig()
    rig.drive(start)
    assert rig.moving
    assert rig.ask("SM") == "ok"
    usual_s = 0.56 if "FAST" in start else 0.34 if "SLOW" in start else 0.4
    assert rig.took_s == pytest.approx(usual_s, abs=0.03)
    assert not rig.moving
    assert rig.ask("SM") == "fail no motion"


@pytest.mark.parametrize("speed", [45, 50, 60])
def test_srm_ends_rm_in_0_43_to_0_6_s(speed: int) -> None:
    """The command SM does not end the forward drive RM: the server answers fail. SRM ends it."""
    rig = Rig()
    rig.drive(f"RM {speed}")
    assert rig.ask("SM") == "fail no motion"
    assert rig.moving
    assert rig.ask("SRM") == "ok"
    assert 0.43 < rig.took_s < 0.6
    assert not rig.moving
    assert rig.ask("SRM") == "fail no motion in progress"


@pytest.mark.parametrize(("start", "degrees"), [("R", -1), ("L", 1), ("R SLOW", -1), ("L SLOW", 1)])
def test_sm_ends_a_spin_and_tells_signed_degrees(start: str, degrees: int) -> None:
    """The stop SM ends a spin. Its reply has the angle of the spin, negative to the right."""
    rig = Rig()
    rig.drive(start)
    answer = rig.ask("SM")
    assert answer is not None
    assert float(answer.removeprefix("ok ")) == pytest.approx(rig.yaw_deg, abs=1.5)
    assert degrees * rig.yaw_deg > 30
    assert not rig.moving


def test_ss_then_sm_ends_a_spin_too() -> None:
    """After the stop SS has ended a spin, the stop SM still reports the angle of the spin.

    SS comes on the stop port, SM on the command port.
    """
    rig = Rig()
    rig.drive("R")
    rig.stop("SS")
    rig.run(1.0)
    assert not rig.moving
    assert rig.number("SM") == pytest.approx(rig.yaw_deg, abs=1.5)
    assert rig.ask("F") == "ok"


@pytest.mark.parametrize("start", ["TF 100", "TB 100", "TF SLOW 100", "TF 0"])
def test_sl_ends_a_controlled_move_which_then_answers(start: str) -> None:
    """SL on the stop port ends a controlled move.

    The server answers the move with the computed distance. Afterwards, the command port accepts
    commands again.
    """
    rig = Rig()
    rig.say(start)
    rig.run(2.0)
    rig.stop("SL")
    answer = rig.wait(2.0)
    assert answer is not None
    ok, inches = answer.split()
    assert ok == "ok"
    assert 0 < int(inches) < abs(rig.x_in)
    assert not rig.moving
    assert rig.ask("F") == "ok"


@pytest.mark.parametrize("start", ["MCR 170", "MCL 170", "MCR SLOW 170"])
def test_ss_ends_a_controlled_spin_which_then_answers(start: str) -> None:
    """SS on the stop port ends a controlled spin before the turn is complete.

    The server still answers the spin with ok. Afterwards, the command port accepts commands again.
    """
    rig = Rig()
    rig.say(start)
    rig.run(0.8)
    rig.stop("SS")
    assert rig.wait(2.0) == "ok"
    assert abs(rig.yaw_deg) < 120
    assert not rig.moving
    assert rig.ask("R") == "ok"


@pytest.mark.parametrize("stop", ["SL", "SS"])
@pytest.mark.parametrize(("start", "end"), [("F", "SM"), ("B", "SM"), ("RM 30", "SRM")])
def test_a_stop_on_the_stop_port_then_sm_or_srm_hangs_the_command_port(
    stop: str, start: str, end: str
) -> None:
    """If SL or SS on the stop port has ended a drive, the stop SM or SRM hangs the command port."""
    rig = Rig()
    rig.drive(start)
    rig.stop(stop)
    rig.run(1.0)
    assert not rig.moving
    assert not rig.server.hung
    assert rig.ask(end) is None
    assert rig.server.hung
    assert rig.ask("HELLO") is None
    rig.stop("SL")
    rig.stop("SS")
    assert rig.ask("EXIT") is None
    assert not rig.server.crashed


@pytest.mark.parametrize("stop", ["SL", "SS"])
@pytest.mark.parametrize(("start", "end"), [("F", "SM"), ("RM 30", "SRM")])
def test_it_hangs_as_well_when_both_come_at_once(stop: str, start: str, end: str) -> None:
    """The stop port gets a stop (SL or SS), and the command port gets SM or SRM at the same time.

    The command port hangs for ever. The motors are off.
    """
    rig = Rig()
    rig.drive(start)
    rig.stop(stop)
    assert rig.ask(end) is None
    assert rig.server.hung
    assert not rig.moving


def test_sl_behind_sm_hangs_the_stop_port_instead() -> None:
    """The stop SM comes on the command port, and directly after it the stop SL on the stop port.

    The server still answers SM, but its stop port hangs.
    """
    rig = Rig()
    rig.drive("F")
    rig.say("SM")
    rig.stop("SL")
    assert rig.wait() == "ok"
    assert rig.server.stop_port_hung
    assert not rig.server.hung
    rig.say("TF 100")
    rig.run(2.0)
    rig.stop("SL")
    rig.run(2.0)
    assert rig.moving


@pytest.mark.parametrize("start", ["F", "B", "RM 30"])
def test_sl_alone_leaves_a_conflict_until_exit(start: str) -> None:
    """A motion was stopped only on the stop port (SL).

    Until a restart, the server refuses motions, but answers queries.
    """
    rig = Rig()
    rig.drive(start)
    rig.stop("SL")
    rig.run(5.0)
    for text in ("F", "B", "R", "RM 30", "TF 12", "TB 12", "MCR 20", "MCL 20", "SB"):
        assert rig.ask(text) == CONFLICT
    if start != "RM 30":
        assert rig.ask("L") == CONFLICT
    assert rig.ask("VOLTS") == "ok 24.00"
    rig.say("EXIT")
    rig.run(0.1)
    rig.server.restart()
    rig.run(1.0)
    assert rig.ask("F") == "ok"


@pytest.mark.parametrize("start", ["F", "B SLOW", "RM 30"])
@pytest.mark.parametrize("after_s", [0.001, 0.03, 0.06])
def test_sl_before_ok_is_ignored_and_the_robot_drives_on(start: str, after_s: float) -> None:
    """The server receives a stop (SL or SS) before it has replied to the start of a drive.

    The stop has no effect, and the robot drives on.
    """
    rig = Rig()
    rig.say(start)
    rig.run(after_s)
    rig.stop("SL")
    rig.stop("SS")
    assert rig.wait() == "ok"
    rig.run(3.0)
    assert rig.moving
    assert rig.ask("SRM" if start == "RM 30" else "SM") == "ok"


def test_sl_in_the_first_moments_of_a_controlled_move_does_not_end_it_at_once() -> None:
    """A stop (SL) in the first moments of a controlled move is ignored, or ends the move late.

    * After 0.03 s: the server completes the move.
    * After 0.1 s: the move ends about 0.85 s after SL.
    """
    rig = Rig()
    rig.say("TF 24")
    rig.run(0.03)
    rig.stop("SL")
    assert rig.wait() == "ok 24"
    rig = Rig()
    rig.say("TF 24")
    rig.run(0.1)
    rig.stop("SL")
    assert rig.wait() == "fail stop timedout"
    assert rig.took_s == pytest.approx(0.85, abs=0.1)
    assert rig.x_in > 3


def test_l_during_rm_is_accepted_and_hangs_the_command_port_with_the_robot_spinning() -> None:
    """The spin L is commanded during the forward drive RM.

    The robot spins, and the command port hangs, so no later request is answered.
    """
    rig = Rig()
    rig.drive("RM 30")
    assert rig.ask("L") is None
    assert rig.server.hung
    rig.say("SRM", "SM")
    before = rig.yaw_deg
    assert rig.run(5.0) == []
    assert rig.yaw_deg > before + 90


@pytest.mark.parametrize("text", ["R", "F", "B", "TF 12", "MCR 20", "RM 20", "SB", "RST IMU"])
def test_r_and_f_during_rm_are_refused_correctly(text: str) -> None:
    """During the forward drive RM, the server refuses all other motions except the spin L.

    RM continues.
    """
    rig = Rig()
    rig.drive("RM 30")
    assert rig.ask(text) == CONFLICT
    assert rig.moving
    assert rig.ask("SRM") == "ok"


@pytest.mark.parametrize("text", ["R", "L", "F", "RM 20", "TF 12", "MCR 20", "SB"])
@pytest.mark.parametrize("start", ["F", "R"])
def test_everything_is_refused_during_f_and_r(start: str, text: str) -> None:
    """During a drive (F) or a spin (R), the server refuses every motion and a calibration (SB)."""
    rig = Rig()
    rig.drive(start)
    assert rig.ask(text) == CONFLICT
    assert rig.in_progress is (Kind.LINEAR if start == "F" else Kind.SPIN)


def test_a_command_port_that_is_busy_executes_later_in_order() -> None:
    """Requests come while the command port is busy.

    They are executed later, in the order of arrival.
    """
    rig = Rig()
    rig.say("TF 12", "VOLTS", "R", "HELLO")
    assert rig.run(1.0) == []
    assert rig.run(10.0) == ["ok 12", "ok 24.00", "ok", "ok BBB"]
    assert rig.moving


def test_nothing_stops_by_itself_when_the_host_is_lost() -> None:
    """The host is lost during a motion. After 120 s the robot still moves."""
    for start in ("F", "RM 30", "R"):
        rig = Rig()
        rig.drive(start, 120.0)
        assert rig.moving


def test_the_stop_port_is_never_answered() -> None:
    """No request on the stop port is answered."""
    rig = Rig()
    for text in ("SL", "SS", "SDR 10", "HELLO", ""):
        rig.stop(text)
    assert rig.run(5.0) == []
    assert rig.ask("HELLO") == "ok BBB"


@pytest.mark.parametrize(("start", "end"), [("F", "SM"), ("RM 120", "SRM")])
def test_a_stop_that_takes_longer_than_0_75_s_is_told(start: str, end: str) -> None:
    """A stop of the drive F that takes more than 0.75 s is reported as failed.

    For the drive RM, a stop may take up to 1.88 s.
    """
    rig = Rig()
    rig.ask("SLMP 1 60")
    rig.drive(start)
    if start == "F":
        assert rig.ask(end) == "fail stop time out"
        assert rig.took_s == pytest.approx(0.75, abs=0.02)
    else:
        assert rig.ask(end) == "ok"
        assert 1.5 < rig.took_s < 1.88


@pytest.mark.parametrize("start", ["TF 0", "TF 24"])
def test_sdr_without_a_number_crashes_the_server(start: str) -> None:
    """The command SDR, which limits a move, lacks its number and comes during a controlled move.

    The server crashes, and the robot moves on.
    """
    rig = Rig()
    rig.stop("SDR")
    assert not rig.server.crashed
    rig.say(start)
    rig.run(1.0)
    rig.stop("SDR")
    assert rig.server.crashed
    rig.run(60.0)
    assert rig.moving
