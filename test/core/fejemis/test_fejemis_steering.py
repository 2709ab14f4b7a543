# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the set-points of each board, and of the motion that the manual's equations give."""

import math

import pytest
from fejemis_bench import DRIVE, nominal
from hypothesis import assume, given
from hypothesis import strategies as st

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.motion_lines import drive_line, front_line
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.fejemis.steering import (
    ALIGNED_RAD,
    Geometry,
    body_twist,
    outer_mps,
    scale,
    steer,
)
from omnibot_driver.core.geometry.steered import SteeredKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.simulator.fejemis import FejemisSettings as Simulated
from omnibot_driver.simulator.fejemis import Firmware

ROBOT = Geometry(track_m=0.4, wheelbase_m=0.5)
speeds = st.floats(-1.0, 1.0)
rates = st.floats(-2.0, 2.0)
angles = st.floats(-math.pi / 2, math.pi / 2)


def told_twist(
    speed_mps: float, turn_radps: float, geometry: Geometry, angle_rad: float
) -> BodyTwist:
    """Return the body's twist if the drive board obeys an ``rc`` line with these numbers."""
    outer = math.copysign(math.hypot(speed_mps, turn_radps), speed_mps or 1.0)
    return body_twist(outer, geometry, angle_rad)


def manual(v: float, w: float, theta_rad: float) -> tuple[float, float]:
    """Return the robot's speed and turn rate according to the manual (Turning control)."""
    b, f = 0.4, 0.5
    v2 = math.hypot(v, w) * (-1.0 if v < 0.0 else 1.0)
    if theta_rad == 0.0:
        return v2, 0.0
    d = f / math.tan(abs(theta_rad)) + b / 2
    v1 = v2 - v2 * b / d
    return (v1 + v2) / 2, math.copysign((v2 - v1) / b, theta_rad * v2)


@pytest.mark.parametrize(
    ("v", "w", "theta_deg", "body_v", "body_w"),
    [
        (0.5, 1.0, 45.0, 0.7986, 1.5972),  # d = 0.7, v2 = 1.1180, v1 = 0.4792
        (0.0, 1.0, 90.0, 0.0, 5.0),  # d = 0.2, v2 = 1, v1 = -1
        (0.3, 0.0, 0.0, 0.3, 0.0),
        (0.3, -0.4, -30.0, 0.4061, -0.4689),  # d = 1.0660, v2 = 0.5, v1 = 0.3124
        (-0.3, 0.0, 0.0, -0.3, 0.0),
    ],
)
def test_what_rc_alone_would_do(
    v: float, w: float, theta_deg: float, body_v: float, body_w: float
) -> None:
    """In a curve, the robot's motion differs from speed and turn rate in the ``rc`` line.

    The expected values are computed by hand with the manual's equations.
    """
    body = told_twist(v, w, ROBOT, math.radians(theta_deg))
    assert (body.vx_mps, body.yaw_rate_radps) == pytest.approx((body_v, body_w), abs=2e-4)


@pytest.mark.slow
@given(speeds, rates, angles)
def test_the_equations_are_those_of_the_manual(v: float, w: float, theta_rad: float) -> None:
    """For every angle of the front wheel, the driver computes the same motion as the manual."""
    assume(math.hypot(v, w) > 1e-3 and abs(theta_rad) > 1e-6)
    body = told_twist(v, w, ROBOT, theta_rad)
    expected = manual(v, w, theta_rad)
    assert (body.vx_mps, body.yaw_rate_radps) == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
@given(speeds, rates)
def test_the_inversion_moves_the_body_as_commanded(v: float, w: float) -> None:
    """If the front wheel is at its commanded angle, the set-points give the commanded motion."""
    assume(outer_mps(BodyTwist(v, 0.0, w), 0.4) > 1e-3 and v >= 0.0)
    factor = scale(BodyTwist(v, 0.0, w), 0.4)
    theta_rad = math.atan2(0.5 * factor * w, factor * v)
    body = told_twist(factor * v, factor * w, ROBOT, theta_rad)
    assert (body.vx_mps, body.yaw_rate_radps) == pytest.approx((v, w), abs=1e-9)


@given(speeds, rates, angles)
def test_a_body_whose_wheel_is_on_its_way_is_never_faster_than_commanded(
    v: float, w: float, angle_rad: float
) -> None:
    """The body is not faster than commanded while the front wheel has not reached its angle.

    Tolerance: the effect of an error of 5° in the wheel's angle.
    """
    wanted = BodyTwist(v, 0.0, w)
    assume(outer_mps(wanted, 0.4) > 1e-3)
    told = steer(wanted, ROBOT, angle_rad, turning=False).twist
    given_mps = 1.001 * math.hypot(v, 0.5 * w) * math.sin(ALIGNED_RAD)
    near = abs(angle_rad - ROBOT.kinematics.steering_rad(wanted)) <= ALIGNED_RAD
    if not near:
        assert abs(told.vx_mps) <= abs(v) + given_mps + 1e-9
        assert abs(told.yaw_rate_radps) <= abs(w) + given_mps / 0.5 + 1e-9
    assert told.vx_mps * v >= 0.0 or not v


@given(rates, angles)
def test_a_turn_on_the_spot_waits_for_the_wheel(w: float, angle_rad: float) -> None:
    """The user commands a turn on the spot.

    As long as the front wheel is not within 5° of ±90°, the driver commands the drive board to
    stop.
    """
    assume(abs(w) > 0.01)
    told = steer(BodyTwist(0.0, 0.0, w), ROBOT, angle_rad, turning=False)
    stands = abs(angle_rad - math.copysign(math.pi / 2, w)) <= ALIGNED_RAD
    assert (told.part == 1.0) is stands
    assert stands or told.twist == BodyTwist(0.0, 0.0, 0.0)


def test_without_an_angle_the_drive_board_is_told_to_stand() -> None:
    """The front wheel's angle is not known, so the drive board would use an old angle.

    The driver therefore commands the drive board to stop.
    """
    told = steer(BodyTwist(0.3, 0.0, 0.1), ROBOT, None, turning=False)
    assert told.part == 0.0
    assert told.speed_mps > 0.3


@given(speeds, rates)
def test_the_steered_wheel_rolls_without_slip(v: float, w: float) -> None:
    """For every twist, the front wheel moves along its own direction, forward or backward."""
    assume(math.hypot(v, w) > 1e-3)
    wheels = SteeredKinematics(0.1, 0.4, 0.5)
    theta = wheels.steering_rad(BodyTwist(v, 0.0, w))
    assert abs(theta) <= math.pi / 2
    across = -v * math.sin(theta) + 0.5 * w * math.cos(theta)
    assert across == pytest.approx(0.0, abs=1e-9)


COMMANDS = [
    *((0.0, w) for w in (-1.0, 0.05)),
    *((0.02, w) for w in (0.0, 0.5)),
    *((0.15, w) for w in (-1.0, 0.05)),
    *((0.6, w) for w in (0.0, 0.5)),
]
"""Commands that a test gives to the robot: pairs of a speed in m/s and a turn rate in rad/s."""


@pytest.mark.slow
@pytest.mark.parametrize(("v", "w"), COMMANDS)
def test_the_simulated_body_moves_as_commanded(v: float, w: float) -> None:
    """After 2.5 s, the robot has the commanded speed, within 1.2 %, and turn rate, within 3 %.

    The 1.2 % are relative to the outer wheel's speed, and the 3 % to this speed divided by the
    track width.
    """
    bench = nominal()
    bench.drive_on(v, w, 2.5)
    truth = bench.robot.truth
    outer = abs(v) + abs(w) * 0.2
    assert truth.speed_mps == pytest.approx(v, abs=0.012 * outer + 5e-4)
    assert truth.yaw_rate_radps == pytest.approx(w, abs=0.03 * outer / 0.4 + 1e-3)


def test_the_digits_cost_less_than_one_per_cent() -> None:
    """The numbers in the lines are rounded. This changes the motion by less than 1 %."""
    for v in (0.05, 0.1, 0.15, 0.25, 0.5, 1.0):
        for w in (-1.5, -0.3, 0.0, 0.1, 0.12, 0.8):
            factor = scale(BodyTwist(v, 0.0, w), 0.4)
            front = front_line(factor * v, factor * w, 0.5).split()
            drive = drive_line(factor * v, factor * w).split()
            theta = math.atan2(0.5 * math.radians(float(front[3])), float(front[2]))
            body = told_twist(float(drive[2]), math.radians(float(drive[3])), ROBOT, theta)
            outer = abs(v) + abs(w) * 0.2
            assert body.vx_mps == pytest.approx(v, abs=0.01 * outer)
            assert body.yaw_rate_radps == pytest.approx(w, abs=0.01 * outer / 0.2)


def test_a_turn_on_the_spot_begins_without_rolling() -> None:
    """A robot whose front wheel points ahead does not roll away when a turn on the spot begins.

    Without a wait for the wheel, it would roll 0.17 m.
    """
    bench = nominal()
    for _ in range(12):
        bench.drive(0.0, 1.0)
        bench.run(0.1)
        assert abs(bench.robot.truth.x_m) < 0.006
    assert bench.robot.truth.yaw_rate_radps > 0.8


@pytest.mark.slow
def test_from_one_side_to_the_other_the_robot_stands_while_the_wheel_turns() -> None:
    """Between turns on the spot to the left and to the right, the robot is at rest.

    Meanwhile the front wheel turns by 180°, for over 1 s.
    """
    bench = nominal()
    bench.drive_on(0.0, 1.0, 1.5)
    before_m = bench.robot.truth.x_m
    bench.drive_on(0.0, -1.0, 3.0)
    assert bench.robot.truth.yaw_rate_radps == pytest.approx(-1.0, abs=0.03)
    assert abs(bench.robot.truth.x_m - before_m) < 0.03
    assert not bench.notices


@pytest.mark.parametrize("side", [1, -1])
def test_a_wheel_that_overshoots_across_makes_the_body_turn_no_quicker(side: int) -> None:
    """If the front wheel overshoots to 95°, the driver relays at most 90° to the drive board.

    Beyond 90°, the board would turn its inner wheel faster than the outer one.
    """
    bench = nominal()
    angles_deg = [60.0]
    bench.robot.front._items["fwl"] = lambda: f"fwl {side * angles_deg[-1]:.2f} 0x0 0x3c2"
    for angle_deg in (60.0, 85.0, 95.0):
        angles_deg.append(angle_deg)
        bench.run(0.1)
    bench.drive_on(0.0, side * 0.5, 1.0)
    last = [float(text[4:]) for text in bench.lines(DRIVE) if text.startswith("fwl")][-20:]
    assert last == [side * 90.0] * 20
    assert abs(bench.robot.truth.yaw_rate_radps) < 0.51
    assert not bench.robot.standing


@pytest.mark.slow
@pytest.mark.parametrize(("v", "w"), [(-0.2, 0.0), (-0.2, 0.3), (-0.01, 0.5)])
def test_reverse_is_off_until_it_is_allowed(v: float, w: float) -> None:
    """The parameter ``allow_reverse`` is off, and the user commands a motion backward.

    The robot only turns. A single notice to the user names ``allow_reverse``.
    """
    bench = nominal()
    bench.drive_on(v, w, 3.0)
    truth = bench.robot.truth
    assert (truth.speed_mps, truth.yaw_rate_radps) == pytest.approx((0.0, w), abs=0.01)
    assert math.hypot(truth.x_m, truth.y_m) < 0.006
    assert sum("allow_reverse" in text for text in bench.notices) == 1
    assert len(bench.notices) == 1


def test_a_refused_reverse_is_not_driven_when_it_is_allowed_later() -> None:
    """The user sends a reverse command, and then sets ``allow_reverse``. The robot stays at rest.

    The motion monitor had stopped the robot twice, so the next reverse command is refused until
    ~/start.
    """
    bench = nominal(limits=SpeedLimits())
    for _ in range(2):
        bench.session.interlocks._interlock.trip(bench.now)
    bench.drive_on(-0.3)
    changed = bench.now
    settings = SessionSettings(
        limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
    )
    bench.session.configure(settings, bench.now, board=FejemisSettings(allow_reverse=True))
    bench.settle()
    bench.run(1.0)
    motions = [line for line in bench.lines(DRIVE, changed) if line.startswith("rc")]
    assert set(motions) == {"rc 2 0 0"}
    with pytest.raises(CommandRefused, match="~/start"):
        bench.drive(-0.3)


def test_a_mirrored_reverse_is_driven() -> None:
    """The robot follows a curve backward. Its firmware is the variant "mirrored".

    In reverse, this variant gives the front wheel the same angle as for driving forward on the same
    curve.
    """
    bench = nominal(
        Simulated(firmware=Firmware(reverse="mirrored")), FejemisSettings(allow_reverse=True)
    )
    bench.drive_on(-0.2, 0.3, 3.0)
    truth = bench.robot.truth
    assert (truth.speed_mps, truth.yaw_rate_radps) == pytest.approx((-0.2, 0.3), abs=0.01)
    assert not bench.notices


def test_a_speed_of_nothing_that_is_negative_is_none() -> None:
    """The user commands −1e-9 m/s, a rounding error. The driver does not refuse it as reverse."""
    bench = nominal()
    bench.drive_on(-1e-9, 0.5, 3.0)
    assert bench.robot.truth.yaw_rate_radps == pytest.approx(0.5, abs=0.02)
    assert not bench.notices
