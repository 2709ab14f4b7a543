# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the simulated Fejemis moves according to the manual's equations.

In these equations, the robot's speed and turn rate differ from the numbers in the ``rc`` line.
"""

from math import atan2, degrees, hypot, radians

import pytest
from fejemis_rig import DRIVE, FRONT, Rig

from omnibot_driver.simulator.fejemis import Firmware
from omnibot_driver.simulator.fejemis.vehicle import wheel_speeds

B, F = 0.4, 0.42


def steered_degrees(v: float, w: float) -> float:
    """Return the manual's angle of the front wheel, in degrees."""
    return degrees(atan2(F * w, v))


@pytest.mark.parametrize(
    ("v", "w", "speed", "turn"),
    [
        (0.0, 1.0, 0.0, 5.0),  # v2 = 1, d = 0.2, v1 = -1: 2 / 0.4
        (0.0, -1.0, 0.0, -5.0),
        (0.5, 1.0, 0.79859, 1.59719),  # v2 = 1.11803, d = 0.7, v1 = 0.47916
        (0.5, 0.0, 0.5, 0.0),
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_the_body_moves_by_the_equations_of_the_manual(
    v: float, w: float, speed: float, turn: float
) -> None:
    """``rc`` commands v and w. The robot moves with ``speed`` and ``turn``, as the manual says.

    ``speed`` and ``turn`` were calculated by hand with the manual's equations.
    """
    left, right = wheel_speeds(v, w, steered_degrees(v, w), B, F)
    assert (left + right) / 2 == pytest.approx(speed, abs=2e-4)
    assert (right - left) / B == pytest.approx(turn, abs=1e-4)


def test_a_turn_on_the_spot_is_five_times_as_fast_as_commanded() -> None:
    """``rc`` commands a turn on the spot, so the front wheel goes to 90°.

    The robot then turns five times as fast as commanded.
    """
    rig = Rig().booted()
    rig.drive("rc 2 0 57.29578", 4.0)
    truth = rig.board.truth
    assert truth.yaw_rate_radps == pytest.approx(5.0, rel=0.01)
    assert abs(truth.speed_mps) < 0.02


def test_from_straight_ahead_a_turn_on_the_spot_surges_forward() -> None:
    """``rc`` commands a turn on the spot while the front wheel is straight.

    At first both drive wheels turn forward, so the robot leaves its place.
    """
    rig = Rig().booted()
    rig.drive("rc 2 0 57.29578", 2.0)
    assert hypot(rig.board.truth.x_m, rig.board.truth.y_m) > 0.15


def test_the_wheel_can_be_aligned_while_the_robot_stands() -> None:
    """Only the front Teensy gets the ``rc`` line. The front wheel moves; the robot is at rest."""
    rig = Rig().booted()
    rig.say(FRONT, "rc 2 0 20")
    rig.run(2.0)
    assert rig.board.vehicle.servo.angle_deg == pytest.approx(90.0, abs=5.0)
    assert rig.board.standing


def test_without_the_angle_drive_goes_straight() -> None:
    """The host does not relay the front angle.

    The drive Teensy assumes that the front wheel is straight.
    """
    rig = Rig().booted()
    rig.say(DRIVE, "rc 2 0.5 30")
    rig.run(1.0)
    assert rig.board.truth.yaw_rad == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
def test_no_command_ends_by_itself() -> None:
    """The host sends one command and then no more. After 20 s the robot still drives."""
    rig = Rig().booted()
    rig.drive("rc 2 0.3 0", 1.0)
    rig.relays = False
    rig.run(20.0)
    assert rig.board.truth.speed_mps == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize("w_dps", [0.0, 40.0, -40.0])
def test_backward_mirrored_turns_as_commanded(w_dps: float) -> None:
    """A robot is commanded to drive a curve in reverse, and turns in the commanded direction.

    In the firmware variant "mirrored", the front wheel has the same angle in reverse as forward.
    """
    rig = Rig(firmware=Firmware(sums=False, reverse="mirrored")).booted()
    rig.drive(f"rc 2 -0.3 {w_dps}", 4.0)
    truth = rig.board.truth
    assert truth.speed_mps < -0.2
    left, right = wheel_speeds(0.3, radians(abs(w_dps)), steered_degrees(0.3, radians(40)), B, F)
    if w_dps:
        assert abs(truth.yaw_rate_radps) == pytest.approx((right - left) / B, rel=0.05)
        assert truth.yaw_rate_radps * w_dps > 0
    else:
        assert truth.yaw_rate_radps == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("w_dps", [0.0, 40.0, -40.0])
def test_backward_clamped_spins_the_wrong_way(w_dps: float) -> None:
    """``rc`` commands reverse motion, and the firmware limits the angle of the front wheel.

    The front wheel goes to this limit, 90°. So the robot spins, and in the wrong direction.
    """
    rig = Rig(firmware=Firmware(sums=False, reverse="clamped")).booted()
    rig.drive(f"rc 2 -0.3 {w_dps}", 4.0)
    truth = rig.board.truth
    assert abs(truth.speed_mps) < 0.02
    assert abs(rig.board.vehicle.servo.angle_deg) == pytest.approx(90.0, abs=1.0)
    assert truth.yaw_rate_radps * (w_dps or 1.0) < -0.5


def test_the_steering_follows_a_small_step_at_12_radians_a_second() -> None:
    """The steering angle reaches 63 % of a small step after about 1/12 s, as in the manual."""
    rig = Rig(angle_noise_deg=0.0).booted()
    rig.say(FRONT, "rc 2 1 10")
    wanted = steered_degrees(1.0, radians(10))
    angles = []
    for _ in range(1000):
        rig.run(0.002)
        angles.append(rig.board.vehicle.servo.angle_deg)
    reached_s = 0.002 * next(at for at, angle in enumerate(angles) if angle > 0.63 * wanted)
    assert 0.06 < reached_s < 0.17
    assert max(angles) < 1.1 * wanted
    assert angles[-1] == pytest.approx(wanted, abs=0.1)


def test_the_odometry_of_the_board_is_where_the_robot_is() -> None:
    """The wheels have the sizes that the board assumes. So the board's odometry is right."""
    rig = Rig().booted()
    for text in ("rc 2 0.3 0", "rc 2 0.2 20", "rc 2 0.2 -40"):
        rig.drive(text, 2.0)
    x, y, h = rig.board.drive.pose
    truth = rig.board.truth
    assert hypot(x - truth.x_m, y - truth.y_m) < 0.002
    assert abs(h - truth.yaw_rad) < 0.003
