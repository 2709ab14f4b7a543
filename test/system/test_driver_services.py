# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that call the driver's services and check the board's commands and modes."""

import math
import signal
from collections.abc import Callable
from typing import Any

import pytest
from driver_process import PATIENCE_S, Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from omnibot_driver.simulator.omnibot import BoardMode, PtyBoard, SimulatedBoard

Start = Callable[..., Any]


@pytest.fixture
def board(shared: tuple[PtyBoard, Driver]) -> PtyBoard:
    return shared[0]


@pytest.fixture
def driver(shared: tuple[PtyBoard, Driver]) -> Driver:
    return shared[1]


@pytest.fixture
def probe(shared_probe: Probe) -> Probe:
    return shared_probe


def kinds(board: PtyBoard) -> list[str]:
    with board.lock:
        return [command.kind for command in board.board.commands]


def still(board: SimulatedBoard) -> bool:
    truth = board.truth
    return max(abs(truth.vx_mps), abs(truth.vy_mps), abs(truth.yaw_rate)) < 0.01


def drive(probe: Probe, board: PtyBoard) -> None:
    """Publish forward commands until the robot moves."""
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    for _ in range(20):  # a stall of the computer stops the robot
        commands.publish(twist)
        if board.wait_for(lambda b: b.truth.vx_mps > 0.05, 1.0):
            probe.forget_message()
            return
    raise AssertionError("it does not drive")


def drive_away(probe: Probe, board: PtyBoard) -> None:
    """Drive forward and stop, repeatedly, until the robot is more than 0.1 m away.

    One drive is not always enough, because the robot may stop early on a busy computer.
    """
    for _ in range(20):
        drive(probe, board)
        assert board.wait_for(still, PATIENCE_S)
        with board.lock:
            if board.board.truth.x_m > 0.1:
                return
    raise AssertionError("it does not get far")


def test_no_call_of_a_hundred_at_once_is_lost(probe: Probe) -> None:
    """A hundred calls of ``~/estop`` arrive at once. The driver answers each of them.

    The last call decides whether the e-stop is latched.
    """
    latched = probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
    answers = [probe.call_async(SetBool, "estop", data=bool(n % 2)) for n in range(100)]
    assert all(answer.wait().success for answer in answers)
    probe.wait_for(lambda: latched and latched[-1].data)


def test_a_press_on_the_topic_is_not_wiped_out_by_what_comes_after_it(
    probe: Probe, driver: Driver
) -> None:
    """While the driver is suspended, the topic ``estop`` gets ``true``, then ``false`` 50 times.

    When the driver runs again, ``true`` latches the e-stop. The messages ``false`` on this topic do
    not release the e-stop.
    """
    latched = probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
    button = probe.publisher(Bool, "estop", 100)
    driver.process.send_signal(signal.SIGSTOP)
    button.publish(Bool(data=True))
    for _ in range(50):
        button.publish(Bool(data=False))
    driver.process.send_signal(signal.SIGCONT)
    driver.wait_for_line("e-stop latched by the topic estop")
    for _ in range(60):  # the driver takes at least one message for each call
        assert probe.call(Trigger, "reset_odometry").success
    probe.wait_for(lambda: latched and latched[-1].data)
    assert "e-stop released" in probe.call(SetBool, "estop", data=False).message


def test_pause_and_unpause_are_idempotent_although_p_toggles(probe: Probe, board: PtyBoard) -> None:
    """A user calls ``~/pause`` twice with the same value. The board keeps the requested mode.

    The driver sends P only once, because P toggles.
    """
    for data, mode in [
        (True, BoardMode.PAUSED),
        (True, BoardMode.PAUSED),
        (False, BoardMode.NOMINAL),
        (False, BoardMode.NOMINAL),
    ]:
        answer = probe.call(SetBool, "pause", data=data)
        assert answer.success, answer.message
        with board.lock:
            assert board.board.mode is mode
    assert kinds(board).count("pause") == 1


def test_pausing_a_driving_robot_stops_it_first_and_unpausing_does_not_move_it(
    probe: Probe, board: PtyBoard
) -> None:
    """A user pauses a driving robot. The driver sends Stop before P.

    After the pause, the robot rests until a new command.
    """
    drive(probe, board)
    assert probe.call(SetBool, "pause", data=True).success
    probe.wait_for_state("paused")
    order = kinds(board)
    assert order.index("wheels", order.index("velocity")) < order.index("pause")
    assert board.wait_for(still, PATIENCE_S)
    assert probe.call(SetBool, "pause", data=False).success
    assert board.wait_for(lambda b: b.mode is BoardMode.NOMINAL and still(b), PATIENCE_S)
    drive(probe, board)


def test_start_starts_a_board_that_was_left_paused(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """The parameter ``auto_start`` is false.

    The driver does not start the board until a user calls ``~/start``.
    """
    board = start_board()
    probe: Probe = probe_of(start_driver(board.path, auto_start=False))
    probe.wait_for_state("paused")
    assert kinds(board) == []
    answer = probe.call(Trigger, "start")
    assert answer.success, answer.message
    assert "start" in kinds(board)
    probe.wait_for_state("nominal")


def test_reset_brings_the_board_back_and_odometry_goes_on(probe: Probe, board: PtyBoard) -> None:
    """A user calls ``~/reset`` after a drive. The driver sends Stop, R and S.

    The board's own odometry restarts at 0, but odom continues.
    """
    odometry = probe.listen(Odometry, "odom")
    drive_away(probe, board)
    with board.lock:
        truth = board.board.truth
    answer = probe.call(Trigger, "reset")
    assert answer.success, answer.message
    order = kinds(board)
    assert order.index("wheels", order.index("velocity")) < order.index("reset")
    assert order.index("start", order.index("reset"))
    with board.lock:
        assert abs(board.board.odometry.x_mm) < 1.0
    count = len(odometry)
    probe.wait_for(lambda: len(odometry) > count + 10)
    assert odometry[-1].pose.pose.position.x == pytest.approx(truth.x_m, abs=2e-3)
    assert still(board.board)


def test_estop_latches_and_releases_to_standing_still(probe: Probe, board: PtyBoard) -> None:
    """A user latches the e-stop during a drive and releases it.

    The robot stays at rest after the release, until a new command arrives.
    """
    active = probe.listen(Bool, "omnibot_driver/estop_active", latched=True)
    drive(probe, board)
    assert probe.call(SetBool, "estop", data=True).success
    assert board.wait_for(lambda b: "estop" in [c.kind for c in list(b.commands)[-2:]], PATIENCE_S)
    probe.wait_for(lambda: active and active[-1].data)
    assert board.wait_for(still, PATIENCE_S)
    answer = probe.call(SetBool, "estop", data=False)
    assert answer.success
    assert "next command" in answer.message
    probe.wait_for(lambda: not active[-1].data)
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    assert board.wait_for(still, PATIENCE_S)
    drive(probe, board)


def test_a_board_that_holds_the_estop_itself_is_told_of_and_a_reset_frees_it(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A board still ignores commands after the e-stop is released.

    The driver recommends ``~/reset``. After a reset the robot drives again.
    """
    board = start_board(estop_latches=True, running=True)
    driver: Driver = start_driver(board.path)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("nominal")
    drive(probe, board)
    assert probe.call(SetBool, "estop", data=True).success
    assert board.wait_for(still, PATIENCE_S)
    assert probe.call(SetBool, "estop", data=False).success
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    timer = probe.node.create_timer(0.05, lambda: commands.publish(twist))
    driver.wait_for_line("stands still.*~/reset")
    assert still(board.board)
    probe.remove(timer)
    assert probe.call(Trigger, "reset").success
    drive(probe, board)


def test_commands_under_estop_are_refused_and_told_what_to_do(
    probe: Probe, driver: Driver, board: PtyBoard
) -> None:
    """A command arrives while the e-stop is latched, and is refused.

    It does not move the robot, not even after the e-stop is released.
    """
    assert probe.call(SetBool, "estop", data=True).success
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.x = 0.3
    commands.publish(twist)
    driver.wait_for_line("refused.*e-stop.*~/estop")
    assert probe.call(SetBool, "estop", data=False).success
    assert board.wait_for(lambda b: b.commands[-1].kind == "wheels", PATIENCE_S)
    assert "velocity" not in kinds(board)


def test_while_a_reset_waits_estop_answers_and_another_request_is_refused(
    start_board: Start, start_driver: Start, probe_of: Start
) -> None:
    """A call of ``~/reset`` waits seconds for the board's restart. ``~/estop`` answers at once.

    ``~/pause`` is refused, and the message names the reset.
    """
    board = start_board(boot_time_s=1.0, running=True)
    probe: Probe = probe_of(start_driver(board.path))
    probe.wait_for_state("nominal")
    for service in ("estop", "pause"):
        probe.client(SetBool, service)  # discovered before the reset
    reset = probe.call_async(Trigger, "reset")
    assert board.wait_for(lambda b: b.mode is BoardMode.BOOTING, PATIENCE_S)
    with board.lock:  # the board cannot complete its restart
        answer = probe.call_async(SetBool, "pause", data=True).wait()
        assert not answer.success
        assert "reset is under way" in answer.message
        assert probe.call_async(SetBool, "estop", data=True).wait().success
        assert not reset.arrived
    assert reset.wait().success


def test_reset_odometry_zeroes_the_pose(probe: Probe, board: PtyBoard) -> None:
    """A user calls ``~/reset_odometry`` after a drive.

    The robot's current pose becomes the origin of odom.
    """
    odometry = probe.listen(Odometry, "odom")
    drive_away(probe, board)
    probe.wait_for(lambda: odometry and odometry[-1].pose.pose.position.x > 0.1)
    before = len(odometry)
    assert probe.call(Trigger, "reset_odometry").success
    # On a busy computer, the driver may read the end of the drive only after the reset.
    probe.wait_for(lambda: any(one.pose.pose.position.x < 0.05 for one in odometry[before:]))


def test_services_answer_with_a_reason_when_the_board_is_silent(
    start_driver: Start, probe_of: Start, silent_port: str
) -> None:
    """The board is silent.

    ``~/start`` and ``~/pause`` fail with a message that says what to check.
    """
    driver: Driver = start_driver(silent_port)
    probe: Probe = probe_of(driver)
    probe.wait_for_state("connecting")
    for kind, service in ((Trigger, "start"), (SetBool, "pause")):
        answer = probe.call(kind, service)
        assert not answer.success
        assert "power" in answer.message


def test_services_answer_at_once_without_a_port(start_driver: Start, probe_of: Start) -> None:
    """The port does not exist. Start, pause, reset and the reset of the odometry fail at once.

    The e-stop can still be latched.
    """
    probe: Probe = probe_of(start_driver("/dev/there_is_no_such_port"))
    triggers = [(Trigger, name) for name in ("start", "reset", "reset_odometry")]
    for kind, service in [*triggers, (SetBool, "pause")]:
        answer = probe.call(kind, service)
        assert not answer.success
        assert "port is not open" in answer.message
    answer = probe.call(SetBool, "estop", data=True)
    assert answer.success
    assert "when it opens" in answer.message


def test_the_twist_after_a_pause_is_that_of_the_robot(probe: Probe) -> None:
    """A robot at rest is paused and started again. Its twist is zero."""
    odometry = probe.listen(Odometry, "odom")
    probe.call(SetBool, "pause", data=True)
    probe.call(SetBool, "pause", data=False)
    count = len(odometry)
    probe.wait_for(lambda: len(odometry) > count + 5)
    for message in odometry[count:]:
        assert math.hypot(message.twist.twist.linear.x, message.twist.twist.linear.y) < 0.01
