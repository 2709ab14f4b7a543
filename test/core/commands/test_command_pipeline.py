# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of motion commands through a session to a simulated board.

They test changes of the commanding topic, ramps, stamps and limits.
"""

import itertools
import math
from dataclasses import replace

import pytest
from session_bench import STOP, Bench, bare

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.orders import Drive
from omnibot_driver.core.commands.set_point_stream import PACE_S
from omnibot_driver.core.commands.set_points import BaseSetpoint
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import OdometryNoise
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.simulator.omnibot import BoardSettings

GENTLE = SpeedLimits(linear_mps2=1.0, angular_radps2=2.0)


def running(**options: object) -> Bench:
    """Return a bench whose robot is at rest.

    Its board runs, and the driver no longer sends Stop.
    """
    bench = Bench(BoardSettings(running=True), **options)  # type: ignore[arg-type]
    bench.open()
    bench.run_until_state("nominal")
    bench.run(1.5)
    return bench


@pytest.fixture
def bench() -> Bench:
    return running()


def velocities(bench: Bench, mark: int) -> list[tuple[float, list[int]]]:
    """Return each Stop and base velocity (mode 1) as its time in s and its three 16-bit numbers.

    ``mark``: index of the first written packet to look at.
    """
    frames = [(at, data[-9:]) for at, data in bench.written[mark:]]
    return [
        (at, [int.from_bytes(data[n : n + 2], "big", signed=True) for n in (3, 5, 7)])
        for at, data in frames
        if data[-7] == 1 or data == STOP
    ]


def test_wheels_after_the_base_are_stopped_in_between(bench: Bench) -> None:
    """The user commands the base, then the wheels, then the base.

    Each change begins with a Stop.
    """
    bench.drive(0.3)
    bench.run(0.1)
    start = len(bench.written)
    bench.turn_wheels(10.0, 10.0, 10.0)
    bench.run(0.02)
    bench.drive(0.3)
    bench.run(0.02)
    assert [bare(data).hex(" ") for _, data in bench.written[start:]] == [
        "ff fe 02 00 00 00 00 00 00",
        "ff fe 02 00 14 00 14 00 14",
        "ff fe 02 00 00 00 00 00 00",
        "ff fe 01 00 15 00 00 00 00",
    ]


def notices(bench: Bench) -> list[str]:
    return [event.text for event in bench.events if isinstance(event, Notice)]


def test_what_the_base_cannot_do_is_set_to_zero_and_said_once(bench: Bench) -> None:
    """A diagonal motion is commanded to a base that cannot move sideways.

    The base drives forward only, and one notice says so. A command with NaN is rejected.
    """
    noise = OdometryNoise(wheels=DifferentialKinematics(wheel_radius_m=1.0, track_m=0.4))
    settings = replace(bench.settings, odometry=OdometrySettings(noise=noise))
    bench.session.configure(settings, bench.now)
    start = len(bench.written)
    for _ in range(2):
        bench.session.command_twist(BodyTwist(0.4, 0.4, 0.0), bench.now)
        bench.settle()
        bench.run(0.1)
    assert {tuple(words) for _, words in velocities(bench, start)} == {(28, 0, 0)}
    assert [text for text in notices(bench) if "sideways speed is set to zero" in text] == [
        "cmd_vel: sideways speed is set to zero; this base cannot move sideways (reported once)"
    ]
    with pytest.raises(CommandRefused, match="NaN"):
        bench.session.command_twist(BodyTwist(0.1, math.nan, 0.0), bench.now)


def test_a_velocity_out_of_the_plane_is_said_once(bench: Bench) -> None:
    """A command has values in linear.z, angular.x or angular.y.

    The driver sets them to zero and says so once. It obeys the other values of the command.
    """
    for _ in range(2):
        bench.session.command_twist(BodyTwist(0.4, 0.0, 0.0), bench.now, planar=False)
        bench.settle()
        bench.run(0.1)
    assert bench.board.commands[-1].values == (28, 0, 0)
    (said,) = [text for text in notices(bench) if "set to zero" in text]
    assert said.startswith("cmd_vel: linear.z, angular.x and angular.y are set to zero")


def test_a_refused_command_does_not_take_the_authority(bench: Bench) -> None:
    """The driver refuses a wheel command while the base is driven.

    The base drives on without a Stop.
    """
    bench.drive(0.3)
    start = len(bench.written)
    with pytest.raises(CommandRefused):
        bench.session.command_wheels((1.0, 2.0), bench.now)
    bench.run(0.2)
    assert STOP not in [data for _, data in bench.written[start:]]


def test_a_step_is_ramped_with_its_direction_kept() -> None:
    """A step to (0.3, 0.4) m/s is ramped at the limit of 1 m/s², always in the same direction."""
    bench = running(limits=GENTLE)
    start, begun = len(bench.written), bench.now
    for _ in range(6):
        bench.drive(0.3, 0.4)
        bench.run(0.1)
    sent = velocities(bench, start)
    times = [at - begun for at, _ in sent]
    assert times[:25] == pytest.approx([0.02 * n for n in range(25)])
    for at, (vx, vy, yaw_rate) in sent[:25]:
        speed = min(0.5, 1.0 * (at - begun + PACE_S))
        assert (vx, vy) == pytest.approx((70 * 0.6 * speed, 70 * 0.8 * speed), abs=0.51)
        assert yaw_rate == 0
    assert sent[-1][1] == [21, 28, 0]


@pytest.mark.parametrize("every_ms", [1, 5, 10, 18])
def test_a_ramp_is_as_steep_however_often_it_is_commanded(every_ms: int) -> None:
    """The same velocity is commanded every 1, 5, 10 or 18 ms. Each command continues the ramp.

    The ramp has the same slope in all cases.
    """
    motion = None
    for now_ms in range(301):
        now, wanted = now_ms / 1000, BodyTwist(0.5, 0.0, 0.0)
        if now_ms % every_ms == 0:
            motion = BaseSetpoint(
                wanted, GENTLE, lambda _order: False, before=motion, since=now - PACE_S
            )
        if now_ms % 18 == 0:
            assert motion is not None
            order = motion.order(now)
    assert isinstance(order, Drive)
    assert order.twist.vx_mps == pytest.approx(0.298, abs=0.001)


def test_a_reversal_is_ramped_through_zero() -> None:
    """A reversal is ramped through zero, never faster than the acceleration limit allows."""
    bench = running(limits=GENTLE)
    for _ in range(8):
        bench.drive(0.5)
        bench.run(0.1)
    start = len(bench.written)
    for _ in range(12):
        bench.drive(-0.5)
        bench.run(0.1)
    words = [vx for _, (vx, _, _) in velocities(bench, start)]
    assert words[0] > 30
    assert words[-1] == -35
    assert all(0 <= before - after <= 2 for before, after in itertools.pairwise(words))


def test_turning_is_ramped_by_its_own_limit() -> None:
    """A turn rate of 0.5 rad/s (250 LSB) is reached after 0.25 s, at the limit of 2 rad/s²."""
    bench = running(limits=GENTLE)
    start = len(bench.written)
    bench.drive(0.0, 0.0, 0.5)
    bench.run(0.3)
    words = [yaw_rate for _, (_, _, yaw_rate) in velocities(bench, start)]
    assert words[:3] == [10, 30, 50]  # one tick of the bench is 10 ms
    assert words[13] == words[-1] == 250


def test_a_zero_command_is_stop_at_once_and_no_ramp() -> None:
    """A zero command is sent as Stop, without a ramp: a person may be in front of the robot."""
    bench = running(limits=GENTLE)
    for _ in range(8):
        bench.drive(0.5)
        bench.run(0.1)
    start = len(bench.written)
    bench.drive()
    assert bench.written_since(start) == STOP


@pytest.mark.slow
def test_what_comes_after_a_stop_begins_at_rest() -> None:
    """After a timeout, an e-stop or a zero command, the ramp of the next command begins at zero."""
    bench = running(limits=GENTLE)
    for stop in (
        lambda: bench.run(1.0),
        lambda: bench.drive(),
        lambda: (bench.session.estop(True, bench.now), bench.session.estop(False, bench.now)),
    ):
        for _ in range(8):
            bench.drive(0.5)
            bench.run(0.1)
        stop()
        bench.run(0.02)
        start = len(bench.written)
        bench.drive(0.5)
        assert velocities(bench, start)[0][1] == [1, 0, 0]
        bench.run(1.0)


def test_wheels_are_not_ramped() -> None:
    """Wheel rates are commanded from rest, and sent at once.

    Acceleration limits apply only to velocities of the base.
    """
    bench = running(limits=GENTLE)
    start = len(bench.written)
    bench.turn_wheels(10.0, 0.0, 0.0)
    assert bare(bench.written_since(start)).hex(" ") == "ff fe 02 00 14 00 00 00 00"


def test_a_stamped_command_expires_by_its_stamp(bench: Bench) -> None:
    """The stamp of a command is 0.3 s old on arrival, and the timeout is 0.5 s.

    The command expires 0.2 s after its arrival.
    """
    bench.drive(0.3, age_s=0.3)
    bench.run(0.19)
    assert bench.written[-1][1] != STOP
    bench.run(0.02)
    assert bench.written[-1][1] == STOP


def test_a_stamp_from_the_near_future_gains_no_time(bench: Bench) -> None:
    """The sender's clock is slightly ahead. Its command still expires 0.5 s after the arrival."""
    bench.drive(0.3, age_s=-0.3)
    bench.run(0.49)
    assert bench.written[-1][1] != STOP
    bench.run(0.02)
    assert bench.written[-1][1] == STOP


@pytest.mark.parametrize("age_s", [0.6, -0.6])
def test_a_command_too_old_or_from_the_future_is_refused_and_keeps_nothing_alive(
    bench: Bench, age_s: float
) -> None:
    """The driver refuses a command whose stamp is too old or in the future.

    The refused command does not prolong the previous one, which expires as usual.
    """
    bench.drive(0.3)
    bench.run(0.4)
    with pytest.raises(CommandRefused, match=r"0\.60 s"):
        bench.drive(0.3, age_s=age_s)
    bench.run(0.2)
    assert bench.written[-1][1] == STOP
