# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the power off: how it is confirmed, what cancels it, and what does not."""

import pytest
from fejemis_bench import DRIVE, FRONT, Bench, ask, nominal

from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.jobs import whole_seconds
from omnibot_driver.core.fejemis.readings import (
    Job,
    JobDone,
)
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.requests import Request, RequestDone


@pytest.fixture
def bench() -> Bench:
    """Return a bench whose drive board has received the command to cut the power after 99 s."""
    bench = nominal(settings=FejemisSettings(power_off_delay_s=99.0))
    bench.board.services.ask(Job.POWER_OFF, None, bench.now)
    bench.settle()
    bench.run(2.0)
    (done,) = bench.extras(JobDone)
    assert done.success
    bench.events.clear()
    return bench


def assert_still_refused(bench: Bench) -> None:
    """Check that the drive board still counts down to the power off and that motion is refused."""
    assert bench.robot.drive.off_at_s is not None
    with pytest.raises(CommandRefused, match="call ~/start"):
        bench.drive()
    with pytest.raises(RequestRefused, match="call ~/start"):
        bench.board.services.set_brush(True, bench.now)
    with pytest.raises(CommandRefused, match="call ~/start"):
        bench.board.services.lift(3.0, bench.now)


def test_a_start_during_an_estop_cancels_the_power_off(bench: Bench) -> None:
    """A power off is pending, and the user calls ~/start during an e-stop.

    The driver sends ``on``, so the power off is cancelled. The driver does not send ``start``
    during the e-stop.
    """
    bench.estop(True)
    bench.session.request(Request.START, None, bench.now)
    bench.settle()
    bench.run(0.1)
    assert bench.robot.drive.off_at_s is None


@pytest.mark.parametrize("closes", [False, True])
def test_the_end_of_a_job_does_not_confirm_a_start(*, closes: bool) -> None:
    """The user requests a power off, and the boards become silent. Then the user calls ~/start.

    The power off fails, and ~/start is not confirmed. ``closes``: whether the ports close right
    after the call of ~/start.
    """
    bench = nominal()
    bench.board.services.ask(Job.POWER_OFF, None, bench.now)
    bench.settle()
    bench.run(0.3)
    bench.speaks = set()
    bench.run(0.1)
    bench.session.request(Request.START, token := object(), bench.now)
    if closes:
        bench.close()
    bench.settle()
    bench.run(0.5)
    assert [done.success for done in bench.extras(JobDone)] == [False]
    answers = [e for e in bench.events if isinstance(e, RequestDone) and e.token is token]
    assert not any(answer.success for answer in answers)


def test_the_line_that_cancels_a_power_off_is_sent_three_times(bench: Bench) -> None:
    """The line ``on`` cancels a power off. The board does not confirm this line, which may be lost.

    So the driver sends it three times.
    """
    mark = bench.now
    bench.hears = {FRONT}
    bench.session.request(Request.START, None, bench.now)
    bench.settle()
    bench.run(0.2)
    bench.hears = {DRIVE, FRONT}
    bench.run(3.0)
    assert bench.lines(DRIVE, mark).count("on") == 3
    assert bench.robot.drive.off_at_s is None


def test_a_power_off_after_a_start_is_not_cancelled_by_it(bench: Bench) -> None:
    """A ~/start does not cancel a later ~/power_off.

    The driver stops repeating the line ``on`` of ~/start, which would cancel the power off.
    """
    assert bench.ask(Request.START).success
    bench.board.services.ask(Job.POWER_OFF, None, bench.now)
    bench.settle()
    bench.run(3.0)
    assert_still_refused(bench)


@pytest.mark.slow
def test_a_silence_does_not_cancel_a_power_off(bench: Bench) -> None:
    """The boards are silent for a while after a requested power off.

    The driver then sends ``start``, but this does not cancel the power off.
    """
    mark = bench.now
    bench.speaks = set()
    bench.run(2.5)
    bench.speaks = {DRIVE, FRONT}
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(4.0)
    assert "start" in bench.lines(DRIVE, mark)
    assert "on" not in bench.lines(DRIVE, mark)
    assert_still_refused(bench)


@pytest.mark.slow
def test_a_reconnect_does_not_cancel_a_power_off(bench: Bench) -> None:
    """The driver reconnects after a requested power off.

    The drive board still counts down, and motion is still refused.
    """
    bench.close()
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(4.0)
    assert_still_refused(bench)


@pytest.mark.slow
def test_a_power_off_is_forgotten_if_the_drive_board_restarts_while_not_connected(
    bench: Bench,
) -> None:
    """A power off is forgotten if the drive board restarts between two connections.

    The board's clock shows the restart, and the driver accepts motion again.
    """
    bench.run(1.5)
    bench.close()
    bench.speaks = set()
    bench.robot.drive.reboot()
    bench.run(2.0)
    bench.speaks = {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(2.0)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.slow
def test_a_power_off_is_forgotten_if_both_boards_restart_and_come_back_in_the_other_order(
    bench: Bench,
) -> None:
    """A power off is pending.

    Both boards restart unseen, and come back at exchanged ports. The driver recognizes the restarts
    by the boards' times, and allows motion again.
    """
    bench.close()
    bench.speaks = set()
    bench.robot.drive.reboot()
    bench.robot.front.reboot()
    bench.robot._at_port = bench.robot._at_port[::-1]
    bench.run(1.0)
    bench.speaks = {DRIVE, FRONT}
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(0.5)
    for half in ("drive", "front"):
        assert any(f"the {half} board has restarted" in text for text in bench.notices)
    bench.drive_on(seconds=0.3)
    assert not bench.robot.standing


@pytest.mark.slow
def test_a_restart_of_the_front_board_does_not_fail_a_power_off() -> None:
    """The front board restarts after a request to power off. Only the drive board cuts the power.

    The request succeeds, and motion is refused.
    """
    bench = nominal(settings=FejemisSettings(power_off_delay_s=99.0))
    bench.board.services.ask(Job.POWER_OFF, None, bench.now)
    bench.settle()
    bench.run(0.1)
    bench.robot.front.reboot()
    bench.run(3.0)
    assert any("front board has restarted" in text for text in bench.notices)
    (done,) = bench.extras(JobDone)
    assert done.success
    assert_still_refused(bench)


@pytest.mark.slow
def test_a_power_off_without_an_answer_may_still_come() -> None:
    """The board does not answer a request to power off. The request fails.

    Motion is refused until ~/start, because the board may have obeyed.
    """
    bench = nominal(settings=FejemisSettings(power_off_delay_s=99.0))
    bench.speaks = {FRONT}
    done = ask(bench, Job.POWER_OFF, 9.0)
    assert not done.success
    assert "call ~/start" in done.message
    bench.speaks = {DRIVE, FRONT}
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(4.0)
    assert_still_refused(bench)
    assert bench.ask(Request.START).success
    bench.run(1.0)
    assert bench.robot.drive.off_at_s is None
    bench.drive_on()
    assert not bench.robot.standing


def test_a_power_off_that_no_board_confirms_does_not_claim_to_happen() -> None:
    """The drive board receives no power-off command, but sends heartbeats.

    The driver's answer to the user contains "does not confirm".
    """
    bench = nominal()
    bench.hears.clear()
    assert "does not confirm" in ask(bench, Job.POWER_OFF, 5.0).message


@pytest.mark.slow
def test_power_off_is_called_back_by_a_start() -> None:
    """After a request to power off, motion, brush and lift are refused until ~/start cancels it."""
    bench = nominal(settings=FejemisSettings(power_off_delay_s=5.0))
    done = ask(bench, Job.POWER_OFF)
    assert done.success
    assert "5 s" in done.message
    assert "power" in bench.board.refusal
    with pytest.raises(RequestRefused, match="call ~/start"):
        bench.board.services.set_brush(True, bench.now)
    with pytest.raises(CommandRefused, match="call ~/start"):
        bench.board.services.lift(3.0, bench.now)
    assert bench.ask(Request.START).success
    bench.run(6.0)
    assert bench.robot.drive.powered
    assert not bench.board.refusal


@pytest.mark.slow
def test_power_off_cuts_the_power() -> None:
    """The user requests a power off. The board cuts its power after the configured delay."""
    bench = nominal(settings=FejemisSettings(power_off_delay_s=4.0))
    assert ask(bench, Job.POWER_OFF).success
    bench.run(4.0)
    assert not bench.robot.drive.powered


@pytest.mark.slow
def test_a_drive_board_that_restarts_has_forgotten_the_power_off() -> None:
    """After a request to power off, the drive board restarts. The restart cancels the power off.

    The driver accepts motion again.
    """
    bench = nominal(settings=FejemisSettings(power_off_delay_s=100.0))
    assert ask(bench, Job.POWER_OFF).success
    with pytest.raises(CommandRefused, match="power"):
        bench.drive()
    bench.robot.drive.reboot()
    bench.run(2.5)
    bench.drive_on()
    assert not bench.robot.standing


@pytest.mark.parametrize(
    ("wanted_s", "seconds"), [(10.0, 10), (0.2, 1), (300.0, 311), (12.0, 13), (120.0, 131)]
)
def test_a_power_off_waits_no_less_whichever_two_digits_are_lost(
    wanted_s: float, seconds: int
) -> None:
    """For a power off, the driver sends a delay whose checksum shows the loss of any two digits.

    The delay may be longer than wanted: 311 s instead of 300 s.
    """
    assert whole_seconds(wanted_s) == seconds
