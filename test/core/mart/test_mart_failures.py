# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of failures: obstacles, faulty motors, wrong parameters, other programs and servers."""

import pytest
from honesty import nees
from mart_bench import MartBench
from mart_campaign import FIRMWARES

from omnibot_driver.core.mart import MartSettings
from omnibot_driver.simulator.mart import Firmware
from omnibot_driver.simulator.mart.settings import Stuck

pytestmark = pytest.mark.slow


def test_a_slow_drive_that_is_blocked_teaches_nothing_about_the_motors() -> None:
    """Something holds both wheels in a slow drive. The driver learns nothing about the motors.

    One second after its start, the next slow drive has the commanded speed.
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
    """If one or both motors are stuck, the driver switches both motors off.

    If only the right motor is stuck, the left wheel may turn the robot before the motors are off.
    The covariance covers this turn.
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


def test_a_stop_by_another_program_is_told_as_that_and_the_robot_drives_on() -> None:
    """Another program stops the robot. The server rejects the next change of speed (RMCS).

    The driver names another program as a possible cause, and starts the robot again.
    """
    bench = MartBench("source").ready()
    bench.command(0.3, 0.0, 2.0)
    bench.server.receive(b"SRM", 0, None, bench.robot.board.now_s)
    bench.command(0.2, 0.2, 1.0)
    assert any("another program has stopped the robot" in notice for notice in bench.notices)
    bench.command(0.2, 0.2, 3.0)
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize(
    ("encoder_sign", "settings", "parameter"),
    [
        (-1, MartSettings(), "encoder_inverted"),
        (1, MartSettings(heading_scale=-1), "heading_inverted"),
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


@pytest.mark.parametrize(
    ("encoder_sign", "settings"), [(-1, MartSettings()), (1, MartSettings(heading_scale=-1))]
)
def test_opposite_angles_of_gyro_and_wheel_are_told_by_the_parameters_that_invert_them(
    encoder_sign: int, settings: MartSettings
) -> None:
    """The encoder or the heading has a wrong sign, so the two show opposite angles of a turn.

    The driver's notice names ``heading_inverted`` and ``encoder_inverted``, not a stuck wheel.
    """
    bench = MartBench("source", settings=settings, encoder_sign=encoder_sign).ready()
    bench.command(0.0, 0.5, 3.0)
    bench.run(3.0)
    told = [notice for notice in bench.notices if "has measured a turn of" in notice]
    assert told
    for notice in told:
        assert "check `heading_inverted` and `encoder_inverted`" in notice
        assert "stuck" not in notice


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
    """The server does not know ENC or L, so the robot does not turn.

    The driver reports the unknown command, and does not suspect an obstacle.
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


def translate(bench: MartBench, texts: dict[bytes, bytes]) -> None:
    """Make the server of ``bench`` replace its texts. ``texts``: the new text for each old one."""
    advance = bench.robot.advance
    bench.robot.advance = lambda: [  # type: ignore[method-assign]
        (channel, texts.get(data, data)) for channel, data in advance()
    ]


@pytest.mark.parametrize("text", ["fail command not supported", "fail", "fail no motion"])
def test_a_server_with_an_unknown_answer_to_a_stop_is_named(text: str) -> None:
    """The server answers a stop by an unexpected text.

    The driver stays ``connecting``, because the robot may be moving, and one notice quotes the
    answer.
    """
    bench = MartBench()
    translate(bench, {b"fail no motion in progress": text.encode()})
    bench.open()
    bench.run(10.0)
    assert bench.session.state == "connecting"
    assert sum(f"a stop by '{text}'," in each for each in bench.notices) == 1
