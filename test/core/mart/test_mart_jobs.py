# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of requests other than motion: gyro bias, docking, log, files and clock."""

import calendar
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mart_bench import MartBench

from omnibot_driver.boards.mart_clock import clock_fields
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.mart.goal import docking_inches
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.mart import Firmware


def test_the_gyro_is_calibrated_at_rest() -> None:
    """The driver sends SB to calibrate the gyro. The job succeeds when the server replies."""
    done = MartBench().ready().job(Job.BIAS)
    assert (done.token, done.success) == ("token", True)


@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_the_gyro_is_not_calibrated_with_a_dead_imu(firmware: Firmware) -> None:
    """With a dead IMU the server would never answer SB, nor any later command.

    So the job fails, and the driver does not send SB.
    """
    bench = MartBench(firmware).ready()
    bench.server.imu.alive = False
    done = bench.job(Job.BIAS)
    assert not done.success
    assert "IMU" in done.message
    assert b"SB" not in bench.said()
    assert not bench.server.blocked


def test_a_job_ends_with_the_reason_that_ended_it() -> None:
    """The server falls silent, or the e-stop is latched, or a command comes in a calibration."""
    bench = MartBench().ready()
    bench.hears = bench.speaks = False
    assert "no longer answers" in bench.job(Job.BIAS).message
    for estop, reason in ((True, "e-stop was latched"), (False, "end the commands")):
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


def test_docking_ends_at_the_dock_or_with_a_sentence() -> None:
    """A docking job sends a move that ends at the dock (TF DOCK). It succeeds at the dock.

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

    A controlled move is longer than requested, so the driver requests less. Obstacles do not stop
    docking.
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
    """The reply to the docking move is lost.

    The driver stops the robot, and accepts the next job.
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


def test_a_missing_reply_to_a_cancelled_job_does_not_end_the_next_one() -> None:
    """The request of a download is lost, and a command cancels this download.

    The next download succeeds.
    """
    bench = MartBench().ready()
    bench.command(0.0, 0.5, 2.0)
    bench.run(3.0)
    inner = bench.robot.receive
    bench.robot.receive = lambda data, now, channel: (  # type: ignore[method-assign]
        None if data == b"LAST MOVE" else inner(data, now, channel)
    )
    bench.board.ask(Job.LAST_MOVE, "first", bench.now)
    bench.run_until(lambda: b"LAST MOVE" in bench.said(), 5.0)
    bench.try_command(0.0, 0.0)
    bench.run(1.0)
    done = bench.job(Job.LAST_TURN)
    assert done.success, done


def test_the_last_move_and_turn_are_downloaded_whole() -> None:
    """The driver downloads the files of the last move and turn, in pieces of 512 bytes."""
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.command(0.0, 0.5, 2.0)
    bench.run(3.0)
    for job in (Job.LAST_MOVE, Job.LAST_TURN):
        done = bench.job(job)
        assert done.success, done
        assert done.content == bench.server.files[done.name.rpartition("/")[2]].content


def test_nothing_to_download_is_told() -> None:
    """The controller has no file to download. The job fails with the controller's reason."""
    done = MartBench().ready().job(Job.LAST_MOVE)
    assert not done.success
    assert "no file available" in done.message


@pytest.mark.parametrize("spoil", ["lose", "double"])
def test_a_piece_that_is_lost_or_comes_twice_spoils_the_file(spoil: str) -> None:
    """A piece of a file is lost or comes twice. The download fails, and names the cause."""
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    inner, pieces = bench.robot.advance, 0

    def advance() -> list[tuple[int, bytes]]:
        nonlocal pieces
        out: list[tuple[int, bytes]] = []
        for packet in inner():
            pieces += len(packet[1]) == 512
            second = len(packet[1]) == 512 and pieces == 2
            out += [packet] * ((0 if spoil == "lose" else 2) if second else 1)
        return out

    bench.robot.advance = advance  # type: ignore[method-assign]
    done = bench.job(Job.LAST_MOVE)
    assert not done.success
    assert ("lost" if spoil == "lose" else "twice") in done.message


def test_a_last_piece_that_comes_too_early_spoils_the_file() -> None:
    """Only the last piece of a file is shorter than the others.

    An earlier short piece shows a wrong order, so the download fails.
    """
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    inner = bench.robot.advance

    def advance() -> list[tuple[int, bytes]]:
        return sorted(inner(), key=lambda packet: len(packet[1]) == 512)

    bench.robot.advance = advance  # type: ignore[method-assign]
    done = bench.job(Job.LAST_MOVE)
    assert not done.success
    assert "order" in done.message


@pytest.mark.parametrize("job", [Job.BIAS, Job.LAST_MOVE])
def test_a_job_ends_when_the_port_is_lost(job: Job) -> None:
    """The port is lost during a job. The job fails at once, even if the port never comes back."""
    bench = MartBench().ready()
    bench.board.ask(job, "token", bench.now)
    bench.run(0.02)
    bench.close()
    (done,) = bench.extras(JobDone)
    assert not done.success
    assert "port" in done.message


def test_a_stop_within_the_download_of_the_log_says_that_the_server_has_ended() -> None:
    """A download of the log sends EXIT, which ends the server. A stop then interrupts the download.

    The job's result asks the user to copy the file from the controller.
    """
    bench = MartBench().ready()
    assert bench.job(Job.LOG).success
    bench.board.ask(Job.LOG_FILE, "token", bench.now)
    bench.run_until(lambda: b"EXIT" in bench.said(), 5.0)
    bench.try_command(0.0, 0.0)
    bench.run(0.1)
    done = bench.extras(JobDone)[-1]
    assert not done.success
    assert "copy the file from the controller" in done.message


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_a_log_is_downloaded_after_a_straight_drive(firmware: Firmware) -> None:
    """After a straight drive, the heading is often exactly zero, as after a restart.

    A restart would lose the log. The driver does not assume a restart, so the log can be
    downloaded.
    """
    for seed in range(6):
        bench = MartBench(firmware, seed=seed).ready()
        assert bench.job(Job.LOG).success
        bench.command(0.3, 0.0, 2.0)
        bench.run(3.0)
        assert bench.job(Job.LOG_FILE).success, seed


def test_only_a_log_that_was_started_ends_the_server() -> None:
    """The log can be downloaded only after it was started.

    The download sends EXIT and ends the server, so the controller must be started again.
    """
    bench = MartBench().ready()
    with pytest.raises(RequestRefused, match="start_log"):
        bench.board.ask(Job.LOG_FILE, "token", bench.now)
    assert bench.job(Job.LOG).success
    done = bench.job(Job.LOG_FILE)
    assert done.success
    assert "must be started again" in done.message
    assert bench.server.crashed == "EXIT"
    assert bench.said().count(b"EXIT") == 1
    bench.run(5.0)
    assert bench.session.state == "connecting"


def test_a_log_is_not_expected_of_a_server_that_was_restarted() -> None:
    """A server is restarted and has lost its log. The driver refuses the download of the log.

    The download needs EXIT, which would end the server without a file.
    """
    bench = MartBench("source").ready()
    assert bench.job(Job.LOG).success
    bench.server.restart(1.0)
    bench.run(3.0)
    assert bench.session.state == "nominal"
    with pytest.raises(RequestRefused, match="start_log"):
        bench.board.ask(Job.LOG_FILE, "token", bench.now)


def test_a_lost_reply_to_a_stop_does_not_forget_the_log() -> None:
    """The reply to a stop is lost, and the repeated stop finds no motion, as after a restart.

    A restart would lose the log. But the heading is not zero, so the server was not restarted, and
    the log can still be downloaded.
    """
    bench = MartBench("source").ready()
    assert bench.job(Job.LOG).success
    bench.command(0.3, 0.3, 2.0)
    advance, lost = bench.robot.advance, []

    def lose() -> list[Packet]:
        out = advance()
        if not lost and bench.said()[-1:] == [b"SRM"] and (0, b"ok") in out:
            lost.append(out.remove((0, b"ok")))
        return out

    bench.robot.advance = lose  # type: ignore[method-assign]
    bench.command(0.0, 0.0, 4.0)
    assert lost
    assert bench.job(Job.LOG_FILE).success


def test_the_setting_of_the_clock_gives_way_to_the_users_first_job() -> None:
    """A server has just appeared, and the driver wants to set its clock.

    A user's job comes first.
    """
    bench = MartBench()
    bench.open()
    bench.run_until(lambda: bench.board.resting, 30.0)
    bench.board.ask(Job.TIME, None, bench.now, *clock_fields(0.0, may_set_back=True))
    assert bench.job(Job.BIAS).success


def test_the_clock_is_set_while_the_robot_stands() -> None:
    """The driver sets the clock with TIME and six numbers, in UTC.

    During a drive it does not set the clock.
    """
    bench = MartBench().ready()
    assert bench.job(Job.TIME, 11, 22, 2026, 20, 15, 30).success
    assert b"TIME 11 22 2026 20 15 30" in bench.said()
    assert not bench.server.crashed
    bench.command(0.3, 0.0, 1.0)
    bench.board.ask(Job.TIME, "token", bench.now, 1, 1, 2027, 0, 0, 0)
    bench.command(0.3, 0.0, 1.0)
    assert b"TIME 1 1 2027 0 0 0" not in bench.said()


@given(st.floats(0.0, 4e9))
def test_after_a_drive_a_correct_clock_is_not_set_back(now_s: float) -> None:
    """After a drive, the driver never sets a correct clock back.

    The server ignores the seconds, so the clock can only be set to a full minute. The driver sends
    the next full minute shortly before it begins.
    """
    fields = clock_fields(now_s, may_set_back=False)
    assert (fields is None) is (int(now_s) % 60 not in (56, 57, 58))
    if fields is not None:
        month, day, year, hour, minute, _second = fields
        set_s = calendar.timegm((year, month, day, hour, minute, 0))
        assert now_s + 1.0 < set_s < now_s + 4.1


def test_a_clock_that_may_be_set_back_is_set_at_once() -> None:
    """The server's clock may be set back, because no drive has used it yet.

    The clock is set at once, to the present date and time in UTC.
    """
    assert clock_fields(1_700_000_000.0, may_set_back=True) == (11, 14, 2023, 22, 13, 20)


def test_a_clock_that_is_set_back_between_two_drives_costs_one_start() -> None:
    """The server's clock is set back. So the next forward drive (RM) reports about 1e15 degrees.

    The driver repeats the start once.
    """
    bench = MartBench("source").ready()
    assert bench.board.is_fresh
    bench.command(0.3, 0.3, 2.0)
    bench.run(2.0)
    assert not bench.board.is_fresh
    assert bench.job(Job.TIME, 1, 1, 1999, 0, 0, 0).success
    bench.command(0.3, 0.3, 5.0)
    assert bench.robot.board.facts["yaw_rate_radps"] == pytest.approx(0.3, rel=0.05)
    assert sum("clock" in notice for notice in bench.notices) == 1
    assert len(bench.notices) == 1
    bench.run(2.0)
    assert bench.error.way_m < 0.05
    assert abs(math.remainder(bench.error.yaw_rad, math.tau)) < 0.05


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
