# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a report's findings on stamps, delays and clocks."""

from dataclasses import replace

import numpy as np
import pytest
from drives import Drive
from verdicts import said, troubles

from omnibot_driver.tools.report.findings import Level
from omnibot_driver.tools.report.judge import judge


def test_stamps_that_leap_and_come_back_are_no_gap(drive: Drive) -> None:
    """The IMU's timestamps jump ahead by 20 ms, and return to the right times within 50 samples.

    The report calls this a jump, not a gap.
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
    """If the recorder's clock is 3 s off, the report names only the difference of the clocks.

    Motion without a command, or against one, is not reported.
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
    """The report has one finding about a step of the recorder's clock, and no other trouble."""
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
    """The recorder is busy for 2 s, then gets all IMU messages of this time at once.

    The report finds a delay, but no step of a clock.
    """
    waiting = (drive.imu.stamp_s > 8.0) & (drive.imu.stamp_s < 10.0)
    drive.imu.late_s[waiting] = 10.0 - drive.imu.stamp_s[waiting]
    assert not [one for one in judge(drive.log()) if "clock" in one.text]
    assert "latency_timer" in said(drive, "Timing", "The delay of imu/data_raw").advice


def test_a_delay_that_ends_is_not_a_step_of_a_clock(drive: Drive) -> None:
    """For 1.5 s, all messages arrive 0.5 s later. Then a few are lost, and the delay ends.

    The report does not take this for a step of a clock.
    """
    for topic in (drive.imu, drive.odom):
        topic.late_s[(topic.stamp_s > 8.0) & (topic.stamp_s < 10.0)] += 0.5
        topic.drop(9.5, 10.0)
    assert not [one for one in judge(drive.log()) if "clock" in one.text]


def test_stamps_of_zero_are_told(drive: Drive) -> None:
    """Some messages have no timestamp, although the driver stamps all its messages.

    The report mentions the messages without a timestamp.
    """
    log = drive.log()
    log.imu.stamp_s[:3] = np.nan
    assert any("3 messages of imu/data_raw without a stamp" in item.text for item in judge(log))
