# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the requests that the public server understands, and of its replies at rest."""

import pytest
from mart_rig import INCH_M, Rig

from omnibot_driver.simulator.mart import COMMAND

NOT_SUPPORTED = "fail command not supported"


@pytest.mark.parametrize(
    ("text", "answer", "seconds"),
    [
        ("HELLO", "ok BBB", 0.001),
        ("VOLTS", "ok 24.00", 0.001),
        ("MCSTAT", "ok 0", 0.005),
        ("ENC", "ok 0", 0.005),
        ("SFC", "ok -1", 0.055),
        ("SRC", "ok -1", 0.055),
        ("DOCKED", "ok false", 0.001),
        ("RMRA", "ok 0.00", 0.001),
        ("TD", "ok 0", 0.001),
        ("SB", "ok", 0.53),
        ("LOG", "ok", 0.001),
        ("LAST MOVE", "fail no file available", 0.001),
        ("LAST TURN", "fail no file available", 0.001),
        ("SM", "fail no motion", 0.001),
        ("SRM", "fail no motion in progress", 0.001),
        ("RMCS 1 1", "fail no motion in progress", 0.001),
        ("CS 1 1", "fail", 0.001),
        ("TIME 7 4 2024 12 30 15", "ok", 0.001),
    ],
)
def test_a_question_is_answered_in_its_time(text: str, answer: str, seconds: float) -> None:
    """The robot is at rest. The server answers the request with ``answer`` after ``seconds``."""
    rig = Rig(gyro_bias_dps=0.0)
    assert rig.ask(text) == answer
    assert rig.took_s == pytest.approx(seconds, abs=0.001)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "HELLO\n",
            "hello",
            "HELLO ",
            "sm",
            "volts",
            "F FASTER",
            "B 3",
            "R FAST",
            "L FAST",
            "FOO",
        ),
        *(
            "X",
            "RM",
            "RMCS",
            "CS",
            "TIME",
            "LOGS",
            "RST",
            "EXI",
            "SMX",
            "LAST",
            " HELLO",
            "SL",
            "SS",
        ),
    ],
)
def test_what_is_not_a_command_is_refused(text: str) -> None:
    """The server refuses unknown words, and commands in lower case or with a line feed."""
    rig = Rig()
    assert rig.ask(text) == NOT_SUPPORTED
    assert not rig.moving


@pytest.mark.parametrize("text", ["RMCS 5", "RMCS x"])
def test_rmcs_with_one_number_is_refused(text: str) -> None:
    """The server refuses a change of speed (RMCS) with one number instead of two."""
    rig = Rig()
    rig.drive("RM 30")
    assert rig.ask(text) == "fail improper command format"


def test_only_49_bytes_are_taken_of_a_request() -> None:
    """A request is longer than 49 bytes. The server ignores all bytes after the 49th."""
    rig = Rig()
    assert rig.ask("TIME 7 4 2024 12 30 0" + " " * 40 + "7") == "ok"
    assert rig.ask("TIME 7 4 2024 12 30 0" + " " * 28 + "7") == "ok"  # the 50th byte
    assert rig.ask("HELLO" + "\0" * 60) == "ok BBB"
    assert rig.ask("HELLO" + "x" * 60) == NOT_SUPPORTED


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("TIME 7 4 2024 12 30", None),
        ("TIME 7", None),
        ("CS 5", "F"),
        ("CS x", "F"),
        ("SFR", None),
        ("SRR", None),
        ("MCS 100", None),
    ],
)
def test_a_command_with_fewer_numbers_crashes_the_server(text: str, start: str | None) -> None:
    """A command has too few numbers. The server crashes, and the motors keep their speed."""
    rig = Rig()
    if start:
        rig.drive(start)
    assert rig.ask(text) is None
    assert rig.server.crashed
    assert rig.ask("HELLO") is None
    rig.stop("SL")
    rig.run(5.0)
    assert rig.moving is bool(start)


def test_cs_with_one_number_does_no_harm_while_still() -> None:
    """At rest, the server refuses CS (new speeds) with one number instead of two, without a crash.

    During a forward drive (F) or a backward drive (B), the same command crashes the server.
    """
    assert Rig().ask("CS 5") == "fail"


def test_an_empty_datagram_ends_the_server() -> None:
    """An empty datagram ends the server only if it comes to the command port."""
    rig = Rig()
    rig.stop("")
    assert rig.ask("HELLO") == "ok BBB"
    rig.drive("RM 30")
    rig.say("")
    assert rig.server.crashed
    assert rig.ask("HELLO") is None
    assert rig.moving


def test_a_server_that_was_started_again_meets_a_moving_robot() -> None:
    """A restarted server knows of no motion, so the stop SRM fails and the robot moves on.

    Only a power cycle of the controller stops the motors.
    """
    rig = Rig()
    rig.drive("RM 30")
    rig.say("")
    rig.server.restart()
    rig.run(1.0)
    assert rig.ask("HELLO") == "ok BBB"
    assert rig.ask("SRM") == "fail no motion in progress"
    assert rig.moving
    rig.server.power_cycle(boot_s=2.0)
    assert not rig.moving
    rig.run(1.0)
    assert rig.ask("HELLO", 5.0) is None
    assert rig.ask("HELLO") == "ok BBB"


@pytest.mark.parametrize(
    ("inches", "seen"), [(100.7, 100), (254.5, 254), (255.5, -1), (300, -1), (0.5, -1)]
)
def test_sonars_tell_whole_inches_and_above_254_give_minus_1(inches: float, seen: int) -> None:
    """Both sonars report whole inches, and -1 below 1 inch and above 254 inches."""
    rig = Rig(front_m=inches * INCH_M, rear_m=inches * INCH_M)
    assert rig.number("SFC") == seen
    assert rig.number("SRC") == seen


def test_a_sonar_measures_three_times_what_is_near() -> None:
    """A sonar measures three times, and replies later, if an obstacle is within the sonar's limit.

    The front sonar reads 19 inches, which is its limit. The rear sonar reads 16 inches and measures
    once, because its limit is 15.
    """
    rig = Rig(front_m=19.5 * INCH_M, rear_m=16.5 * INCH_M)
    assert rig.ask("SFC") == "ok 19"
    assert rig.took_s == pytest.approx(0.165)
    assert rig.ask("SRC") == "ok 16"
    assert rig.took_s == pytest.approx(0.055)


def test_sonars_turn_with_the_robot() -> None:
    """The robot makes half a turn. Each sonar then measures what the other one measured before."""
    rig = Rig(front_m=100 * INCH_M, rear_m=40 * INCH_M)
    rig.ask("MCL 174")
    assert rig.yaw_deg == pytest.approx(178, abs=5)
    assert rig.number("SFC") == pytest.approx(40, abs=2)
    assert rig.number("SRC") == pytest.approx(100, abs=2)


@pytest.mark.parametrize(
    ("changes", "bits"),
    [
        ({"volts": 31.0}, 64),
        ({"volts": 15.0}, 128),
        ({"motor_status": 4}, 4),
        ({"motor_status": 8 | 32, "volts": 15.0}, 168),
    ],
)
def test_mcstat_tells_by_bits_what_is_wrong_with_the_motor_board(
    changes: dict[str, float], bits: int
) -> None:
    """The status of the motor board (MCSTAT) has a bit for each fault.

    4 and 8: a motor has tripped. 16 and 32: short circuit. 64: more than 30 V. 128: less than 16 V.
    """
    rig = Rig()
    rig.server.chassis.change(**changes)  # type: ignore[arg-type]
    assert rig.number("MCSTAT") == bits


def test_a_motor_that_tripped_does_not_turn() -> None:
    """The left motor has tripped, so it does not turn during a drive. The right motor turns."""
    rig = Rig(motor_status=8)
    rig.drive("RM 30")
    assert rig.server.chassis.left_mps == 0.0 < rig.server.chassis.right_mps


def test_a_silent_motor_board_fails_enc_after_0_2_s_and_mcstat_tells_255() -> None:
    """The motor board does not answer the server. No motor obeys.

    The encoder query (ENC) fails after 0.2 s, and the status (MCSTAT) is 255.
    """
    rig = Rig(motor_board_silent=True)
    assert rig.ask("ENC") == "fail"
    assert rig.took_s == pytest.approx(0.2)
    assert rig.ask("MCSTAT") == "ok 255"
    assert rig.took_s == pytest.approx(0.2)
    assert rig.ask("F") == "fail start timedout"
    assert rig.server.chassis.way_m == 0.0


def test_an_unknown_reset_repeats_the_previous_reply() -> None:
    """A reset (RST) with an unknown word makes the server repeat its previous reply.

    RST MC, the reset of the motor board, succeeds.
    """
    rig = Rig()
    assert rig.ask("RST x") is None
    assert rig.ask("RST MC") == "ok"
    assert rig.ask("HELLO") == rig.ask("RST x") == rig.ask("RST imu") == "ok BBB"


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("TFSFC 30", "ok"),
        ("MNLV", "fail"),
        ("MD", "ok 0"),
        ("MCD", "ok 0"),
        ("MSM", "ok"),
        ("MFC 30", "ok"),
        ("SLMP 5 40", "ok"),
        ("SLMP 5", "fail command missng parameter"),
        ("SLPP 1 2 3", "ok"),
        ("SSP 5 40", "ok"),
        ("SSP 5", "fail command missing parameter"),
        ("SFR 1", "ok"),
        ("SRR 1", "ok"),
        ("SSR", "ok"),
        ("SMCST", "ok"),
        ("STPMCST", "ok"),
        ("LAST IMU RCD", "fail no file available"),
    ],
)
def test_undocumented_commands_are_known(text: str, answer: str) -> None:
    """The server understands undocumented commands. The test sends some that start no motor."""
    rig = Rig()
    assert rig.ask(text) == answer
    assert not rig.server.chassis.powered


def test_a_record_refuses_motions_until_it_is_stopped() -> None:
    """While a recording is in progress (REC START to REC STOP), the server refuses motions."""
    rig = Rig()
    assert rig.ask("REC START") == "ok"
    assert rig.ask("F") == "fail conflicting action in progress"
    assert rig.ask("REC STOP") == "ok"
    assert rig.ask("F") == "ok"


def test_parameters_that_are_set_change_the_next_f_and_r_custom() -> None:
    """SLMP sets the speed of the drive F until the next stop (SM).

    SSP sets the speed of the spin R CUSTOM.
    """
    rig = Rig()
    rig.ask("SLMP 5 50")
    rig.drive("F")
    assert rig.server.chassis.right == 78
    rig.ask("SM")
    rig.drive("F")
    assert rig.server.chassis.right == 98
    rig.ask("SM")
    rig.ask("SSP 5 40")
    rig.drive("R CUSTOM")
    assert rig.server.chassis.right == 168


def test_a_reply_goes_to_the_sender_of_its_request() -> None:
    """Two hosts send requests one after the other. Each host gets the reply to its own request."""
    rig = Rig()
    rig.server.receive(b"SFC", COMMAND, "one", 0.0)
    rig.server.receive(b"VOLTS", COMMAND, "other", 0.01)
    replies = rig.server.advance(1.0)
    assert [(reply.sender, reply.data) for reply in replies] == [
        ("one", b"ok -1"),
        ("other", b"ok 24.00"),
    ]


def test_time_sets_the_clock_in_utc_and_ignores_seconds() -> None:
    """TIME sets the clock for file names and dates, in UTC. The server ignores the seconds."""
    rig = Rig()
    rig.ask("TIME 7 4 2024 12 30 59")
    assert rig.server.clock_s == pytest.approx(1_720_096_200, abs=0.01)
    rig.ask("MCR SLOW 0")
    rig.say("LAST TURN")
    assert rig.run(0.1)[0].startswith("ok MCSpinSensorData1720096200.csv ")
    assert rig.server.date.startswith("07/04/2024  12:30:0")
