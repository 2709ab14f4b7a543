# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Odometry of a LOIS robot, compared with its true pose, on both kinds of firmware.

``test/integrity/lois_odometry.py`` prints the figures of many drives; a few of them run here.
"""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from statistics import mean, median

import pytest
from lois_drives import CLASSES, HOST_GAINS, STOP, Drive, Rig, drive, motion, nominal, wrong

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    SetDuty,
    SetRpm,
    Ticks,
    comparison,
    encode_command,
    encode_report,
    measured_speed,
)
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry, LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import Firmware, LoisSettings
from omnibot_driver.simulator.lois_ecu.settings import MotorSettings

pytestmark = pytest.mark.slow

BOTH = pytest.mark.parametrize("firmware", ["documented", "firmware"])


def off_m(one: Drive) -> float:
    """Return the distance in m between the estimated and the true position."""
    return math.hypot(one.error.x_m, one.error.y_m)


# Promised accuracy


@cache
def driven(firmware: Firmware, name: str, seed: int = 1) -> Drive:
    """Return the outcome of a drive with exact wheel sizes."""
    return drive(nominal(firmware, seed), CLASSES[name])


@BOTH
@pytest.mark.parametrize("name", ["straight", "curve"])
def test_forward_it_is_within_2_percent_and_3_degrees_on_5_m(firmware: Firmware, name: str) -> None:
    """This accuracy is promised for wheels of the right size."""
    one = driven(firmware, name)
    assert one.way_m > 5.0
    assert off_m(one) < max(0.02, 0.02 * one.way_m)
    assert abs(one.error.yaw_rad) < math.radians(3.0)


@BOTH
def test_in_place_it_is_within_3_percent_of_the_angle(firmware: Firmware) -> None:
    """One wheel turns backward, and the public firmware does not count its ticks."""
    one = driven(firmware, "in place")
    assert one.turned_rad > 8.0
    assert abs(one.error.yaw_rad) < 0.03 * one.turned_rad


@BOTH
def test_backward_its_way_is_within_3_percent_and_its_place_within_10(firmware: Firmware) -> None:
    """The public firmware counts no ticks and reports integer RPM, so the heading drifts.

    Eight drives are off by 4.9 % of the way on average. The first of these three is the worst of
    them, with 13 %.
    """
    drives = [driven(firmware, "reverse", seed) for seed in (1, 2, 3)]
    for one in drives:
        assert one.way_m > 5.0
        way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
        assert way_m == pytest.approx(true_m, rel=0.03)
        assert one.sigmas < 3.0
    part = 0.02 if firmware == "documented" else 0.1
    assert mean(off_m(one) / one.way_m for one in drives) < part


@pytest.mark.parametrize("name", ["place right", "straight back", "curve back"])
def test_the_gains_of_the_boot_are_described_by_the_covariance(name: str) -> None:
    """With the boot gains the firmware's right wheel swings, rests, and keeps its last speed.

    The normalized squared error of half of the drives is below 2.4 if the covariance is right; a
    few of these drives are far above.
    """
    seeds = range(1000, 1005)
    drives = [motion(wrong("firmware", seed), name, LoisEcuSettings()) for seed in seeds]
    assert median(one.nees for one in drives) < 2.4
    assert max(one.sigmas for one in drives) < 3.5


@pytest.mark.parametrize("seed", [2020, 9005])
def test_a_wheel_that_falls_to_its_set_point_and_stands_is_seen_and_started_again(
    seed: int,
) -> None:
    """The wheel falls from 41 to 20 RPM at a set-point of -19. When this was not noticed, odometry
    turned by 600° in 15 s."""
    one = motion(nominal("firmware", seed), "straight back", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(60)
    assert one.sigmas < 3.5


def test_a_wheel_that_the_driver_starts_again_has_not_rolled_before() -> None:
    """The board keeps reporting 12 RPM at a set-point of -7, which is too fast for a wheel that
    rolls: it is at rest."""
    one = motion(wrong("firmware", 1046), "place right", LoisEcuSettings())
    assert abs(one.error.yaw_rad) < math.radians(30)
    assert one.sigmas < 3.5


@pytest.mark.parametrize(
    ("name", "seed"), [("straight back", 9001), ("straight back", 9025), ("curve back", 9013)]
)
def test_backward_with_set_gains_the_way_is_within_10_percent(name: str, seed: int) -> None:
    """The drives have a wheel that rolls at 46 RPM instead of 34, and wheels that overshoot and
    then roll at a steady speed."""
    one = motion(nominal("firmware", seed), name, HOST_GAINS)
    assert off_m(one) < 0.1 * one.way_m
    assert one.sigmas < 3.0


@pytest.mark.parametrize("seed", [2, 3])
def test_wheels_that_roll_backward_at_twice_their_set_points_are_followed(seed: int) -> None:
    """A feed-forward that is too much for the motor; ticks do not show it, 0x20 does."""
    motors = MotorSettings(rpm_per_percent=1.1 * 0.97), MotorSettings(rpm_per_percent=1.1)
    one = motion(replace(nominal("firmware", seed), motors=motors), "reverse", HOST_GAINS)
    assert one.way_m > 11.0
    way_m, true_m = (math.hypot(place.x_m, place.y_m) for place in (one.last.pose, one.true))
    assert way_m == pytest.approx(true_m, rel=0.03)


def test_beyond_50_rpm_the_heading_of_0x20_is_worth_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks come so soon after each other that the firmware gives some of them no speed."""
    usual = nominal("firmware", 2)
    fast = replace(usual, motors=(MotorSettings(rpm_per_percent=1.1),) * 2)

    def variances() -> list[float]:
        """Return the yaw variances in rad² after a drive at 62 RPM, and at 32 RPM."""
        drives = [drive(settings, [(6.0, (-25, -25))]) for settings in (fast, usual)]
        return [one.last.covariance.yaw_yaw for one in drives]

    ours = variances()
    monkeypatch.setattr(measured_speed, "LOST_TICKS", 0.0)
    grown = [one / before for one, before in zip(ours, variances(), strict=True)]
    assert grown[0] > 1.05
    assert grown[1] == 1.0


@BOTH
@pytest.mark.parametrize("name", ["curve", "in place", "reverse", "jerky"])
def test_the_covariance_is_honest(firmware: Firmware, name: str) -> None:
    """Wheels of wrong sizes slip on uneven ground; by chance, one drive in 10,000 exceeds 21.1.

    ``test/integrity/lois_odometry.py`` judges by the mean of many drives.
    """
    assert motion(wrong(firmware, 1000), name).nees < 21.1


@pytest.mark.parametrize("name", ["left", "right"])
def test_after_a_square_with_turns_on_the_spot_it_is_within_3_sigma(name: str) -> None:
    """In each turn one wheel turns backward, and the public firmware does not count its ticks."""
    one = motion(nominal("firmware", 1000), name, side_m=1.0)
    assert off_m(one) < 0.15
    assert one.sigmas < 3.0


def test_hard_steering_to_both_sides_is_followed() -> None:
    """Wheels reverse several times a second; a documented board reports each tick."""
    one = motion(nominal("documented", 1001), "jerky")
    assert off_m(one) < 0.05
    assert abs(one.error.yaw_rad) < math.radians(5.0)


@BOTH
@pytest.mark.parametrize("name", ["curve", "in place"])
def test_with_a_hundredth_of_all_bytes_lost_it_is_hardly_worse(
    firmware: Firmware, name: str
) -> None:
    """Three of five groups are lost, but the counters in the others show the missed ticks."""
    one = drive(nominal(firmware, 5), CLASSES[name], loss=0.01)
    assert off_m(one) < 0.1 * max(one.way_m, 2.0)
    assert abs(one.error.yaw_rad) < math.radians(10.0)
    assert one.sigmas < 4.0


# How the pose is estimated


def settled(firmware: Firmware) -> Rig:
    """Return a rig whose board is configured."""
    rig = Rig(nominal(firmware))
    rig.run(4.0)
    return rig


def test_the_boards_own_odometry_would_be_wrong() -> None:
    """It misses more than 15 % of a straight drive, so it is not passed on as it is."""
    rig = settled("firmware")
    rig.order(20, 20, 8.0)
    board = rig.board.odometry.pose
    truth = rig.board.truth
    assert math.hypot(board[0], board[1]) < 0.85 * math.hypot(truth.x_m, truth.y_m)
    estimate = rig.estimates[-1][0].pose
    assert estimate.way_m > 0.95 * math.hypot(truth.x_m, truth.y_m)


@BOTH
def test_it_says_where_the_board_is_blind(firmware: Firmware) -> None:
    """The public firmware counts no ticks backward, so commands and heading replace them there."""
    rig = settled(firmware)
    rig.order(20, 20, 4.0)
    assert rig.estimates[-1][0].source == "ticks"
    rig.order(0, 0, 2.0)
    assert rig.estimates[-1][0].source == "standing"
    rig.order(-20, -20, 4.0)
    last = rig.estimates[-1][0]
    assert last.blind is (firmware == "firmware")
    assert last.source == ("commands and heading" if last.blind else "ticks")
    rig.order(0, 0, 2.5)
    rig.order(-20, 20, 4.0)
    expected = "ticks and heading" if firmware == "firmware" else "ticks"
    assert rig.estimates[-1][0].source == expected


@BOTH
def test_a_robot_that_stands_does_not_move_in_odom(firmware: Firmware) -> None:
    """Report 0x20 repeats an old velocity, which must not move the pose."""
    rig = settled(firmware)
    rig.order(20, 25, 4.0)
    rig.order(0, 0, 2.0)
    place = rig.estimates[-1][0].pose
    rig.run(10.0)
    assert rig.estimates[-1][0].pose == place
    assert rig.estimates[-1][0].twist.vx_mps == 0.0
    predicted = rig.driver.predicted(rig.now + 0.2)
    assert predicted is not None
    assert predicted.pose.way_to(place).way_m < 1e-9


@BOTH
def test_predictions_lead_to_the_next_estimate(firmware: Firmware) -> None:
    """At 20 Hz between groups, their covariance grows and their mean error is below 3 cm."""
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
    """The displacements add up to the way, and each step stays below 1 m/s plus 3 cm."""
    rig = settled(firmware)
    rig.order(30, 30, 5.0)
    rig.order(*STOP, 2.0)
    way_m = sum(estimate.displacement.x_m for estimate, _ in rig.estimates)
    assert way_m == pytest.approx(rig.way_m, rel=0.03)
    for (before, _), (after, _) in pairwise(rig.estimates):
        step_m = before.pose.way_to(after.pose).way_m
        assert step_m < 1.0 * (after.stamp_s - before.stamp_s) + 0.03


def test_a_board_that_begins_anew_does_not_move_the_robot() -> None:
    """Its counters restart at zero, which is not motion; rolling out adds at most 5 cm."""
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
    """Set-points that continue during the restart move the pose no further than the robot."""
    rig = settled(firmware)
    rig.order(*pair, 4.0)
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
    assert rig.driver.translation.restarts == 1
    believed, true = first.pose.way_to(last.pose), before.way_to(rig.place)
    assert believed.way_to(true).way_m < 0.12
    assert believed.yaw_rad == pytest.approx(true.yaw_rad, abs=math.radians(12))


def test_other_wheels_count_from_the_next_group_on() -> None:
    """The way until then is not scaled again."""
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


def test_wheels_that_were_held_before_they_were_stopped_are_where_their_ticks_say() -> None:
    """Ticks after a silence of half a second correct a prediction that was too far ahead.

    The wheels should have rolled on in that time. How far they roll after they are stopped is not
    counted.
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


def test_a_velocity_that_is_no_number_is_no_speed() -> None:
    """The velocity is ignored, and the heading in the same report is used."""
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
    """The estimate is poor, and its standard deviation exceeds 20 % of the way."""
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
    """The board's left wheel is the robot's right one; the estimate is still right."""
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
    """With the boot gains a wheel swings for good, and nothing shows how between two groups."""

    def variance() -> float:
        """Return the variance in (m/s)² that is predicted after four ticks too many."""
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
