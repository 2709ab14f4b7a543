# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detection of a wheel that is commanded to turn but is at rest.

The public firmware may fail to start a wheel.
"""

import math

import pytest
from lois_drives import HOST_GAINS

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    SetDuty,
    SetRpm,
    Ticks,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.stall import StallWatch

UNIT_MPS = 0.13 * math.tau / 60


def pose(x_m: float) -> BoardOdometry:
    return BoardOdometry(x_m, 0.0, 0.0, 0.0, 0.0, 0.0, appended=True)


def watched(command: SetRpm | SetDuty, *, ticks: tuple[int, int], ways_m: float) -> list[float]:
    """Return the times in s, within six seconds, at which a wheel is reported as stalled.

    * ``ticks``: new ticks of the left and the right wheel in each 0.2 s.
    * ``ways_m``: motion of the board's own pose (report 0x20) in each 0.2 s, in m.
    """
    watch = StallWatch(LoisEcuSettings())
    watch.wrote(command, 0.0)
    found = []
    for step in range(31):
        now = 0.2 * step
        watch.heard(Ticks(200 * step, ticks[0] * step, ticks[1] * step), now)
        watch.heard(pose(ways_m * step), now)
        watch.wrote(command, now)
        if any(watch.stalled(now)):
            found.append(round(now, 1))
    return found


def test_a_wheel_that_is_to_turn_forward_and_does_not_tick_looks_stalled() -> None:
    """Every 2 s, the detector reports a wheel that is commanded forward but does not tick."""
    assert watched(SetRpm(20, 10), ticks=(3, 0), ways_m=0.1) == [2.0, 4.0, 6.0]


def test_wheels_that_tick_do_not() -> None:
    """Both wheels are commanded forward and tick. The driver reports neither wheel as stalled."""
    assert watched(SetRpm(20, 10), ticks=(3, 1), ways_m=0.0) == []


def test_a_wheel_that_is_to_turn_backward_is_known_by_the_pose() -> None:
    """A wheel that is commanded backward counts as stalled if the board's pose does not change.

    Ticks cannot show this, because the public firmware counts no ticks backward.
    """
    assert watched(SetRpm(-10, 10), ticks=(0, 1), ways_m=0.01) == []
    assert watched(SetRpm(-10, -10), ticks=(0, 0), ways_m=0.0) == [2.0, 4.0, 6.0]


def looks_stalled(
    rpm: list[tuple[int, int]],
    *,
    targets: tuple[int, int] = (-9, 9),
    resting: tuple[bool, bool] = (False, False),
    settings: LoisEcuSettings | None = None,
    every_s: float = 0.2,
) -> bool:
    """Return whether a wheel looks stalled.

    * ``rpm``: reported speeds of left and right wheel, every ``every_s``.
    * ``targets``: set-points of left and right wheel, in RPM.
    * ``resting``: for each wheel, whether the odometry assumes rest.
    """
    watch, unit = StallWatch(settings or LoisEcuSettings()), UNIT_MPS
    watch.wrote(SetRpm(*targets), 0.0)
    found = False
    for step, (left_rpm, right_rpm) in enumerate(rpm, 1):
        left, right = left_rpm * unit, right_rpm * unit
        turning = (right - left) / 0.47
        group = BoardOdometry(
            0.1 * step, 0.0, 0.1 * step, *heading(left, right, 0.1 * step), turning, appended=True
        )
        now = every_s * step
        watch.heard(group, now, resting)
        watch.heard(Ticks(round(1000 * now), 0, 2 * step * (targets[1] > 0)), now)
        found |= any(watch.stalled(now))
    return found


def test_a_wheel_that_keeps_its_speed_beside_one_that_ticks_looks_stalled() -> None:
    """A wheel whose reported speed never changes while the other wheel ticks looks stalled.

    The firmware computes its pose from the old speed, so the pose does not prove that the wheel
    turns.
    """
    assert looks_stalled([(-10, 8 + step % 3) for step in range(14)])
    assert not looks_stalled([(-9 - step % 2, 8 + step % 3) for step in range(14)])


def test_a_few_equal_speeds_on_a_bad_line_do_not_show_a_stall() -> None:
    """Most reports are lost. A wheel with seven equal reported speeds in 3 s does not look stalled.

    After ten equal speeds, the wheel looks stalled.
    """
    assert not looks_stalled([(-10, 8 + step % 3) for step in range(7)], every_s=0.5)
    assert looks_stalled([(-10, 8 + step % 3) for step in range(10)], every_s=0.5)


def test_a_wheel_that_keeps_too_high_a_speed_looks_stalled_beside_a_steady_one() -> None:
    """The board keeps reporting one speed of a wheel, above its set-point. The wheel looks stalled.

    Above the set-point, the speed controller gives no power, so a rolling wheel would slow down.
    """
    assert looks_stalled([(-15, 9)] * 14)
    assert looks_stalled([(-12, 9)] * 14)


def test_a_wheel_with_feed_forward_may_roll_much_faster_than_its_set_point() -> None:
    """With feed-forward, a wheel may roll at a constant speed above its set-point.

    The wheel looks stalled only if its reported speed stays constant while the other wheel's
    changes.
    """
    assert not looks_stalled([(-15, 9)] * 14, settings=HOST_GAINS)
    assert not looks_stalled([(-43, -51)] * 14, targets=(-26, -26), settings=HOST_GAINS)
    assert looks_stalled([(-10, 8 + step % 3) for step in range(14)], settings=HOST_GAINS)


def test_two_wheels_that_roll_steadily_do_not_look_stalled() -> None:
    """Two wheels that roll steadily, at the set-point or 10 % faster, do not look stalled."""
    assert not looks_stalled([(-9, 9)] * 14)
    assert not looks_stalled([(-10, 9)] * 14)


def test_two_wheels_that_are_as_much_too_fast_do_not_look_stalled() -> None:
    """Two wheels turn at about 1.3 times their set-points, as can happen in backward motion.

    They do not look stalled. If only one wheel is this fast, it looks stalled.
    """
    assert not looks_stalled([(-39, -44)] * 14, targets=(-30, -33))
    assert looks_stalled([(-39, -36)] * 14, targets=(-30, -33))


def test_a_wheel_that_odometry_takes_to_be_at_rest_looks_stalled() -> None:
    """The odometry assumes a wheel at rest, but the board reports a speed above the set-point.

    The wheel looks stalled: because of the reported speed, the board's controller gives it no
    power.
    """
    still = [(-21, -20), (-22, -20), (-21, -20), (-21, -20)] * 4
    assert looks_stalled(still, targets=(-19, -19), resting=(False, True))
    assert not looks_stalled(still, targets=(-19, -19))


def test_a_wheel_at_rest_with_a_speed_below_its_set_point_is_left_alone() -> None:
    """A wheel at rest whose last reported speed is below its set-point does not look stalled.

    The board's controller regards this speed as too low, and gives power until the wheel starts.
    """
    still = [(-21, -12), (-22, -12), (-21, -12), (-21, -12)] * 4
    assert not looks_stalled(still, targets=(-19, -19), resting=(False, True))


def heading(left: float, right: float, yaw_rad: float) -> tuple[float, float]:
    """Return the robot's velocity in m/s along the x and y axes of the odometry frame.

    ``left``, ``right``: speeds of the wheels' rims in m/s. ``yaw_rad``: the robot's heading.
    """
    speed = (left + right) / 2
    return speed * math.cos(yaw_rad), speed * math.sin(yaw_rad)


def test_what_is_to_stand_and_what_is_driven_by_duty_is_not_watched() -> None:
    """No stall is reported for set-points below 2 RPM, or for duties.

    Duties bypass the speed controllers.
    """
    assert watched(SetRpm(0, 1), ticks=(0, 0), ways_m=0.0) == []
    assert watched(SetDuty(50, 50), ticks=(0, 0), ways_m=0.0) == []


@pytest.mark.parametrize("right_rpm", [-68, -30], ids=["full power", "steady"])
def test_a_wheel_that_rolls_fast_at_one_speed_is_started_anew_and_has_rolled(
    right_rpm: int,
) -> None:
    """The board always reports the same high speed of a wheel, which may roll or be at rest.

    The driver sends RPM 0/0, so that a wheel at rest can start. The odometry keeps the distance of
    a wheel that rolled.
    """
    driver, targets, turned_rad, ways_m = LoisConversation(LoisEcuSettings()), (-34, -31), 0.0, []
    rates, cleared = [rpm * math.tau / 60 for rpm in targets], False
    for step in range(22):
        now = 0.2 * step
        started = min(max(step - 5, 0) / 4, 1.0)
        rpm = started * (-36 - step % 2), started * right_rpm
        left, right = (one * UNIT_MPS for one in rpm)
        turned_rad += 0.2 * (right - left) / 0.47
        velocity = *heading(left, right, turned_rad), (right - left) / 0.47
        group = BoardOdometry(-0.1 * step, 0.0, turned_rad, *velocity, appended=True)
        lines = encode_report(Ticks(200 * step, 0, 0)) + encode_report(group)
        for reading in driver.receive(lines, now) + driver.receive(b"", now + 0.1):
            if isinstance(reading, FusedOdometry):
                ways_m.append(reading.wheel_ways_m[1])
        if step > 2:
            written = driver.wheels(rates)
            driver.wrote(written, now + 0.1)
            cleared |= step > 10 and written.startswith(encode_command(SetRpm(0, 0)))
        driver.predicted(now + 0.15)
    assert sum(ways_m) < -1.0
    assert max(ways_m) < 0.01, "a distance was subtracted again"
    assert cleared


@pytest.mark.parametrize("reset", [False, True])
def test_wheels_that_do_not_start_backward_take_no_earlier_way_back(reset: bool) -> None:
    """Blocked wheels that are commanded backward do not undo the forward drive in the odometry.

    ``reset``: whether the odometry is reset before the backward command.
    """
    driver, ticks, places = LoisConversation(LoisEcuSettings()), 0, []
    for step in range(50):
        now, forward = 0.2 * step, step < 25
        ticks += 4 * forward
        speed = 20 * UNIT_MPS * forward
        group = BoardOdometry(ticks * 0.0136, 0.0, 0.0, speed, 0.0, 0.0, appended=True)
        lines = encode_report(Ticks(200 * step, ticks, ticks)) + encode_report(group)
        driver.receive(lines, now)
        driver.predicted(now + 0.05)
        driver.receive(b"", now + 0.1)
        if step == 29 and reset:
            driver.reset_odometry()
        rpm = 20 if forward else -20 * (step > 29)
        written = driver.wheels([rpm * math.tau / 60] * 2) if rpm else encode_command(SetRpm(0, 0))
        driver.wrote(written, now + 0.1)
        if step > 29:
            predicted = driver.predicted(now + 0.15)
            assert predicted is not None
            places.append(predicted.pose)
    assert max(place.way_to(places[0]).way_m for place in places) < 0.15
