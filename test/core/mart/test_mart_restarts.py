# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a server that is restarted: the driver starts no motion before the server is ready."""

import pytest
from mart_bench import MartBench
from mart_campaign import FIRMWARES

from omnibot_driver.core.mart.ground import STARTS_UP_S
from omnibot_driver.simulator.common.network import NetworkFaults
from omnibot_driver.simulator.mart import Firmware

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("wanted", "boot_s", "offset_s"),
    [
        (wanted, boot_s, offsets_s[(n + m) % 2])
        for n, wanted in enumerate(((0.0, 0.0), (0.3, 0.0), (0.0, 0.5), (-0.2, 0.0)))
        for m, (boot_s, offsets_s) in enumerate(
            ((0.3, (0.0, 0.46)), (1.0, (0.23, 0.71)), (4.0, (0.0, 0.46)))
        )
    ],
)
def test_a_server_that_starts_up_gets_neither_voltage_queries_nor_motions(
    wanted: tuple[float, float], boot_s: float, offset_s: float
) -> None:
    """The server restarts during a motion, and the motors still run.

    Until the server has started up, the driver sends no voltage queries and no motions. They would
    crash the server.
    """
    bench = MartBench().ready()
    bench.command(*wanted, 2.0 + offset_s)
    bench.server.restart(boot_s)
    bench.command(*wanted, 1.5)
    bench.command(0.0, 0.0, boot_s + 5.0)
    assert not bench.server.crashed
    assert bench.robot.stands
    assert bench.session.state == "nominal"
    bench.command(*(wanted if any(wanted) else (0.3, 0.0)), 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("seed", range(4))
def test_a_network_that_loses_one_datagram_of_ten_is_not_taken_for_an_absence(seed: int) -> None:
    """The network loses replies. After a loss, the driver sends HELLO.

    The answer shows that the server has not restarted.
    """
    bench = MartBench("source", NetworkFaults(lose=0.1), seed=seed).ready()
    appeared = set()
    for _ in range(300):
        bench.run(0.1)
        appeared.add(bench.board._pilot.appeared_s)
    assert len(appeared) <= 3


@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.05, 0.1])
def test_a_server_that_is_restarted_while_it_checks_the_imu_gets_no_motion_too_soon(
    after_s: float,
) -> None:
    """The server restarts during the check of the IMU, and does not answer.

    The driver sends no motion until the server is ready.
    """
    bench = MartBench().ready()
    bench.command_until(0.0, 0.5, lambda: b"RST IMU" in bench.said()[-1:])
    bench.run(after_s)
    bench.server.restart(1.0)
    bench.command(0.0, 0.5, 6.0)
    assert not bench.server.crashed
    assert not bench.robot.stands


@pytest.mark.parametrize(
    ("boot_s", "x_m", "y_m", "firmware"),
    [
        (boot_s, *(((3.0, 0.0), (0.0, 3.0))[(n + m) % 2]), firmware)
        for n, boot_s in enumerate((0.3, 3.0))
        for m, firmware in enumerate(FIRMWARES)
    ],
)
def test_a_server_that_is_restarted_in_a_controlled_move_is_noticed_before_the_move_would_end(
    boot_s: float, x_m: float, y_m: float, firmware: Firmware
) -> None:
    """The server restarts on the way to a goal, 3 m away. The motors keep running.

    The driver stops the robot within 5 s after the server has started up.
    """
    bench = MartBench(firmware).ready()
    bench.go_to(x_m, y_m, 0.0)
    bench.run_until(lambda: not bench.robot.stands, 5.0)
    bench.run(0.6)
    bench.server.restart(boot_s)
    assert not bench.robot.stands
    bench.run(boot_s)
    assert bench.until_it_stands() < 5.0
    bench.run(5.0)
    assert bench.robot.stands
    assert not bench.server.crashed
    assert any("knows of no motion" in notice for notice in bench.notices)
    assert not any("unconfirmed" in notice for notice in bench.notices)
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands


@pytest.mark.parametrize("goal", [(3.0, 0.0, 0.0), (0.0, 0.0, 3.0)])
@pytest.mark.parametrize("boot_s", [0.05, 0.3, 1.0])
def test_motors_that_run_on_after_a_controlled_move_are_switched_off_before_the_server_is_ready(
    boot_s: float, goal: tuple[float, float, float]
) -> None:
    """The server restarts in a controlled move, and the motors keep running.

    The driver switches the motors off by MCS and MSM while the server is still starting up. These
    commands need only the motor board.
    """
    bench = MartBench("source").ready()
    bench.go_to(*goal)
    bench.run_until(lambda: not bench.robot.stands, 5.0)
    bench.run(0.3)
    bench.server.restart(boot_s)
    assert not bench.robot.stands
    bench.run_until(lambda: bench.server.manual, 10.0)
    assert bench.now < bench.board._pilot.appeared_s + STARTS_UP_S
    bench.run(4.0)
    assert bench.robot.stands
    assert not bench.server.crashed
    assert not bench.server.manual


@pytest.mark.parametrize("offset_s", [0.01 * step for step in range(0, 200, 8)])
def test_a_quick_restart_in_a_turn_on_the_spot_does_not_crash_the_server(offset_s: float) -> None:
    """The server restarts within 50 ms in a turn on the spot, and the driver does not notice.

    In such a turn, the driver sends no VOLTS (voltage query), which would crash a server that is
    starting up.
    """
    bench = MartBench("source").ready()
    bench.command(0.0, 0.5, 2.0)
    bench.run(offset_s % 0.1)
    bench.command(0.0, 0.5, offset_s)
    bench.server.restart(0.05)
    bench.command(0.0, 0.5, 1.0)
    bench.run(3.0)
    assert not bench.server.crashed
    assert bench.robot.stands


@pytest.mark.parametrize("boot_s", [0.1, 0.2, 0.4])
def test_a_restart_just_after_a_long_turn_on_the_spot_does_not_crash_the_server(
    boot_s: float,
) -> None:
    """The server restarts after a turn of 12 s, when VOLTS (voltage query) is overdue.

    After an unanswered request, the driver delays VOLTS, which would crash a server that is
    starting up.
    """
    bench = MartBench("source").ready()
    bench.command(0.0, 0.5, 12.0)
    bench.try_command(0.0, 0.0)
    bench.run(0.32)
    bench.server.restart(boot_s)
    bench.run(2.5)
    assert not bench.server.crashed


def rescued(firmware: Firmware, *, alive: bool) -> MartBench:
    """Return a test bench whose server was restarted during a move, 8 s ago.

    ``alive``: whether the IMU works after the restart.
    """
    bench = MartBench(firmware).ready()
    bench.go_to(3.0, 0.0, 0.0)
    bench.run_until(lambda: not bench.robot.stands, 5.0)
    bench.run(0.6)
    bench.server.restart(0.3)
    bench.server.imu.alive = alive
    bench.run(8.0)
    return bench


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_a_restarted_server_with_a_dead_imu_switches_the_motors_off(firmware: Firmware) -> None:
    """The server restarts in a move, the motors run on, and the IMU is dead.

    The driver switches the motors off by MCS, and not by a turn of 1° (MCR), which needs the IMU.
    """
    bench = rescued(firmware, alive=False)
    assert bench.robot.stands
    assert b"MCS 128 128" in bench.said()
    assert b"MCR SLOW 1" not in bench.said()


def test_a_restarted_server_without_mcs_ends_the_motion_by_a_turn_of_one_degree() -> None:
    """A server restarts during a move, and its firmware has no MCS (motors off).

    The driver ends the motion by a turn of one degree.
    """
    bench = rescued("documented", alive=True)
    assert bench.robot.stands
    assert b"MCR SLOW 1" in bench.said()


@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_turns_on_the_spot_get_their_speed_again_from_a_restarted_server(
    firmware: Firmware,
) -> None:
    """A restart erases the speed of turns. A turn without a new setting would not move the robot.

    The driver sends the setting (SSP) again before it starts the next turn.
    """
    bench = MartBench(firmware).ready()
    for _ in range(3):
        bench.command(0.0, 0.5, 3.0)
        bench.run(2.0)
    bench.server.restart()
    bench.command(0.0, 0.5, 6.0)
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize("boot_s", [0.03, 0.3, 0.5])
@pytest.mark.parametrize("after_s", [0.3, 0.4])
def test_a_restart_between_two_stop_commands_of_a_turn_does_not_lead_to_voltage_queries(
    after_s: float, boot_s: float
) -> None:
    """The server answers the first of two stops (SM) of a turn, and restarts.

    The driver delays VOLTS (voltage query), because VOLTS crashes a starting server.
    """
    bench = MartBench("source").ready()
    bench.command_until(0.0, 0.5, lambda: not bench.robot.stands, 8.0)
    bench.command(0.0, 0.5, 1.5)
    since = len(bench.written)
    bench.command_until(0.0, 0.0, lambda: b"SM" in bench.said(since))
    bench.run(after_s)
    bench.server.restart(boot_s)
    bench.run(boot_s + 3.0)
    assert not bench.server.crashed


@pytest.mark.parametrize("offset_s", [0.0, 0.2, 0.4])
def test_a_controller_that_is_started_in_place_of_another_server_is_given_time(
    offset_s: float,
) -> None:
    """Another server answers at the controller's address until the controller starts.

    No silence shows this start, but the driver gives the controller time to start: an early command
    could crash the controller.
    """
    bench = MartBench("source").ready()
    seconds = 8.0 + offset_s
    bench.server.restart(seconds)
    answered = len(bench.written)
    for _ in range(round(seconds / 0.01)):
        requests = bench.written[answered:]
        answered += len(requests)
        for _, data in requests:
            reply = b"ok toaster" if data == b"HELLO" else b"what?"
            bench.session.inbound.receive(reply, bench.now, 0)
        bench.run(0.01)
    assert any("answers HELLO with 'toaster'" in notice for notice in bench.notices)
    bench.command(0.3, 0.0, 8.0)
    assert not bench.server.crashed
    assert not bench.robot.stands


@pytest.mark.parametrize(
    ("boot_s", "seed", "speed", "yaw_rate"), [(0.3, 191, 0.2, 0.0), (1.7, 148, 0.0, 0.4)]
)
def test_the_motors_are_switched_off_soon_after_a_restart_on_a_network_that_loses_datagrams(
    boot_s: float, seed: int, speed: float, yaw_rate: float
) -> None:
    """The driver switches running motors off with MCS soon after a restart, without waiting.

    The restarted server knows of no motion, so stops have no effect.
    """
    faults = NetworkFaults(lose=0.05, duplicate=0.05, delay_s=0.05)
    bench = MartBench(faults=faults, seed=seed).ready()
    bench.command(speed, yaw_rate, 2.0)
    assert not bench.robot.stands
    bench.server.restart(boot_s)
    bench.run(boot_s)
    assert bench.until_it_stands() < 2.5
    bench.run(1.0)
    assert bench.robot.stands


@pytest.mark.parametrize("firmware", ["firmware", "source"])
@pytest.mark.parametrize("boot_s", [0.55, 0.6, 0.65, 0.7])
def test_a_short_restart_while_the_imu_is_checked_is_noticed(
    boot_s: float, firmware: Firmware
) -> None:
    """The server restarts 0.08 s after the check of the IMU (RST IMU), and soon answers again.

    The silence is short, but the driver starts no motion before the server is ready.
    """
    bench = MartBench(firmware).ready()
    bench.command_until(0.3, 0.0, lambda: b"RST IMU" in bench.said()[-1:])
    bench.run(0.08)
    bench.server.restart(boot_s)
    bench.command(0.3, 0.0, 5.0)
    assert not bench.server.crashed
    assert not bench.robot.stands


@pytest.mark.parametrize("seed", [2, 6, 14])
def test_motors_that_run_on_are_switched_off_without_mcs_on_a_bad_network(seed: int) -> None:
    """A server without the command MCS restarts in a drive on a bad network, and the motors run on.

    The driver switches the motors off by a turn of 1°: the robot rests within 8.5 s.
    """
    network = NetworkFaults(lose=0.1, duplicate=0.1, delay_s=0.02)
    bench = MartBench("documented", network, seed=seed).ready()
    for _ in range(60):
        bench.command(0.3, 0.0, 0.1)
        if not bench.robot.stands:
            break
    bench.command(0.3, 0.0, 0.7)
    assert not bench.robot.stands
    bench.server.restart(0.5)
    bench.command(0.0, 0.0, 0.5)
    assert bench.until_it_stands() < 8.5


@pytest.mark.parametrize(
    "motion", [(-0.2, 0.0), (0.3, 0.0), (0.2, 0.3)], ids=["backward", "forward", "curve"]
)
@pytest.mark.parametrize("firmware", ["firmware", "source"])
def test_the_estop_stops_the_robot_at_once_although_the_server_was_just_restarted(
    firmware: Firmware, motion: tuple[float, float]
) -> None:
    """The server restarts in a drive, the motors run on, and the user sets the e-stop.

    The restarted server answers the usual stop with "no motion", so the driver switches the motors
    off by MCS at once.
    """
    bench = MartBench(firmware).ready()
    bench.command(*motion, 2.5)
    bench.server.restart(0.1)
    bench.command(*motion, 0.2)
    assert not bench.robot.stands
    bench.estop(True)
    assert bench.until_it_stands() < 1.0
    bench.run(3.0)
    assert bench.robot.stands
    assert not bench.server.crashed


@pytest.mark.parametrize("boot_s", [0.05, 0.4])
@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_quick_restart_in_a_backward_drive_is_noticed(firmware: Firmware, boot_s: float) -> None:
    """The server restarts quickly in B (backward drive).

    The server refuses ``CS 0 0``, a speed change by zero. So the driver notices the restart, and
    begins the drive anew.
    """
    bench = MartBench(firmware).ready()
    bench.command(-0.2, 0.0, 4.0)
    since = len(bench.written)
    bench.server.restart(boot_s)
    bench.command(-0.2, 0.0, 8.0)
    assert b"B SLOW" in bench.said(since)
    assert not bench.server.crashed
    assert not bench.robot.stands


@pytest.mark.parametrize("wait_s", [0.0, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("boot_s", [0.15, 0.2, 0.3, 0.45])
def test_a_quick_restart_at_rest_is_noticed_before_the_next_motion(
    boot_s: float, wait_s: float
) -> None:
    """The server restarts quickly while the robot rests.

    The driver notices this by the heading, which is zero after a restart, and delays the next
    motion until the server is ready.
    """
    bench = MartBench("source").ready()
    bench.command(0.2, 0.3, 1.5)
    bench.run(2.0)
    bench.server.restart(boot_s)
    bench.run(boot_s + wait_s)
    bench.command(0.3, 0.0, 1.0)
    assert not bench.server.crashed
    bench.command(0.3, 0.0, 3.0)
    assert not bench.robot.stands
