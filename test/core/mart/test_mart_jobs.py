# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of jobs, such as docking and the measurement of the gyro bias, and of their ends."""

import pytest
from mart_bench import MartBench

from omnibot_driver.core.mart.goal import docking_inches
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.core.packets import Packet
from omnibot_driver.core.requests import LEAVING
from omnibot_driver.simulator.mart import Firmware


def test_the_gyro_is_calibrated_at_rest() -> None:
    """The driver sends SB to calibrate the gyro. The job succeeds when the server replies."""
    done = MartBench().ready().job(Job.BIAS)
    assert (done.token, done.success) == ("token", True)


@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_the_gyro_is_not_calibrated_with_a_dead_imu(firmware: Firmware) -> None:
    """The user requests a gyro calibration (SB), but the IMU is dead.

    The calibration fails, and the driver does not send SB, which would hang the server.
    """
    bench = MartBench(firmware).ready()
    bench.server.imu.alive = False
    done = bench.job(Job.BIAS)
    assert not done.success
    assert "IMU" in done.message
    assert b"SB" not in bench.said()
    assert not bench.server.blocked


def test_a_job_ends_with_the_reason_that_ended_it() -> None:
    """During a calibration, the server falls silent, the e-stop is latched, or a command arrives.

    The job fails, and its result names this reason.
    """
    bench = MartBench().ready()
    bench.hears = bench.speaks = False
    assert "no longer answers" in bench.job(Job.BIAS).message
    for estop, reason in ((True, "e-stop was latched"), (False, "stop sending commands")):
        bench = MartBench().ready()
        bench.board.ask(Job.BIAS, "token", bench.now)
        bench.run(0.1)
        if estop:
            bench.estop(True)
        else:
            bench.drive()
        bench.run(0.1)
        (done,) = bench.extras(JobDone)
        assert not done.success
        assert reason in done.message


def test_a_job_that_the_shutdown_ends_says_so() -> None:
    """The driver shuts down during a calibration, and then in the middle of a docking.

    The result names the shutdown, not the stop that follows. The docking robot is stopped.
    """
    bench = MartBench().ready()
    bench.board.ask(Job.BIAS, "token", bench.now)
    bench.run(0.1)
    docking = MartBench().ready()
    docking.board.ask(Job.DOCK, "token", docking.now, "DOCK", 40)
    docking.run_until(lambda: not docking.robot.stands)
    for each in (bench, docking):
        each.session.shutdown.begin(each.now)
        each.settle()
        each.until_it_stands()
        each.run(0.1)
        (done,) = each.extras(JobDone)
        assert (done.success, done.message) == (False, LEAVING)
    assert b"SL" in docking.said()


def test_docking_ends_at_the_dock_or_by_an_estop() -> None:
    """A docking job sends a move that ends at the dock (TF DOCK). At the dock, the job succeeds.

    An e-stop cancels a second docking job.
    """
    bench = MartBench(dock_m=0.3).ready()
    assert bench.job(Job.DOCK, "DOCK", 20).success
    bench.run(2.0)
    assert bench.server.docked
    assert bench.board.resting
    assert bench.job(Job.BIAS).success
    bench = MartBench().ready()
    bench.board.ask(Job.DOCK, "token", bench.now, "DOCK", 40)
    bench.run_until(lambda: not bench.robot.stands)
    bench.estop(True)
    bench.run(3.0)
    assert bench.robot.stands
    assert b"SL" in bench.said()
    assert bench.board._pilot.jobs.job is None


@pytest.mark.parametrize("longest_m", [0.2, 0.5, 1.0, 3.0])
def test_docking_drives_no_further_than_it_may(longest_m: float) -> None:
    """Without a dock, the robot drives at most the permitted distance.

    The driver requests less than this distance, because the server's moves go too far.
    """
    bench = MartBench().ready()
    bench.job(Job.DOCK, "DOCK", docking_inches(longest_m))
    bench.run(2.0)
    assert 0.5 * longest_m < bench.truth.x_m <= longest_m


def test_a_robot_that_must_not_move_does_not_dock() -> None:
    """The motor board reports that a motor has tripped, and a docking job is requested.

    The driver does not start the move, and the job's result names the trip.
    """
    bench = MartBench(motor_status=4).ready()
    done = bench.job(Job.DOCK, "DOCK", 20)
    assert not done.success
    assert "motor 1 trip" in done.message
    assert not any(data.startswith(b"TF") for data in bench.said())


def test_docking_ends_with_the_stop_of_its_move() -> None:
    """The reply to the docking move is lost. The driver stops the robot, and the job fails.

    The driver then accepts the next job.
    """
    bench = MartBench().ready()
    inner = bench.robot.advance

    def advance() -> list[Packet]:
        return [packet for packet in inner() if b"ok 20" not in packet[1]]

    bench.robot.advance = advance  # type: ignore[method-assign]
    done = bench.job(Job.DOCK, "DOCK", 20, limit_s=30.0)
    assert not done.success
    assert "lost" in done.message
    assert bench.board._pilot.jobs.job is None
    bench.run(3.0)
    assert bench.robot.stands
    assert bench.job(Job.BIAS).success


@pytest.mark.parametrize("job", [Job.BIAS, Job.LAST_MOVE])
def test_a_job_ends_when_the_port_is_lost(job: Job) -> None:
    """The port is lost during a job. The job fails at once, even if the port never comes back."""
    bench = MartBench().ready()
    bench.board.ask(job, "token", bench.now)
    bench.close()
    (done,) = bench.extras(JobDone)
    assert not done.success
    assert "port" in done.message


def test_a_refused_zero_command_ends_a_docking() -> None:
    """A zero cmd_vel arrives during a docking, but is refused, e.g. because its stamp is too old.

    The driver still ends the docking, because no ``cmd_vel_timeout`` would end it.
    """
    bench = MartBench().ready()
    bench.board.ask(Job.DOCK, "token", bench.now, "DOCK", 80)
    bench.run_until(lambda: not bench.robot.stands)
    bench.session.end_goal(bench.now)
    bench.run(1.5)
    assert bench.robot.stands
    assert b"SL" in bench.said()
    assert bench.board._pilot.jobs.job is None
    assert "the docking is cancelled: cmd_vel" in bench.notices[-1]


def test_a_calibration_that_another_motion_prevents_names_the_other_program() -> None:
    """If another motion prevents a calibration, the result names another program as the cause.

    Before SB (gyro calibration), the driver checks the IMU. The server refuses this check, because
    another motion is in progress.
    """
    bench = MartBench().ready()
    real = bench.robot.receive

    def receive(data: bytes, now: float, channel: int) -> None:
        if data == b"RST IMU":
            refusal = b"fail conflicting action in progress"
            bench.robot.network[0].from_board.send(refusal, bench.robot.board.now_s)
        else:
            real(data, now, channel)

    bench.robot.receive = receive  # type: ignore[method-assign]
    done = bench.job(Job.BIAS)
    assert not done.success
    assert "conflicting action in progress" in done.message
    assert "another program" in done.message
