# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a report's findings on the messages of a healthy drive, and of drives with a fault."""

from dataclasses import replace

import numpy as np
import pytest
from drives import Drive
from verdicts import said, troubles

from omnibot_driver.tools.report.findings import Level, headline
from omnibot_driver.tools.report.judge import judge
from omnibot_driver.tools.report.log import Log


@pytest.fixture
def drive() -> Drive:
    return Drive()


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
    """The board is lost for a while. The report mentions this loss once, from the driver's state.

    The loss also causes gaps in the board's data. The report does not mention these gaps.
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


def test_stamps_that_leap_and_come_back_are_no_gap(drive: Drive) -> None:
    """Timestamps jump ahead by 20 ms, and then slowly become right again.

    This happens if the driver could not read for some time. The report calls it a jump, not a gap.
    """
    drive.imu.stamp_s[800:850] += np.linspace(0.020, 0.0, 50)
    drive.imu.late_s = drive.imu.late_s + 0.05
    (leap,) = troubles(drive)
    assert "jumped 1 time, by up to 20 ms, first at 8.0 s" in leap.text
    assert "no gap" in said(drive, "Gaps", "imu/data_raw").text


def test_uneven_stamps_are_noticed(drive: Drive) -> None:
    """Uneven timestamps, for example arrival times, are reported."""
    drive.imu.stamp_s = drive.imu.stamp_s + np.random.default_rng(2).uniform(0, 4e-3, 2000)
    (jitter,) = troubles(drive)
    assert jitter.subject == "Timing"
    assert "steps between stamps of imu/data_raw vary" in jitter.text


def test_a_board_that_was_lost_and_sought_was_out_of_reach_once(drive: Drive) -> None:
    """The driver's states ``disconnected`` and ``connecting`` follow each other.

    The report counts one loss of the board.
    """
    drive.states += [(8.0, "disconnected"), (8.5, "connecting"), (9.0, "nominal")]
    for topic in (drive.imu, drive.odom, drive.joints):
        topic.drop(8.0, 9.0)
    assert "1 time, first at 8.0 s" in said(drive, "State", "out of reach").text


def test_a_stream_that_ends_before_the_others_has_a_gap(drive: Drive) -> None:
    """The messages of a topic end early. The report shows a gap up to the end of the log.

    If the driver's state explains the early end, for example by a pause, the report shows no gap.
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


def test_stamps_that_go_back_are_wrong(drive: Drive) -> None:
    """A timestamp is not later than the one before it. The level of this finding is BAD."""
    drive.odom.stamp_s[100:] -= 0.2
    drive.odom.late_s[100:] += 0.2
    assert said(drive, "Timing", "1 stamp of odom").level is Level.BAD


def test_messages_that_wait_are_told_with_the_cure(drive: Drive) -> None:
    """The delays are like those of a USB latency timer of 16 ms. The advice names this timer."""
    drive.imu.late_s = drive.imu.late_s + np.remainder(-drive.imu.stamp_s, 0.016)
    late = said(drive, "Timing", "The delay of imu/data_raw")
    assert late.level is Level.WARN
    assert "latency_timer" in late.advice


def test_a_recorder_with_another_clock_is_told_once(drive: Drive) -> None:
    """All IMU messages arrive 30 s after their timestamps.

    The report has only one finding about this delay.
    """
    drive.imu.late_s = drive.imu.late_s + 30.0
    (clock,) = troubles(drive)
    assert "30 s after its stamp" in clock.text


@pytest.mark.parametrize("ahead_s", [3.0, -3.0])
def test_another_clock_shows_no_motion_without_or_against_a_command(ahead_s: float) -> None:
    """The recorder's clock is 3 s ahead of the robot's clock, or 3 s behind it.

    The robot drives as commanded. After the drive, the e-stop is latched. The report names only the
    difference of the clocks. It does not say that the robot moved without a command, or that it
    moved against a command.
    """
    drive = Drive(estops=[(0.0, False), (16.5 + ahead_s, True)])
    for topic in (drive.imu, drive.odom, drive.joints, drive.cmd_vel):
        topic.late_s = topic.late_s + ahead_s
    log = replace(drive.log(), duration_s=drive.seconds + ahead_s)
    found = [finding for finding in judge(log) if finding.level > Level.NOTE]
    assert found
    assert all("after its stamp" in finding.text for finding in found), found


@pytest.mark.parametrize("by_s", [3.65e9, -3600.0, -3.0, 0.5])
def test_a_step_of_the_recorders_clock_is_told_and_is_no_delay(by_s: float) -> None:
    """The clock of the recording computer is set during the drive, so it steps.

    The report has one finding about this step, and no other trouble. It does not say that messages
    wait, or that the robot moved without a command.
    """
    drive = Drive()
    for topic in (drive.imu, drive.odom, drive.joints, drive.cmd_vel):
        topic.late_s = topic.late_s + by_s * (topic.stamp_s > 8.0)
    arrived_s = [drive.imu.stamp_s + drive.imu.late_s, drive.odom.stamp_s + drive.odom.late_s]
    log = replace(drive.log(), duration_s=float(np.concatenate(arrived_s).max()))
    (found,) = [finding for finding in judge(log) if finding.level > Level.NOTE]
    assert "The recorder's clock stepped" in found.text
    assert f"{'forward' if by_s > 0.0 else 'back'} by" in found.text
    assert "8.0 s after the first message" in found.text


def test_a_step_of_the_drivers_clock_is_told_as_that() -> None:
    """The clock of the driver's computer steps forward by an hour.

    The clock of the recorder does not step. The report names the driver's clock.
    """
    drive = Drive()
    for topic in (drive.imu, drive.odom, drive.joints):
        rows = topic.stamp_s > 8.0
        topic.stamp_s[rows] += 3600.0
        topic.late_s[rows] -= 3600.0
    text = said(drive, "Recording", "clock stepped").text
    assert text.startswith("The driver's clock stepped forward by 1 h 00 min")


def test_messages_that_waited_once_are_not_a_step_of_a_clock(drive: Drive) -> None:
    """The recorder is busy for 2 s. All messages of this time arrive at its end."""
    waiting = (drive.imu.stamp_s > 8.0) & (drive.imu.stamp_s < 10.0)
    drive.imu.late_s[waiting] = 10.0 - drive.imu.stamp_s[waiting]
    assert not [one for one in judge(drive.log()) if "clock" in one.text]
    assert "latency_timer" in said(drive, "Timing", "The delay of imu/data_raw").advice


def test_a_delay_that_ends_is_not_a_step_of_a_clock(drive: Drive) -> None:
    """For 1.5 s, all messages arrive 0.5 s later. A few are lost, then the delays are as before."""
    for topic in (drive.imu, drive.odom):
        topic.late_s[(topic.stamp_s > 8.0) & (topic.stamp_s < 10.0)] += 0.5
        topic.drop(9.5, 10.0)
    assert not [one for one in judge(drive.log()) if "clock" in one.text]


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
    """Return the log of ``drive`` among several robots, with these diagnostics of all of them."""
    drive.statuses[:] = [(1.5, "omnibot_driver: Stream", 0, "complete", one) for one in streams]
    return replace(drive.log(), alone=False)


def test_the_rate_of_another_robot_is_not_expected(drive: Drive) -> None:
    """A recording has an OmniBot and a MART, whose odometry has different rates.

    The report gives the measured rate of each, and does not say what it should be. The rate of the
    IMU can only belong to the robot with an IMU.
    """
    for name in ("stamp_s", "values", "late_s"):
        setattr(drive.odom, name, getattr(drive.odom, name)[::2])
    found = judge(beside(drive, OMNIBOT, MART))
    (odom,) = [one for one in found if one.text.startswith("The rate of odom")]
    assert odom.level is Level.NOTE
    assert "is 12.50 Hz. The recording does not show what it should be." in odom.text
    assert any("imu/data_raw is 100.00 Hz; it should be 100 Hz" in one.text for one in found)


def test_robots_of_the_same_kind_have_the_same_expected_rate(drive: Drive) -> None:
    """A recording has two MARTs, and one of them sends too much. The report finds it."""
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
    """A robot sent no message of an IMU, and there is another robot.

    If only one of the two has an IMU, only a topic shows that it is this robot. This is also true
    if the other robot has only diagnostics in the recording.
    """
    drive.imu.drop(0.0, 99.0)
    for alone in (False, True):
        log = replace(beside(drive, *streams), topics=topics, alone=alone)
        found = [one.level for one in judge(log) if one.subject == "Recording"]
        assert found == ([] if level is None else [level])


def test_no_rate_of_an_omnibot_is_expected_of_two_wheels(drive: Drive) -> None:
    """A recording of a robot with two wheels has no diagnostics. The rate gets no verdict."""
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


def test_stamps_of_zero_are_told(drive: Drive) -> None:
    """Some messages have no timestamp, although the driver stamps all its messages.

    The report mentions the messages without a timestamp.
    """
    log = drive.log()
    log.imu.stamp_s[:3] = np.nan
    assert any("3 messages of imu/data_raw without a stamp" in item.text for item in judge(log))
