# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a report's findings on a healthy drive, and on gaps, rates, states and diagnostics."""

from dataclasses import replace

import numpy as np
import pytest
from drives import Drive
from verdicts import said, troubles

from omnibot_driver.tools.report.findings import Level, headline
from omnibot_driver.tools.report.judge import judge
from omnibot_driver.tools.report.log import Log


def test_a_healthy_drive_is_called_healthy(drive: Drive) -> None:
    """The drive is healthy. The findings have numbers, but no advice."""
    findings = judge(drive.log())
    assert not troubles(drive)
    assert headline(findings) == "Healthy."
    assert not any(finding.advice for finding in findings)
    assert "100.00 Hz" in said(drive, "Timing", "rate of imu/data_raw").text
    assert "9.80" in said(drive, "IMU", "Gravity").text
    assert "vx 1.0" in said(drive, "Commands", "follows").text


def test_a_gap_is_told_with_its_place_and_what_is_missing(drive: Drive) -> None:
    """Messages are missing for a while.

    The report gives the time of this gap, and how many are missing.
    """
    drive.imu.drop(6.0, 6.15)
    (gap,) = troubles(drive)
    assert gap.level is Level.WARN
    assert "1 gap, 15 messages" in gap.text
    assert "from 6.0 s on" in gap.text
    assert "driver counts no loss" in gap.advice


def test_a_loss_that_the_driver_counts_is_laid_to_the_line(drive: Drive) -> None:
    """The driver's diagnostics count the frames that were lost on the serial line during a gap.

    The report names the serial line as the cause of the gap.
    """
    drive.imu.drop(6.0, 6.1)
    for at_s, *_, values in drive.statuses:
        values["IMU frames lost"] = "7" if at_s < 7.0 else "17"
    assert (
        "has counted 10 messages that were lost on the line"
        in said(drive, "Gaps", "imu/data_raw").advice
    )


def test_a_long_gap_is_worse(drive: Drive) -> None:
    """The odometry has a gap of 1 s.

    A gap of more than 0.5 s has the level BAD, not WARN.
    """
    drive.odom.drop(8.0, 9.0)
    assert said(drive, "Gaps", "odom", "1 gap").level is Level.BAD


def test_a_pause_is_not_a_gap(drive: Drive) -> None:
    """Messages are missing while the driver is paused. The report does not call this a gap."""
    drive.states += [(16.9, "paused"), (18.0, "nominal")]
    drive.imu.drop(17.0, 18.0)
    drive.odom.drop(17.0, 18.0)
    assert not troubles(drive)
    assert "paused for 1.1 s" in said(drive, "State", "ominal").text


def test_a_lost_board_is_reported_and_is_not_counted_as_a_gap_too(drive: Drive) -> None:
    """The report mentions a loss of the board once, from the driver's state.

    Gaps in the board's data that the loss causes are not mentioned.
    """
    drive.states += [(17.0, "connecting"), (18.0, "nominal")]
    drive.imu.drop(16.9, 18.0)
    drive.odom.drop(16.9, 18.0)
    assert [finding.subject for finding in troubles(drive)] == ["State"]


def test_the_end_of_the_driver_is_not_a_lost_board(drive: Drive) -> None:
    """The last state is ``disconnected``.

    The report mentions the end of the driver, and no loss of the board.
    """
    drive.states.append((19.5, "disconnected"))
    assert not troubles(drive)
    assert "ended at 19.5 s" in said(drive, "State", "driver").text


def test_a_board_that_was_lost_and_sought_was_out_of_reach_once(drive: Drive) -> None:
    """The driver's states ``disconnected`` and ``connecting`` follow each other.

    The report counts one loss of the board.
    """
    drive.states += [(8.0, "disconnected"), (8.5, "connecting"), (9.0, "nominal")]
    for topic in (drive.imu, drive.odom, drive.joints):
        topic.drop(8.0, 9.0)
    assert "1 time, first at 8.0 s" in said(drive, "State", "out of reach").text


def test_a_stream_that_ends_before_the_others_has_a_gap(drive: Drive) -> None:
    """If the messages of a topic end early, the report shows a gap up to the end of the log.

    There is no gap if the driver's state explains the end.
    """
    drive.imu.drop(17.0, 99.0)
    gap = said(drive, "Gaps", "imu/data_raw has 1 gap, 301 messages")
    assert gap.level is Level.BAD
    assert "3.01 s, from 17.0 s on" in gap.text
    drive.states.append((17.0, "paused"))
    assert not [
        finding for finding in judge(drive.log()) if finding.text.startswith("imu/data_raw has 1")
    ]


def test_a_gap_at_the_end_begins_at_a_timestamp_too(drive: Drive) -> None:
    """The recorder's clock is 3 s behind the robot's clock, and a topic ends early.

    The report gives the beginning of this gap by the messages' timestamps, not by their arrival.
    """
    drive.imu.drop(17.0, 99.0)
    drive.imu.late_s = drive.imu.late_s - 3.0
    assert "from 17.0 s on" in said(drive, "Gaps", "imu/data_raw").text


def test_a_wrong_rate_is_reported_as_that_and_not_as_a_gap(drive: Drive) -> None:
    """Every second IMU reading is missing. The report says that the rate is wrong.

    It does not report gaps.
    """
    for name in ("stamp_s", "values", "late_s"):
        setattr(drive.imu, name, getattr(drive.imu, name)[::2])
    found = [finding.text for finding in troubles(drive) if finding.subject in ("Timing", "Gaps")]
    assert found == ["The rate of imu/data_raw is 50.00 Hz; it should be 100 Hz."]


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        ({"Odometry rate (Hz)": "24.9 of 25"}, "it should be 25"),
        ({"Odometry rate (Hz)": "4.9 of 5", "Published odometry (Hz)": "20"}, "should be 20"),
        ({"Odometry rate (Hz)": "nan of nonsense"}, "it should be 25"),
    ],
)
def test_the_rate_that_a_stream_should_have_is_the_one_that_its_driver_says(
    values: dict[str, str], wanted: str
) -> None:
    """Boards send at different rates.

    The report takes the expected rate from the driver's diagnostics.
    """
    drive = Drive()
    drive.statuses.append((1.5, "omnibot_driver: Stream", 0, "complete", values))
    (found,) = [one for one in judge(drive.log()) if one.text.startswith("The rate of odom")]
    assert wanted in found.text
    assert (found.level is Level.WARN) is ("20" in wanted)


def test_numbers_that_are_none_are_counted_and_do_no_harm(drive: Drive) -> None:
    """Some messages have NaN or infinity.

    The report counts and omits them, and judges all others.
    """
    drive.imu.values[100:103, 4] = np.nan
    drive.odom.values[50, 0] = np.inf
    found = troubles(drive)
    assert [finding.level for finding in found] == [Level.BAD, Level.BAD]
    assert any("3 messages of imu/data_raw with NaN" in finding.text for finding in found)
    assert any("1 message of odom with NaN" in finding.text for finding in found)


def test_nothing_but_nan_is_told(drive: Drive) -> None:
    """Every message contains NaN. The report names all three kinds: IMU, odometry and commands."""
    for topic in (drive.imu, drive.odom, drive.cmd_vel, drive.joints):
        topic.values[:] = np.nan
    assert {finding.subject for finding in troubles(drive)} == {"IMU", "Odometry", "Commands"}


def test_what_an_estop_refuses_is_not_trouble(drive: Drive) -> None:
    """The driver refuses commands because of the e-stop. Its diagnostics warn of the refusal.

    The report omits this warning. It shows warnings about refusals that have other reasons.
    """
    why = "motion command refused: the e-stop is latched; release it with the service ~/estop"
    drive.statuses.append((9.5, "omnibot_driver: Commands", 1, why, {}))
    assert not troubles(drive)
    assert said(drive, "Diagnostics", "No warning").text == (
        "No warning and no error except for the start, pauses and the e-stop."
    )
    drive.statuses.append((9.5, "omnibot_driver: Commands", 1, "cmd_vel refused: nan", {}))
    assert "cmd_vel refused: nan" in said(drive, "Diagnostics", "Commands").text


def test_what_diagnostics_said_is_repeated(drive: Drive) -> None:
    """For each status of the diagnostics, the report gives the worst level and the message.

    It also gives how often the status was not OK.
    """
    drive.statuses.append((9.5, "omnibot_driver: Time", 1, "measurements wait", {}))
    drive.statuses.append((10.5, "omnibot_driver: Time", 1, "measurements wait", {}))
    drive.statuses.append((10.6, "omnibot_driver: IMU", 2, "the gyro is stuck", {}))
    first, second = troubles(drive)
    assert first.level is Level.BAD
    assert "the gyro is stuck" in first.text
    assert (
        "Time (/dev/ttyUSB0) was not OK 2 times, first at 10 s. The worst level was WARN, most"
        " often with the message “measurements wait” (2 times)." in second.text
    )


def test_counts_of_several_robots_are_not_laid_to_one(drive: Drive) -> None:
    """A bag has several robots, and /diagnostics does not show to which robot a count belongs.

    The report does not assign the counts to one robot.
    """
    drive.imu.drop(6.0, 6.1)
    findings = judge(replace(drive.log(), alone=False))
    (gap,) = [finding for finding in findings if finding.text.startswith("imu/data_raw has")]
    assert "while no other robot publishes on it" in gap.advice
    assert any("of several robots, on /dev/ttyUSB0" in finding.text for finding in findings)


OMNIBOT = {"IMU rate (Hz)": "100.0 of 100", "Odometry rate (Hz)": "25.0 of 25"}


MART = {"Odometry rate (Hz)": "4.9 of 5", "Published odometry (Hz)": "20"}


def beside(drive: Drive, *streams: dict[str, str]) -> Log:
    """Return the log of ``drive``, recorded while other robots published too.

    ``streams``: for each robot, the keys and values of its diagnostic status "Stream".
    """
    drive.statuses[:] = [(1.5, "omnibot_driver: Stream", 0, "complete", one) for one in streams]
    return replace(drive.log(), alone=False)


def test_the_rate_of_another_robot_is_not_expected(drive: Drive) -> None:
    """A bag with an OmniBot and a MART does not show which rate ``odom`` should have.

    The report gives the measured rate of ``odom`` only in a note. Only the OmniBot publishes
    ``imu/data_raw``, so the report expects 100 Hz there.
    """
    for name in ("stamp_s", "values", "late_s"):
        setattr(drive.odom, name, getattr(drive.odom, name)[::2])
    found = judge(beside(drive, OMNIBOT, MART))
    (odom,) = [one for one in found if one.text.startswith("The rate of odom")]
    assert odom.level is Level.NOTE
    assert "is 12.50 Hz. The recording does not show the expected rate." in odom.text
    assert any("imu/data_raw is 100.00 Hz; it should be 100 Hz" in one.text for one in found)


def test_robots_of_the_same_kind_have_the_same_expected_rate(drive: Drive) -> None:
    """A recording has two MARTs. The report warns of the one whose odometry has too high a rate."""
    found = judge(beside(drive, MART, MART))
    (odom,) = [one for one in found if one.text.startswith("The rate of odom")]
    assert odom.level is Level.WARN
    assert "it should be 20 Hz" in odom.text


@pytest.mark.parametrize(
    ("streams", "topics", "level"),
    [
        ((OMNIBOT, MART), ("odom",), Level.NOTE),
        ((OMNIBOT, MART), ("odom", "imu/data_raw"), Level.BAD),
        ((OMNIBOT, OMNIBOT), ("odom",), Level.BAD),
        ((MART, MART), ("odom",), None),
    ],
)
def test_the_imu_of_another_robot_is_not_expected(
    drive: Drive,
    streams: tuple[dict[str, str], ...],
    topics: tuple[str, ...],
    level: Level | None,
) -> None:
    """A bag of two robots has no IMU messages. The finding depends on which robots have an IMU.

    * Both have one, or a topic shows that the judged robot has one: BAD.
    * Only one has one, and no topic shows which: NOTE.
    * Neither has one: no finding.
    """
    drive.imu.drop(0.0, 99.0)
    for alone in (False, True):
        log = replace(beside(drive, *streams), topics=topics, alone=alone)
        found = [one.level for one in judge(log) if one.subject == "Recording"]
        assert found == ([] if level is None else [level])


def test_no_rate_of_an_omnibot_is_expected_of_two_wheels(drive: Drive) -> None:
    """The report gives no verdict on the rate of odom of a robot with two wheels.

    The recording has no diagnostics, and the OmniBot's rate does not apply to this robot.
    """
    drive.statuses.clear()
    drive.joints.values = drive.joints.values[:, :2]
    found = judge(replace(drive.log(), wheels=("left_wheel_joint", "right_wheel_joint")))
    (odom,) = [one for one in found if one.text.startswith("The rate of odom")]
    assert odom.level is Level.NOTE


def test_topics_that_are_missing_are_named(drive: Drive) -> None:
    """Odometry and commands are missing.

    Missing odometry is BAD, and missing commands are only a NOTE.
    """
    drive.odom.drop(0.0, 99.0)
    drive.cmd_vel.drop(0.0, 99.0)
    assert said(drive, "Recording", "No message of odom").level is Level.BAD
    assert said(drive, "Commands", "No message of cmd_vel or wheel_cmd").level is Level.NOTE
