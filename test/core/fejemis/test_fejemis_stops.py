# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of e-stop and pause, and of the refusals while the boards are silent."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, nominal

from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.requests import Request, RequestDone
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware


def without_relays(lines: list[str]) -> list[str]:
    return [text for text in lines if not text.startswith(("fwl", "hcsr", "sub"))]


@pytest.mark.slow
@pytest.mark.parametrize("resumes", [False, True])
def test_an_estop_is_said_to_both_and_released_on_drive_alone(*, resumes: bool) -> None:
    """An e-stop stops both boards, but its release sends ``start`` to the drive board only.

    Before ``start``, the driver sends Stop, because some firmware resumes the old motion after
    ``start``.
    """
    bench = nominal(Simulated(firmware=Firmware(start_resumes=resumes)))
    bench.drive_on()
    mark = bench.now
    bench.estop(True)
    assert bench.lines(DRIVE, mark)[:2] == ["stop", "rc 2 0 0"]
    assert bench.lines(FRONT, mark)[:3] == ["motv 0 0", "brush 0", "rc 2 0 0"]
    bench.run(2.0)
    assert bench.robot.standing
    assert bench.robot.drive.source == -1
    said = [at for at, to, data in bench.written if at > mark and to == DRIVE and b"stop" in data]
    assert len(said) >= 37
    mark = bench.now
    bench.estop(False)
    bench.run(1.5)
    drive = without_relays(bench.lines(DRIVE, mark))
    assert drive.index("rc 2 0 0") < drive.index("start")
    assert "start" not in bench.lines(FRONT)[-200:]
    assert bench.robot.standing
    assert bench.session.state == "nominal"
    bench.drive_on()
    assert not bench.robot.standing


def test_the_stop_of_an_estop_is_a_word_alone() -> None:
    """For an e-stop, the driver sends the word ``stop`` without padding.

    Some related firmware accepts only the bare word.
    """
    bench = nominal()
    mark = bench.now
    bench.estop(True)
    said = [data for at, to, data in bench.written if at >= mark and to == DRIVE]
    assert b"\n;59stop\n" in b"".join(said)


@pytest.mark.slow
def test_a_lost_start_after_an_estop_is_said_again() -> None:
    """The line ``start``, which the driver sends after the release of an e-stop, is lost.

    The driver repeats this line until a heartbeat shows its effect.
    """
    bench = nominal()
    bench.estop(True)
    bench.run(1.0)
    bench.hears = {FRONT}
    bench.estop(False)
    bench.run(3.0)
    assert bench.session.state == "paused"
    bench.hears = {DRIVE, FRONT}
    bench.run_until(lambda: bench.session.state == "nominal", 2.0)
    bench.run(0.5)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.slow
def test_a_pause_is_proved_by_the_source_in_the_heartbeat() -> None:
    """A pause is proved when a heartbeat contains the command source -1 (rcSource).

    Then the e-stop is latched and released. This does not end the pause.
    """
    bench = nominal()
    bench.drive_on()
    answer = bench.ask(Request.PAUSE)
    assert answer.success
    assert bench.robot.drive.source == -1
    with pytest.raises(CommandRefused, match="paused"):
        bench.drive()
    bench.estop(True)
    bench.run(1.0)
    bench.estop(False)
    bench.run(2.0)
    assert bench.session.state == "paused"
    assert bench.ask(Request.START).success
    bench.run(0.3)
    bench.drive_on()
    assert not bench.robot.standing


def test_a_pause_survives_a_reconnect_and_the_release_of_an_estop() -> None:
    """A pause continues after a reconnect and after the release of an e-stop, until ~/start.

    The release does not send the line ``start``.
    """
    bench = nominal()
    bench.estop(True)
    bench.run(0.5)
    assert bench.ask(Request.PAUSE).success
    bench.close()
    bench.speaks = bench.hears = {DRIVE}
    bench.open(missing="the port 'front' is missing")
    bench.run(1.0)
    mark = bench.now
    bench.estop(False)
    bench.run(1.0)
    assert "start" not in bench.lines(DRIVE, mark)
    assert bench.robot.drive.source == -1


def test_a_board_that_is_stopped_when_the_driver_comes_is_started_or_left_alone() -> None:
    """The board is stopped when the driver connects.

    The driver starts it if ``auto_start`` is set. Otherwise it leaves the board stopped.
    """
    for run in (True, False):
        bench = Bench(run=run)
        bench.run(0.5)
        bench.robot.receive(b"stop\n", bench.now, DRIVE)
        bench.open()
        bench.run(3.0)
        assert bench.session.state == ("nominal" if run else "paused")


def test_boards_that_stay_silent_are_not_said_to_be_read_late() -> None:
    """The boards fall silent, and motion is refused: "read nothing from either board".

    A few seconds later, the refusal says that the boards send no data.
    """
    bench = nominal()
    bench.drive_on()
    bench.speaks.clear()
    bench.run(0.2)
    with pytest.raises(CommandRefused, match="read nothing from either board"):
        bench.drive()
    bench.run(4.0)
    with pytest.raises(CommandRefused, match="no data from the boards; check their power"):
        bench.drive()


def assert_the_estop_is_the_answer_and_the_pause_continues(
    bench: Bench, answer: RequestDone, mark: float
) -> None:
    """Check that ``answer`` is a failure because of the e-stop, and that the pause continues.

    No line ``start`` is sent from the time ``mark`` (in s) until the next ~/start, although the
    e-stop is released.
    """
    assert not answer.success
    assert "release it with ~/estop" in answer.message
    bench.estop(False)
    bench.run(2.0)
    assert "start" not in bench.lines(DRIVE, mark)
    assert bench.session.state == "paused"
    assert bench.ask(Request.START).success


def test_a_start_during_an_estop_is_answered_at_once_and_does_not_end_a_pause() -> None:
    """A ~/start of a paused robot during an e-stop fails at once, and its answer names the e-stop.

    The robot stays paused until the next ~/start.
    """
    bench = nominal()
    assert bench.ask(Request.PAUSE).success
    bench.estop(True)
    mark = bench.now
    answer = bench.ask(Request.START)
    assert bench.now - mark < 0.1
    assert_the_estop_is_the_answer_and_the_pause_continues(bench, answer, mark)


def test_an_estop_during_a_start_is_its_answer_and_the_pause_continues() -> None:
    """An e-stop makes an unconfirmed ~/start of a paused robot fail.

    The answer names the e-stop. The robot stays paused until the next ~/start.
    """
    bench = nominal()
    assert bench.ask(Request.PAUSE).success
    token = object()
    bench.session.request(Request.START, token, bench.now)
    bench.settle()
    bench.run(0.02)
    bench.estop(True)
    bench.run(0.1)
    (answer,) = (e for e in bench.events if isinstance(e, RequestDone) and e.token is token)
    assert_the_estop_is_the_answer_and_the_pause_continues(bench, answer, bench.now)


def test_a_start_of_a_driven_robot_interrupts_its_motion_only_for_a_moment() -> None:
    """A ~/start during a drive interrupts the motion only for a moment.

    The motion command follows ``start`` at once, before its regular repetition.
    """
    bench = nominal(commands=CommandSettings(timeout_s=60.0, rate_hz=1.0))
    bench.drive()
    bench.run(1.2)
    mark = bench.now
    bench.session.request(Request.START, None, bench.now)
    bench.settle()
    bench.run(0.02)
    rest = bench.lines(DRIVE, mark)
    rest = rest[rest.index("start") :]
    assert [text for text in rest if text.startswith("rc 2") and text != "rc 2 0 0"]
