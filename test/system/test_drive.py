# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Test of a long drive with the driver as a process, on a line that loses bytes."""

from drive import drive


def test_over_a_bad_line_few_messages_are_wrong_and_odom_is_near_the_boards_pose() -> None:
    """On a line that loses single bytes and whole bursts, at most 3 in 1,000 messages are wrong.

    The error of odom stays below 15 cm.
    """
    outcome = drive(12.0, lose=0.001, burst=0.0005)
    assert outcome.bytes_lost > 60, outcome
    assert outcome.imu_received > 0.85 * outcome.imu_sent, outcome
    assert outcome.odom_received > 0.85 * outcome.odom_sent, outcome
    messages = outcome.imu_received + outcome.odom_received
    assert outcome.imu_wrong + outcome.odom_wrong <= 0.003 * messages, outcome
    assert outcome.worst_m < 0.15, outcome
    assert outcome.way_m > 2.0, outcome
