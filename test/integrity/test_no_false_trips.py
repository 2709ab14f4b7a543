# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A short version of ``no_false_trips``: half a minute with each kind of robot."""

import pytest
from rough_drive import RoughDrive


@pytest.mark.parametrize(("seed", "delta_period_s"), [(0, 0.04), (1, 0.1), (2, 0.1), (3, 0.04)])
def test_a_robot_that_obeys_is_not_stopped_by_the_motion_monitor(
    seed: int, delta_period_s: float
) -> None:
    """A robot obeys its commands on a slope, with slip and delays.

    People push, bump, hold and carry it. The motion monitor does not stop it.
    """
    outcome = RoughDrive(seed, delta_period_s).go(30.0)
    assert outcome.trips == []
    assert outcome.happened.total() > 0


def test_the_rough_drive_would_notice() -> None:
    """In the rough drive, the wheels of a robot turn more than twice as fast as commanded.

    The motion monitor stops the robot.
    """
    drive = RoughDrive(0)
    drive.board.settings = drive.board.settings.__class__(linear_scale=30.0, running=True)
    assert drive.go(30.0).trips
