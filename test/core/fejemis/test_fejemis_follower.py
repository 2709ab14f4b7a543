# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the faults of a front wheel that does not turn to its commanded angle."""

import contextlib
import math

import pytest
from fejemis_bench import Bench, nominal

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.follower import UNTIL_IT_MOVES, UNTIL_START, Follower
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware, vehicle

TICK_S = 0.015


def blocked(follower: Follower, since: float, angle_rad: float = 0.0) -> float:
    """Command 1.5 rad while the wheel stays at ``angle_rad``.

    Return the time, in s, at which the follower reports the fault.
    """
    follower.aim(1.5)
    for n in range(200):
        if follower.look(angle_rad, since + TICK_S * n):
            return since + TICK_S * n
    raise AssertionError("not noticed")


def test_a_wheel_that_does_not_follow_is_noticed_once() -> None:
    """A blocked wheel is reported once.

    A wheel that approaches its angle slowly is not reported.
    """
    follower = Follower()
    follower.aim(1.5)
    assert not any(follower.look(0.015 * n, TICK_S * n) for n in range(100))
    follower.begin()
    follower.aim(1.5)
    assert sum(follower.look(0.0, TICK_S * n) for n in range(200)) == 1


def test_a_wheel_that_is_called_back_half_way_has_its_time_again() -> None:
    """The front wheel is commanded back before it has reached its angle. No fault is reported.

    The time limit begins again as soon as the wheel approaches its new angle.
    """
    follower = Follower()
    follower.aim(1.5)
    assert not any(follower.look(0.02 * n, TICK_S * n) for n in range(60))
    follower.aim(-1.5)
    assert not any(follower.look(1.2 - 0.02 * n, 0.9 + TICK_S * n) for n in range(130))


def test_a_blocked_wheel_is_noticed_although_its_angle_is_commanded_anew_each_time() -> None:
    """A wheel is blocked, and its commanded angle alternates between 0.9 and 1.5 rad.

    The fault is reported, although the commanded angle changes before the time limit.
    """
    follower = Follower()
    seen = 0
    for n in range(200):
        follower.aim(1.5 if n % 3 else 0.9)
        seen += follower.look(0.0, TICK_S * n)
    assert seen == 1


def test_motion_is_refused_until_the_wheel_has_moved() -> None:
    """The front wheel was stuck.

    Motion is refused until the wheel has turned by more than 3°. Otherwise, each new command would
    move the robot for 1 s.
    """
    follower = Follower()
    at = blocked(follower, 0.0)
    assert follower.refusal == UNTIL_IT_MOVES
    follower.begin()
    follower.look(math.radians(2.0), at + 1.0)
    assert follower.refusal
    follower.look(math.radians(4.0), at + 1.1)
    assert not follower.refusal


def test_after_a_second_fault_within_a_minute_only_a_start_helps() -> None:
    """The first fault ends when the wheel moves.

    A second fault within a minute ends only by ~/start.
    """
    follower = Follower()
    at = blocked(follower, 0.0)
    follower.look(1.0, at + 1.0)
    at = blocked(follower, at + 2.0)
    assert follower.refusal == UNTIL_START
    follower.look(1.0, at + 1.0)
    assert follower.refusal == UNTIL_START
    follower.start()
    assert not follower.refusal
    at = blocked(follower, at + 2.0)
    assert follower.refusal == UNTIL_IT_MOVES
    follower.look(1.0, at + 1.0)
    blocked(follower, at + 70.0)
    assert follower.refusal == UNTIL_IT_MOVES


def drive_whatever_is_said(bench: Bench, v: float, w: float, seconds: float) -> None:
    """Command a twist ten times a second for ``seconds``, and ignore refusals."""
    for _ in range(round(seconds / 0.1)):
        with contextlib.suppress(CommandRefused):
            bench.drive(v, w)
        bench.run(0.1)


@pytest.mark.slow
@pytest.mark.parametrize("w", [0.0, 0.3])
def test_a_clamped_reverse_is_stopped(w: float) -> None:
    """The driver stops a robot whose firmware limits the front wheel to 90° in reverse.

    Such a robot turns instead of reversing. A notice names ``allow_reverse``, and after the second
    stop, motion is refused until ~/start.
    """
    bench = nominal(
        Simulated(firmware=Firmware(reverse="clamped")), FejemisSettings(allow_reverse=True)
    )
    drive_whatever_is_said(bench, -0.2, w, 4.5)
    bench.run(1.0)
    assert bench.robot.standing
    assert math.hypot(bench.robot.truth.x_m, bench.robot.truth.y_m) < 0.12
    assert any("allow_reverse" in text for text in bench.notices)
    with pytest.raises(CommandRefused, match="second time within 60 s"):
        bench.drive(-0.2, w)
    assert bench.ask(Request.START).success
    bench.run(0.5)
    bench.drive_on(0.3)
    assert not bench.robot.standing


def test_a_wheel_that_rests_short_of_across_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turn on the spot needs a wheel angle near 90°, but the wheel stops at 82°.

    A notice says so.
    """
    monkeypatch.setattr(vehicle, "MECHANICAL_STOP_DEG", 82.0)
    bench = nominal()
    drive_whatever_is_said(bench, 0.0, 0.5, 4.0)
    assert bench.robot.standing
    assert any("does not go where it is commanded" in text for text in bench.notices)


@pytest.mark.slow
def test_a_turn_on_the_spot_continues_while_the_wheel_is_near_to_across(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A turn on the spot continues although the front wheel goes back from 90° to 82°."""
    bench = nominal()
    bench.drive_on(0.0, 0.5, seconds=2.0)
    monkeypatch.setattr(vehicle, "MECHANICAL_STOP_DEG", 82.0)
    bench.drive_on(0.0, 0.5, seconds=3.0)
    assert not bench.robot.standing
    assert bench.notices == []


@pytest.mark.slow
def test_a_wheel_refused_until_start_stays_refused_after_a_reconnect() -> None:
    """Motion that a fault forbids until ~/start is still refused after a reconnect.

    The driver itself starts the board after the reconnect, but this does not allow motion.
    """
    bench = nominal()
    bench.board._encoder.follower.refusal = UNTIL_START
    bench.close()
    bench.run(0.5)
    bench.open()
    bench.run_until(lambda: bench.session.state == "nominal")
    bench.run(4.0)
    with pytest.raises(CommandRefused, match="second time within 60 s"):
        bench.drive()
    assert bench.ask(Request.START).success
    bench.run(0.5)
    bench.drive_on()
    assert not bench.robot.standing
