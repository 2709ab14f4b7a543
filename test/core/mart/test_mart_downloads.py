# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the files that the controller sends: the log, and the records of moves and turns."""

import pytest
from mart_bench import MartBench

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.readings import JobDone
from omnibot_driver.core.packets import Packet
from omnibot_driver.simulator.mart import Firmware
from omnibot_driver.simulator.mart.files import FileNote


def test_a_missing_reply_to_a_cancelled_job_does_not_end_the_next_one() -> None:
    """The request for a download is lost, and a motion command cancels this download.

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
    """The controller has no file to download. The job fails with the reason, and with advice."""
    bench = MartBench().ready()
    for job, advice in ((Job.LAST_MOVE, "drive forward"), (Job.LAST_TURN, "turn the robot")):
        done = bench.job(job)
        assert not done.success
        assert "no file available" in done.message
        assert advice in done.message


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


def test_an_empty_datagram_is_no_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty datagram between two pieces of a file does not spoil the download.

    The file has two pieces of full size (512 bytes).
    """
    content = bytes(range(256)) * 2 + bytes(reversed(range(256))) * 2
    monkeypatch.setattr(FileNote, "content", content)
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    inner = bench.robot.advance

    def advance() -> list[tuple[int, bytes]]:
        out: list[tuple[int, bytes]] = []
        for channel, data in inner():
            out += [(channel, data)] + [(channel, b"")] * (len(data) == 512)
        return out

    bench.robot.advance = advance  # type: ignore[method-assign]
    done = bench.job(Job.LAST_MOVE)
    assert done.success, done
    assert done.content == content


def test_a_stop_within_the_download_of_the_log_says_that_the_server_has_ended() -> None:
    """A zero command cancels the download of the log after EXIT has ended the server.

    The result says that the server has ended, and that the user must copy the file from the
    controller.
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


def test_a_download_of_the_log_without_a_reply_does_not_ask_for_another_one() -> None:
    """The server does not answer EXIT, which downloads its log and ends the server.

    The result tells the user to copy the file from the controller, not to call again.
    """
    bench = MartBench().ready()
    assert bench.job(Job.LOG).success
    bench.speaks = False
    bench.board.ask(Job.LOG_FILE, "token", bench.now)
    bench.run_until(lambda: b"EXIT" in bench.said(), 5.0)
    bench.run(10.0)
    done = bench.extras(JobDone)[-1]
    assert not done.success
    assert "copy the file from the controller" in done.message
    assert "call again" not in done.message


@pytest.mark.slow
@pytest.mark.parametrize("firmware", ["documented", "firmware", "source"])
def test_a_log_is_downloaded_after_a_straight_drive(firmware: Firmware) -> None:
    """The log can be downloaded after a straight drive, when the heading is often zero.

    The driver does not take this for the zero of a restarted server, which has no log.
    """
    for seed in range(3):
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
    """The driver refuses to download the log of a restarted server, which has lost its log.

    The download would send EXIT, and the server would end without a log file.
    """
    bench = MartBench("source").ready()
    assert bench.job(Job.LOG).success
    bench.server.restart(1.0)
    bench.run(3.0)
    assert bench.session.state == "nominal"
    with pytest.raises(RequestRefused, match="start_log"):
        bench.board.ask(Job.LOG_FILE, "token", bench.now)


def test_a_lost_reply_to_a_stop_does_not_forget_the_log() -> None:
    """The log can still be downloaded after the reply to a stop was lost.

    The reply "no motion" to the repeated stop shows no restart, because the heading is not zero.
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


def with_a_copy_of_the_last_ok(bench: MartBench, job: Job) -> JobDone:
    """Return the result of ``job``. A copy of an earlier ``ok`` arrives before the job's replies.

    Each reply takes 0.1 s.
    """
    bench.board.ask(job, "token", bench.now)
    bench.run(0.01)  # the reply to the pending query comes
    inner, coming = bench.robot.advance, list[tuple[float, Packet]]()

    def advance() -> list[Packet]:
        coming.extend((bench.now + 0.1, packet) for packet in inner())
        out = []
        while coming and coming[0][0] <= bench.now:
            out.append(coming.pop(0)[1])
        return out

    bench.robot.advance = advance  # type: ignore[method-assign]
    bench.run(0.05)
    bench.session.inbound.receive(b"ok", bench.now, 0)
    bench.settle()
    bench.run(10.0)
    return bench.extras(JobDone)[-1]


def test_a_copy_of_an_earlier_ok_is_not_taken_for_the_log() -> None:
    """A gyro calibration ends with ``ok``, and EXIT requests the server's log at once.

    A copy of the ``ok`` arrives first. The driver ignores the copy, and downloads the log.
    """
    bench = MartBench().ready()
    assert bench.job(Job.LOG).success
    assert bench.job(Job.BIAS).success
    done = with_a_copy_of_the_last_ok(bench, Job.LOG_FILE)
    assert done.success, done
    assert done.content


def test_a_copy_of_an_earlier_ok_does_not_start_a_log() -> None:
    """LOG (start of a log) is lost, and a copy of an earlier ``ok`` arrives.

    The driver does not take the copy for the reply to LOG, so it refuses a download, which would
    end the server.
    """
    bench = MartBench().ready()
    assert bench.job(Job.BIAS).success
    inner = bench.robot.receive
    bench.robot.receive = lambda data, now, channel: (  # type: ignore[method-assign]
        None if data == b"LOG" else inner(data, now, channel)
    )
    assert not with_a_copy_of_the_last_ok(bench, Job.LOG).success
    with pytest.raises(RequestRefused, match="start_log"):
        bench.board.ask(Job.LOG_FILE, "token", bench.now)


def test_a_server_that_ends_without_a_file_has_not_sent_its_log() -> None:
    """Without a log, the server answers EXIT (download of the log) only by ``ok``, and ends.

    The download fails, and its result says that no file came.
    """
    bench = MartBench("documented").ready()
    assert bench.job(Job.LOG).success
    bench.server.log = None
    done = bench.job(Job.LOG_FILE)
    assert bench.server.crashed
    assert not done.success
    assert "sent no file" in done.message


FIRST, SECOND = bytes(range(256)) * 2, bytes(reversed(range(256))) * 2


def with_swapped_pieces(bench: MartBench) -> None:
    """Let the bench swap the datagrams FIRST and SECOND once, when both arrive in the same step."""
    inner, swapped = bench.robot.advance, []

    def advance() -> list[Packet]:
        out = inner()
        if not swapped and {FIRST, SECOND} <= {data for _, data in out}:
            swapped.append(True)
            a, b = out.index((0, FIRST)), out.index((0, SECOND))
            out[a], out[b] = out[b], out[a]
        return out

    bench.robot.advance = advance  # type: ignore[method-assign]


def test_a_file_whose_pieces_were_swapped_is_not_saved(monkeypatch: pytest.MonkeyPatch) -> None:
    """A job downloads a file twice, and fails because the contents differ. The next job succeeds.

    In one of the first two downloads, two full pieces are swapped.
    """
    monkeypatch.setattr(FileNote, "content", FIRST + SECOND + b"end")
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    with_swapped_pieces(bench)
    done = bench.job(Job.LAST_MOVE)
    assert not done.success
    assert "two downloads" in done.message
    done = bench.job(Job.LAST_MOVE)
    assert done.content == FIRST + SECOND + b"end", done


def test_a_file_with_equal_pieces_is_downloaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file with two equal full pieces is downloaded."""
    monkeypatch.setattr(FileNote, "content", FIRST + FIRST + b"end")
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    done = bench.job(Job.LAST_MOVE)
    assert done.content == FIRST + FIRST + b"end", done


@pytest.mark.parametrize("full", [1, 3])
def test_a_file_whose_lengths_show_its_order_is_downloaded_once(
    full: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file has one full piece and a shorter one, so its order is certain after one download.

    A file with three full pieces is downloaded twice.
    """
    monkeypatch.setattr(FileNote, "content", full * FIRST + b"end")
    bench = MartBench().ready()
    bench.command(0.3, 0.0, 2.0)
    bench.run(3.0)
    assert bench.job(Job.LAST_MOVE).success
    assert bench.said().count(b"LAST MOVE") == (1 if full == 1 else 2)


@pytest.mark.parametrize("lines", [1, 40])
def test_a_log_of_several_full_pieces_has_no_proof_of_its_order(lines: int) -> None:
    """The server ends after it has sent its log, so the driver cannot compare two downloads.

    The answer says that the order of a long log is not proved.
    """
    bench = MartBench().ready()
    assert bench.job(Job.LOG).success
    assert bench.server.log is not None
    bench.server.log += [f"{line:60}" for line in range(lines)]
    done = bench.job(Job.LOG_FILE)
    assert done.success, done
    assert ("may be in a wrong order" in done.message) is (lines == 40)
