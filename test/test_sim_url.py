# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ``sim://``: a simulated board in the driver's own process, without ROS."""

import pytest
from listener import Listener, link_to, session

from omnibot_driver.core.events import Notice
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.simulator.omnibot import SimulatedBoard

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_a_robot_drives_without_a_port_and_without_another_process() -> None:
    """The board boots, is started, obeys a command and reports odometry, in real time."""
    listener, ours = Listener(), session()
    link = link_to("sim://", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")

    def drives() -> bool:
        """Repeat the command, so that it cannot time out. Return whether the robot drives."""
        link.call(lambda s, now: s.command_twist(BodyTwist(0.3, 0.0, 0.0), now))
        return any(
            isinstance(event, OdometryEstimate) and event.twist and event.twist.vx_mps > 0.1
            for event in listener.events
        )

    listener.wait_for(drives)
    link.close("stop")
    assert listener.reports == [None]


def test_a_board_that_ends_with_the_driver_needs_no_guard() -> None:
    """A simulated board ends with the driver's process, so it needs no guard process.

    Therefore the driver does not warn that there is none.
    """
    listener, ours = Listener(), session()
    link = link_to("sim://?running", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "nominal")
    link.close("stop")
    assert not [event for event in listener.events if isinstance(event, Notice)]


def test_options_come_after_a_question_mark() -> None:
    """The options after the question mark are those of the simulator."""
    listener, ours = Listener(), session()
    link = link_to("sim://?imu_only&seed=1&lose=0.001", listener, ours)
    link.start()
    listener.wait_for(lambda: ours.state == "imu_only")
    link.close("stop")


def test_a_board_whose_thread_died_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread of the simulated board fails.

    The driver reports this as a defect, with its cause. It does not report a lost cable.
    """

    def explode(_board: SimulatedBoard) -> bytes:
        raise ZeroDivisionError

    monkeypatch.setattr(SimulatedBoard, "step", explode)
    listener = Listener()
    link = link_to("sim://", listener, session())
    link.start()
    listener.wait_for(lambda: listener.failures)
    link.close("stop")
    assert isinstance(listener.failures[0].__cause__, ZeroDivisionError)
