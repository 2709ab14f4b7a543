# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that no motor stays on after a straight move.

The public server may leave one motor on. The driver sends MCS, which stops both motors, and then
MSM, which ends the direct control.
"""

from collections.abc import Callable
from itertools import count

import pytest
from creeping_robot import BOTH, OFF, creeping, registers
from mart_bench import MartBench
from mart_goals import drops, reach

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.replies import Fail
from omnibot_driver.core.mart.states import State
from omnibot_driver.core.mart.switch_off import SwitchOff

pytestmark = pytest.mark.slow


def nth(bench: MartBench, word: bytes, number: int) -> Callable[[bytes], bool]:
    """Return a function that is True for one datagram: the ``number``-th ``word`` from now on."""
    since = len(bench.written)
    return lambda data: data.startswith(word) and bench.said(since).count(data) == number


def test_a_motor_that_the_server_has_left_on_is_switched_off() -> None:
    """The command MCS switches off a motor that the server has left on.

    The driver then sends MSM, which ends the effect of MCS. Before this, it waits until no late
    copy of MCS can arrive.
    """
    bench = creeping()
    since, notices = len(bench.written), len(bench.notices)
    bench.run_until(lambda: registers(bench) == OFF, 0.3)
    assert bench.server.manual
    bench.run(0.25)
    assert bench.server.manual
    bench.run(0.5)
    assert bench.said(since) == BOTH
    assert registers(bench) == OFF
    assert not bench.server.manual
    assert len(bench.notices) == notices
    assert bench.error.way_m < 0.05


@pytest.mark.parametrize("word", [b"MCS", b"MSM"])
def test_a_switch_off_that_is_lost_is_sent_again(word: bytes) -> None:
    """The network loses the first MCS or MSM, the commands that switch the motors off.

    The driver repeats the command that was not answered.
    """
    bench = creeping()
    since = len(bench.written)
    lost = drops(bench.robot.network[0].to_board, nth(bench, word, 1))
    bench.run(4.0)
    assert len(lost) == 1
    assert bench.said(since).count(lost[0]) == 2
    assert registers(bench) == OFF
    assert not bench.server.manual


def test_a_switch_off_whose_reply_is_lost_is_refused_and_then_released() -> None:
    """The reply to MCS, which switches the motors off, is lost.

    The driver repeats MCS, takes the refusal for a confirmation, and sends MSM, which ends the
    direct control.
    """
    bench = creeping()
    since, notices = len(bench.written), len(bench.notices)
    drops(
        bench.robot.network[0].from_board,
        lambda data: data == b"ok" and bench.said(since) == [BOTH[0]],
    )
    bench.run(4.0)
    assert bench.said(since) == [BOTH[0], *BOTH]
    assert registers(bench) == OFF
    assert not bench.server.manual
    assert len(bench.notices) == notices


def test_a_late_copy_of_the_switch_off_hinders_no_motion() -> None:
    """A late copy of MCS (switch off the motors) does not prevent the next drive.

    After the copy, the server refuses motions until the driver sends MSM, which permits them again.
    """
    bench = creeping()
    since = len(bench.written)
    bench.run_until(lambda: bench.server.manual, 0.3)
    for _ in range(29):
        bench.try_command(0.2, 0.0)
        bench.run(0.01)
    bench.server.receive(BOTH[0], 0, None, bench.server.now_s)
    bench.command(0.2, 0.0, 2.0)
    said = bench.said(since)
    assert said[:2] == BOTH
    assert any(each.startswith(b"RM ") for each in said)
    assert bench.board._pilot.state is State.DRIVING
    assert not bench.notices or "conflicting" not in bench.notices[-1]


def test_a_copy_of_a_refused_switch_off_is_released_too() -> None:
    """A copy of a refused MCS (direct control of the motors) arrives 0.29 s late.

    The driver sends MSM, which ends the direct control, only afterwards.
    """
    bench = creeping()
    since = len(bench.written)
    drops(
        bench.robot.network[0].from_board,
        lambda data: data == b"ok" and bench.said(since) == [BOTH[0]],
    )
    bench.run_until(lambda: bench.said(since).count(BOTH[0]) == 2, 2.0)
    bench.run(0.29)
    bench.server.receive(BOTH[0], 0, None, bench.server.now_s)
    bench.run(1.0)
    assert bench.said(since) == [BOTH[0], *BOTH]
    assert not bench.server.manual


def test_a_motion_that_follows_at_once_needs_no_switch_off() -> None:
    """A controlled turn follows a straight move, and switches both motors off at its end.

    So the driver sends no MCS (switch off the motors).
    """
    bench = MartBench("source").ready()
    since = len(bench.written)
    reach(bench, Pose(0.5, 0.0, 1.5))
    bench.run(2.0)
    said = bench.said(since)
    straight = max(n for n, each in enumerate(said) if each.startswith(b"TF"))
    assert said[straight + 1] == b"RST IMU"
    assert b"MCS 128 128" not in said


@pytest.mark.parametrize(
    ("word", "twist"), [(b"RM ", (0.2, 0.0)), (b"B ", (-0.2, 0.0)), (b"L ", (0.0, 0.6))]
)
def test_a_motion_that_never_began_does_not_replace_a_switch_off(
    word: bytes, twist: tuple[float, float]
) -> None:
    """A motor is left on, and the next command, which would set both motors' speeds, is lost.

    The driver still switches the motor off.
    """
    bench = creeping()
    lost = drops(bench.robot.network[0].to_board, lambda data: data.startswith(word))
    bench.command(*twist, 1.2)
    bench.command(0.0, 0.0, 1.0)
    bench.run(4.0)
    assert lost
    assert registers(bench) == OFF
    assert not bench.server.manual


def test_four_lost_replies_on_a_poor_network_do_not_look_like_a_server_without_mcs() -> None:
    """The network loses MCS (direct control of the motors) four times, and some encoder queries.

    The driver repeats MCS, then ends the direct control, and does not report that the server lacks
    MCS.
    """
    bench = creeping()
    since, notices = len(bench.written), len(bench.notices)
    counts = count()

    def is_lost(data: bytes) -> bool:
        if data == BOTH[0]:
            return bench.said(since).count(BOTH[0]) <= 4
        return data == b"ENC" and not next(counts) % 4

    drops(bench.robot.network[0].to_board, is_lost)
    bench.run(15.0)
    assert bench.said(since) == [BOTH[0]] * 5 + [BOTH[1]]
    assert registers(bench) == OFF
    assert len(bench.notices) == notices


@pytest.mark.parametrize("reply", [b"", b"fail", b"fail improper command format", b"unknown"])
def test_a_server_that_does_not_answer_the_switch_off_drives_nevertheless(reply: bytes) -> None:
    """If a server gives no valid answer to MCS and MSM, the driver still starts motions.

    After a few attempts, one notice reports the missing answer.
    """
    bench = MartBench("documented")
    network = bench.robot.network[0]
    real = network.to_board.send

    def send(data: bytes, at_s: float) -> None:
        if data not in BOTH:
            real(data, at_s)
        elif reply:
            network.from_board.send(reply, at_s)

    network.to_board.send = send
    bench.ready()
    bench.command(0.2, 0.0, 8.0)
    assert bench.truth.x_m > 0.5
    assert sum("does not answer MCS" in notice for notice in bench.notices) == 1


def test_a_false_refusal_of_the_switch_off_does_not_block_the_server() -> None:
    """The driver ends MCS (direct control of the motors) even if the server seemed to reject MCS.

    The server obeys MCS, but the late reply to another command, "not supported", looks like the
    reply to MCS.
    """
    bench = creeping()
    network = bench.robot.network[0]
    real = network.to_board.send

    def send(data: bytes, at_s: float) -> None:
        real(data, at_s + 0.01)
        if data == BOTH[0]:
            network.from_board.send(b"fail command not supported", at_s)

    network.to_board.send = send
    bench.run(2.0)
    assert bench.server.manual
    began_m = bench.server.chassis.way_m
    bench.command(0.2, 0.0, 6.0)
    assert not bench.server.manual
    assert bench.server.chassis.way_m > began_m + 0.2


def test_an_estop_after_a_drive_switches_the_motor_off_too() -> None:
    """The e-stop is latched after a straight move, before the driver has switched the motors off.

    The driver still switches them off (MCS, MSM), and continues to send stops.
    """
    bench = creeping()
    since = len(bench.written)
    bench.estop(True)
    bench.run(3.0)
    assert registers(bench) == OFF
    assert not bench.server.manual
    assert [each for each in bench.said(since) if each in BOTH] == BOTH
    mark = len(bench.written)
    bench.run(1.0)
    assert bench.said(mark).count(b"SRM") >= 5


def test_a_motor_is_switched_off_with_a_dead_imu() -> None:
    """The IMU fails after a straight move. The driver still switches the motors off (MCS, MSM).

    These commands need no IMU.
    """
    bench = creeping()
    bench.robot.board.server.imu.alive = False
    since = len(bench.written)
    bench.run(5.0)
    assert bench.said(since)[:2] == BOTH
    assert registers(bench) == OFF
    assert not bench.server.manual


def test_a_docking_move_is_followed_by_a_switch_off() -> None:
    """After a docking move, the driver switches the motors off (MCS, MSM).

    A docking move is a straight move, and can leave a motor on.
    """
    bench = MartBench("source", dock_m=0.4).ready()
    bench.job(Job.DOCK, "DOCK", 12)
    bench.run(2.0)
    assert bench.said()[-2:] == BOTH


def test_a_server_without_these_commands_is_asked_once() -> None:
    """The robot makes two straight moves, and the server does not know MCS (switch off the motors).

    The driver sends MCS only once.
    """
    bench = MartBench("documented").ready()
    for way_m in (0.5, 1.0):
        reach(bench, Pose(way_m, 0.0, 0.0))
        bench.run(1.0)
    assert [each for each in bench.said() if each in BOTH] == [BOTH[0]]


def test_mcs_is_tried_again_after_lost_replies_but_not_after_a_refusal() -> None:
    """Four replies to MCS (motors off) are lost, so the driver gives up.

    After a later move, the driver tries MCS again, but not after the reply "command not supported".
    """
    switch_off = SwitchOff()
    switch_off.doubt()
    assert [switch_off.missed(words.MCS) for _ in range(4)] == [False, False, False, True]
    switch_off.begins(straight=True)
    assert not switch_off.needed
    switch_off.doubt()
    assert switch_off.needed
    switch_off.answered(words.MCS, Fail(words.UNSUPPORTED))
    switch_off.doubt()
    assert not switch_off.needed
