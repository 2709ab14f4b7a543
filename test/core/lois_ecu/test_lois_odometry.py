# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of how the odometry of a LOIS robot is estimated from ticks, reports and commands."""

import math
from dataclasses import replace
from itertools import pairwise
from statistics import mean

import pytest
from lois_drives import STOP, Rig, nominal

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    SetDuty,
    SetRpm,
    Ticks,
    comparison,
    encode_command,
    encode_report,
)
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.odometry import LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import Firmware, LoisSettings

pytestmark = pytest.mark.slow

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])


def settled(firmware: Firmware) -> Rig:
    """Return a rig whose board is configured."""
    rig = Rig(nominal(firmware))
    rig.run(4.0)
    return rig


def test_the_boards_own_odometry_would_be_wrong() -> None:
    """In a straight drive, the board's own odometry lacks more than 15 % of the distance.

    The driver's odometry lacks less than 5 %.
    """
    rig = settled("firmware")
    rig.order(20, 20, 8.0)
    board = rig.board.odometry.pose
    truth = rig.board.truth
    assert math.hypot(board[0], board[1]) < 0.85 * math.hypot(truth.x_m, truth.y_m)
    estimate = rig.estimates[-1][0].pose
    assert estimate.way_m > 0.95 * math.hypot(truth.x_m, truth.y_m)


@BOTH
def test_it_says_where_the_board_is_blind(firmware: Firmware) -> None:
    """The odometry names the source of its estimates.

    In a backward drive, the public firmware counts no ticks, so the source is "commands and
    heading".
    """
    rig = settled(firmware)
    rig.order(20, 20, 3.0)
    assert rig.estimates[-1][0].source == "ticks"
    rig.order(0, 0, 2.0)
    assert rig.estimates[-1][0].source == "standing"
    rig.order(-20, -20, 3.0)
    last = rig.estimates[-1][0]
    assert last.blind is (firmware == "firmware")
    assert last.source == ("commands and heading" if last.blind else "ticks")
    rig.order(0, 0, 2.5)
    rig.order(-20, 20, 4.0)
    expected = "ticks and heading" if firmware == "firmware" else "ticks"
    assert rig.estimates[-1][0].source == expected


@BOTH
def test_a_robot_that_stands_does_not_move_in_odom(firmware: Firmware) -> None:
    """The pose stays constant at rest, although the board still reports its old velocity."""
    rig = settled(firmware)
    rig.order(20, 25, 4.0)
    rig.order(0, 0, 2.0)
    place = rig.estimates[-1][0].pose
    rig.run(5.0)
    assert rig.estimates[-1][0].pose == place
    assert rig.estimates[-1][0].twist.vx_mps == 0.0
    predicted = rig.driver.predicted(rig.now + 0.2)
    assert predicted is not None
    assert predicted.pose.way_to(place).way_m < 1e-9


@BOTH
def test_predictions_lead_to_the_next_estimate(firmware: Firmware) -> None:
    """Between two estimates, the odometry predicts the pose, and its covariance grows.

    On average, the last prediction is less than 3 cm away from the next estimate.
    """
    rig = settled(firmware)
    rig.order(20, 24, 6.0)
    misses = []
    for _ in range(40):
        count = len(rig.estimates)
        first = rig.driver.predicted(rig.now)
        rig.order(20, 24, 0.05)
        second = rig.driver.predicted(rig.now)
        assert first is not None
        assert second is not None
        assert second.stamp_s > first.stamp_s
        if len(rig.estimates) == count:
            assert second.covariance.xx + second.covariance.yy > (
                first.covariance.xx + first.covariance.yy - 1e-6
            )
        else:
            estimate = rig.estimates[-1][0]
            misses.append(estimate.pose.way_to(first.pose).way_m)
    assert len(misses) > 5
    assert mean(misses) < 0.03


@BOTH
def test_the_wheels_turn_as_far_as_the_robot_drives(firmware: Firmware) -> None:
    """The wheels' displacements in all estimates add up to the driven distance, within 3 %.

    From one estimate to the next, the pose moves by less than 3 cm plus 1 m for each second.
    """
    rig = settled(firmware)
    rig.order(30, 30, 5.0)
    rig.order(*STOP, 2.0)
    way_m = sum(estimate.displacement.x_m for estimate, _ in rig.estimates)
    assert way_m == pytest.approx(rig.way_m, rel=0.03)
    for (before, _), (after, _) in pairwise(rig.estimates):
        step_m = before.pose.way_to(after.pose).way_m
        assert step_m < 1.0 * (after.stamp_s - before.stamp_s) + 0.03


def test_a_board_that_begins_anew_does_not_move_the_robot() -> None:
    """A restart sets the board's counters to zero and stops the robot.

    The pose moves less than 5 cm, which is the braking distance.
    """
    odometry = LoisOdometry(LoisEcuSettings())
    odometry.wrote(SetRpm(20, 20), 0.0)
    for step in range(1, 11):
        odometry.heard_ticks(Ticks(400 * step, 8 * step, 8 * step), 0.4 * step)
    (place,) = odometry.heard_ticks(Ticks(4400, 88, 88), 4.4)
    odometry.wrote(SetRpm(0, 0), 4.41)
    odometry.connect()
    assert odometry.heard_ticks(Ticks(2000, 0, 0), 9.0) == []
    (after,) = odometry.heard_ticks(Ticks(2400, 0, 0), 9.4)
    assert after.pose.way_to(place.pose).way_m < 0.05
    assert after.pose.yaw_rad == pytest.approx(place.pose.yaw_rad, abs=1e-9)


@BOTH
@pytest.mark.parametrize("pair", [(20, 20), (-20, -20), (-15, 15)])
def test_a_board_that_restarts_ends_the_motion_in_odom(
    firmware: Firmware, pair: tuple[int, int]
) -> None:
    """The board restarts during a drive, and the driver goes on sending set-points until a Stop.

    The estimated motion since the restart agrees with the true motion of the robot, within 12 cm
    and 12°.
    """
    rig = settled(firmware)
    rig.order(*pair, 2.5)
    first = rig.driver.predicted(rig.now)
    before = rig.place
    assert first is not None
    rig.board.reboot()
    for _ in range(8 if firmware == "documented" else 44):
        rig.order(*pair, 0.05)
        shown = rig.driver.predicted(rig.now)
        assert shown is not None
        if firmware == "firmware":
            assert first.pose.way_to(shown.pose).way_m < 0.35
    rig.order(*STOP, 3.0)
    last = rig.driver.predicted(rig.now)
    assert last is not None
    assert rig.driver.translation.counts.restarts == 1
    believed, true = first.pose.way_to(last.pose), before.way_to(rig.place)
    assert believed.way_to(true).way_m < 0.12
    assert believed.yaw_rad == pytest.approx(true.yaw_rad, abs=math.radians(12))


def test_other_wheels_count_from_the_next_group_on() -> None:
    """The user changes the wheel radius.

    The new radius is used only for distances after the change.
    """
    ours = LoisEcuSettings()
    ecu = LoisConversation(ours)
    ecu.wrote(encode_command(SetRpm(20, 20)), -2.0)
    for step in range(3):
        ecu.receive(encode_report(Ticks(400 * step, 10 * step, 10 * step + 1)), 0.4 * step)
        ecu.receive(b"", 0.4 * step + 0.2)
    before = ecu.predicted(0.8)
    ecu.settings = replace(ours, wheel_radius_m=0.26)
    ecu.receive(encode_report(Ticks(1200, 30, 31)), 1.2)
    ecu.receive(b"", 1.4)
    after = ecu.predicted(1.2)
    assert before is not None
    assert after is not None
    assert before.pose.x_m == pytest.approx(20 * ours.tick_m, abs=2 * ours.tick_m)
    way_m = after.pose.x_m - before.pose.x_m
    assert way_m == pytest.approx(20 * ours.tick_m, abs=4 * ours.tick_m)


def test_a_way_is_counted_once_although_a_setting_changes_on_it() -> None:
    """After a tick report, the odometry predicts motion. Then the user changes a setting.

    The next tick report contains the same motion. The pose contains it only once.
    """
    ours = LoisEcuSettings()
    ecu = LoisConversation(ours)
    ecu.wrote(encode_command(SetRpm(20, 20)), -2.0)
    for step in range(4):
        ecu.receive(encode_report(Ticks(400 * step, 10 * step, 10 * step + 1)), 0.4 * step)
        if step == 2:
            before = ecu.predicted(0.8)
            ecu.receive(b"", 1.0)
            ecu.predicted(1.15)
            ecu.settings = replace(ours, declination_rad=0.1)
    after = ecu.predicted(1.2)
    assert before is not None
    assert after is not None
    assert after.pose.x_m - before.pose.x_m == pytest.approx(10 * ours.tick_m, abs=2 * ours.tick_m)


def test_wheels_that_were_held_before_they_were_stopped_are_where_their_ticks_say() -> None:
    """The wheels stop while the board sends nothing, so the odometry predicts too much motion.

    The next tick counts show the true distance. The pose is corrected to this distance.
    """
    ours = LoisEcuSettings()
    odometry = LoisOdometry(ours)
    odometry.wrote(SetRpm(20, 20), 0.0)
    group = BoardOdometry(0.0, 0.0, 0.0, 0.28, 0.0, 0.0, appended=True)
    for step in range(1, 21):
        odometry.heard_ticks(Ticks(200 * step, 4 * step, 4 * step), 0.2 * step)
        odometry.heard_odometry(group, 0.2 * step + 0.01)
    odometry.wrote(SetRpm(0, 0), 4.5)
    believed = odometry.predict(4.6)
    for step in range(23, 28):
        (last,) = odometry.heard_ticks(Ticks(200 * step, 82, 82), 0.2 * step)
    assert believed is not None
    assert believed.pose.x_m > 82 * ours.tick_m + 0.06
    assert last.pose.x_m == pytest.approx(82 * ours.tick_m, abs=0.04)


def test_a_velocity_that_is_not_a_number_is_not_a_speed() -> None:
    """A report has NaN as velocity. The odometry ignores the velocity, but uses the heading."""
    odometry = LoisOdometry(LoisEcuSettings())
    odometry.wrote(SetRpm(-20, -20), 0.0)
    found: list[FusedOdometry] = []
    for step in range(1, 21):
        now = 0.4 * step
        found += odometry.heard_ticks(Ticks(400 * step, 0, 0), now)
        group = BoardOdometry(0.0, 0.0, 0.0, math.nan, math.inf, math.nan, appended=True)
        odometry.heard_odometry(group, now + 0.01)
    last = found[-1]
    assert last.source == "commands and heading"
    assert last.pose.x_m == pytest.approx(-0.2723 * 1.1 * 6.5, rel=0.15)
    assert math.isfinite(last.covariance.xx)


def test_duty_backward_is_known_by_commands_alone() -> None:
    """The robot drives backward by duty. The odometry estimates this motion from commands alone.

    So the distance is uncertain: its standard deviation is more than 20 % of the distance.
    """
    odometry = LoisOdometry(LoisEcuSettings(drive_mode="duty"))
    odometry.wrote(SetDuty(-40, -40), 0.0)
    found: list[FusedOdometry] = []
    for step in range(1, 21):
        found += odometry.heard_ticks(Ticks(400 * step, 0, 0), 0.4 * step)
    last = found[-1]
    assert last.source == "commands"
    assert last.pose.x_m < -1.5
    assert math.sqrt(last.covariance.xx) > 0.2 * abs(last.pose.x_m)


@BOTH
def test_an_inverted_board_turns_the_other_way(firmware: Firmware) -> None:
    """With ``inverted``, the driver takes the board's left wheel for the robot's right wheel.

    The simulated board is not inverted, so the estimated yaw has the wrong sign.
    """
    rig = Rig(LoisSettings(quirks=nominal(firmware).quirks), LoisEcuSettings(inverted=True))
    rig.run(4.0)
    rig.order(15, 20, 5.0)
    rig.order(0, 0, 2.0)
    estimate, true = rig.estimates[-1]
    assert true.yaw_rad < -0.15
    assert estimate.pose.yaw_rad == pytest.approx(-true.yaw_rad, abs=0.05)


def test_a_wheel_that_changes_its_speed_by_itself_is_foreseen_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A report with more ticks than expected increases the variance of the predicted speeds.

    With the board's own gains, a wheel's speed may oscillate between two reports.
    """

    def variance() -> float:
        """Return a predicted speed's variance in (m/s)², after a report with 4 ticks too many."""
        odometry, ticks = LoisOdometry(LoisEcuSettings()), 0
        odometry.wrote(SetRpm(20, 20), 0.0)
        for step in range(52):
            odometry.heard_ticks(Ticks(200 * step, ticks, ticks), 0.2 * step)
            ticks += 8 if step == 50 else 4
        told = odometry.predict(10.4)
        assert told is not None
        return told.twist_covariance[0]

    ours = variance()
    monkeypatch.setattr(comparison, "UNFORESEEN_TICKS", math.inf)
    assert ours > 1.3 * variance()
