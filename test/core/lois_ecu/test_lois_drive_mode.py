# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Changes of the drive mode, the duty scale and the largest duty of a LOIS ECU, during a drive.

Before such a change, the driver stops the robot and refuses motion.
"""

from enum import Enum

import pytest
from lois_bench import FIRMWARE, Bench, configure, refusal

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings


@pytest.mark.slow
@FIRMWARE
def test_another_drive_mode_stops_first(firmware: str) -> None:
    """The user sets another drive mode while the robot drives.

    The driver stops the robot, and refuses motion until the robot rests.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    with pytest.raises(CommandRefused, match="drive_mode is changing to duty"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)
    with pytest.raises(CommandRefused, match="wait"):
        bench.drive()
    bench.run(1.0)
    bench.drive_on(0.3, 2.0)
    assert bench.board.commands[-1].command == 0x01
    assert not bench.robot.stands


@pytest.mark.slow
@FIRMWARE
def test_backward_duty_after_a_forward_drive_is_backward_motion(firmware: str) -> None:
    """The user changes to duty mode in a forward drive, and then drives backward.

    The odometry moves backward, because the driver clears the RPM target. The public firmware
    counts all ticks as forward while this target is forward.
    """
    bench = Bench(firmware)
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty"))
    bench.run_until(lambda: refusal(bench, -0.3) == "")
    before_m, before = bench.robot.way_m, bench.odometry[-1].pose
    bench.drive_on(-0.3, 1.5)
    assert bench.robot.way_m < before_m - 0.1
    assert before.way_to(bench.odometry[-1].pose).x_m < -0.1
    assert not [notice for notice in bench.notices if "motion monitor" in notice]


def test_a_lower_max_duty_stops_a_robot_that_is_driven_by_duties() -> None:
    """The user lowers ``max_duty`` while the robot is driven by duties. The driver stops the robot.

    When the user raises ``max_duty`` later, the earlier command does not move the robot again.
    """
    bench = Bench("firmware", LoisEcuSettings(drive_mode="duty", max_duty=60))
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty", max_duty=10))
    with pytest.raises(CommandRefused, match="max_duty is changing to 10"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)
    configure(bench, LoisEcuSettings(drive_mode="duty", max_duty=60))
    bench.run(2.0)
    assert bench.robot.stands
    bench.drive_on(0.3, 1.0)
    assert not bench.robot.stands


def test_another_duty_scale_stops_a_robot_that_is_driven_by_duties() -> None:
    """The robot is driven by duties, which depend on the duty scale. The user changes this scale.

    The driver stops the robot first.
    """
    bench = Bench("firmware", LoisEcuSettings(drive_mode="duty"))
    bench.drive_on(0.3, 3.0)
    configure(bench, LoisEcuSettings(drive_mode="duty", duty_scale=500.0))
    with pytest.raises(CommandRefused, match="duty_scale is changing to 500"):
        bench.drive()
    bench.run_until(lambda: bench.robot.stands)


def test_the_robot_is_stopped_between_a_topic_of_this_board_and_wheel_cmd() -> None:
    """Wheel rates come from a topic that only this board has, and then from ``wheel_cmd``.

    The driver sends Stop in between, as for every change of the commanding topic.
    """
    bench = Bench("documented", LoisEcuSettings(drive_mode="duty"))
    own = Enum("own", {"DUTY": "duty_cmd"}).DUTY  # type: ignore[attr-defined]
    bench.session.command_wheels((1.0, 1.0), bench.now, by=own)
    bench.run(0.2)
    assert bench.session.figures(bench.now).commands.source == "duty_cmd"
    before = len(bench.written)
    bench.session.command_wheels((1.0, 1.0), bench.now)
    bench.run(0.2)
    duties = [data for _, data in bench.written[before:] if data.startswith(b":01")]
    assert duties[0] == b":01000000003b\n" != duties[-1]
