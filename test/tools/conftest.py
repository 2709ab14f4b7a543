# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fixtures: a simulated robot for each test module, a connection to its driver, and a drive."""

from collections.abc import Iterator

import pytest
from calibrate_rig import Rig, rig, robot_of
from drives import Drive

from omnibot_driver.tools.calibrate.robot import Robot


@pytest.fixture(scope="module")
def rigged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("robot")) as robot:
        yield robot


@pytest.fixture
def robot(rigged: Rig) -> Iterator[Robot]:
    """Yield the connection of a calibration tool to the robot's driver.

    The e-stop is released.
    """
    with robot_of(rigged.driver) as robot:
        if robot._estop:
            robot.call("estop", False)
        yield robot


@pytest.fixture
def drive() -> Drive:
    """Return a healthy synthetic drive, which a test may change."""
    return Drive()
