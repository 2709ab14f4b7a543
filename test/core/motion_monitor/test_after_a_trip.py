# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of when a robot may move again after the motion monitor has stopped it."""

from dataclasses import replace

import pytest
from disobedient_robots import (
    SLOWLY,
    on_the_wrong_switch,
    started,
    stopped_after_s,
    try_to_drive,
)
from robots import estop

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.measurement.outlier_filter import MotionLimits
from omnibot_driver.core.requests import Request
from omnibot_driver.simulator.omnibot import BoardSettings


def test_without_the_motion_monitor_it_drives_on_until_that_is_back() -> None:
    """The motion monitor stops a robot with wrong wiring only while the monitor is switched on."""
    bench = started(BoardSettings(running=True, motor_wiring=(-1, 2, 3)))
    stopped_after_s(bench, SLOWLY)
    bench.configure(motion_monitor=False)
    assert try_to_drive(bench, 2.0) == 20
    assert not bench.session.figures(bench.now).commands.monitored
    bench.configure(motion_monitor=True)
    assert stopped_after_s(bench, SLOWLY) <= 1.0
    assert bench.session.figures(bench.now).commands.interlock


def test_displacements_rejected_while_the_motion_monitor_is_off_stop_no_robot_later() -> None:
    """Displacements rejected while the motion monitor was off do not stop the robot later.

    They were rejected because a motion limit was too low.
    """
    bench = started(BoardSettings(running=True))
    for limits in (MotionLimits(fastest_mps=0.01), MotionLimits()):
        bench.configure(motion_monitor=False, motion=limits)
        assert try_to_drive(bench, 1.0) == 10
    assert bench.session.refused.displacements > 4
    bench.configure(motion_monitor=True)
    assert try_to_drive(bench, 2.0) == 20
    assert bench.session.figures(bench.now).commands.trips == 0


def test_displacements_rejected_after_the_motion_monitor_is_on_again_are_a_fault() -> None:
    """While displacements are rejected, the motion monitor is switched off and on again.

    Four rejections with the motion monitor on stop the robot. Earlier rejections do not count.
    """
    bench = started(BoardSettings(running=True))
    too_low = MotionLimits(fastest_mps=0.01)
    bench.configure(motion_monitor=False, motion=too_low)
    assert try_to_drive(bench, 1.0) == 10
    bench.configure(motion=too_low)
    bench.run(0.12)
    assert bench.session.figures(bench.now).commands.trips == 0
    bench.run(0.08)
    assert bench.session.figures(bench.now).commands.trips == 1


def test_a_refused_command_says_why() -> None:
    """The motion monitor has stopped the robot, and a command is refused.

    The message names the motion monitor and says what to do.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    with pytest.raises(CommandRefused, match="the motion monitor has stopped the robot; send a"):
        bench.drive(*SLOWLY)


def test_a_sender_that_goes_on_does_not_restart_the_robot() -> None:
    """A sender continues after a stop by the motion monitor, and is refused until it commands zero.

    After a second stop, the sender's motion commands are refused until ~/start is called.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    assert try_to_drive(bench, 3.0) == 0
    where = bench.board.truth.x_m
    assert try_to_drive(bench, 3.0) == 0
    assert bench.board.truth.x_m == pytest.approx(where, abs=0.001)
    bench.drive()
    assert 0 < try_to_drive(bench, 2.0) < 12
    assert "until ~/start" in bench.notices[-1]
    bench.drive()
    bench.run(1.0)
    assert try_to_drive(bench, 2.0) == 0
    assert bench.session.figures(bench.now).commands.trips == 2
    assert bench.ask(Request.START, 5.0).success
    assert try_to_drive(bench, 1.0) > 0


def test_silence_for_the_timeout_lets_it_move_again() -> None:
    """The motion monitor stops the robot. Then no command arrives for ``cmd_vel_timeout``.

    After this time, the driver accepts motion commands again.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    assert try_to_drive(bench, 2.0) == 0
    assert bench.session.figures(bench.now).commands.interlock
    bench.run(0.6)
    assert try_to_drive(bench, 0.1) == 1
    assert not bench.session.figures(bench.now).commands.interlock


def test_a_refusal_that_silence_has_ended_is_not_shown() -> None:
    """After the first stop by the motion monitor, the driver refuses commands.

    The refusal ends when no command has arrived for ``cmd_vel_timeout``. From then on,
    ``/diagnostics`` does not report it.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    bench.run(0.3)
    assert bench.session.figures(bench.now).commands.interlock
    bench.run(0.3)
    assert bench.session.figures(bench.now).commands.interlock == ""
    assert try_to_drive(bench, 0.1) == 1


def test_a_stall_of_the_driver_is_not_silence_of_the_sender() -> None:
    """After a stop by the motion monitor, commands are refused until the sender is silent.

    The time in which the driver stalls does not count as silence.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    bench.now += 3.0
    bench.session.stood_still(3.0, bench.now)
    bench.run(0.3)
    assert try_to_drive(bench, 2.0) == 0
    bench.run(0.6)
    assert try_to_drive(bench, 0.1) == 1


def test_a_stall_of_the_driver_does_not_bring_back_a_refusal_that_has_ended() -> None:
    """A stall of the driver does not bring back a refusal of commands that has ended.

    The motion monitor caused the refusal, and silence of the sender ended it.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    bench.run(0.6)
    bench.now += 3.0
    bench.session.stood_still(3.0, bench.now)
    assert bench.session.figures(bench.now).commands.interlock == ""
    assert try_to_drive(bench, 0.1) == 1


def test_a_longer_timeout_does_not_bring_back_a_refusal_that_has_ended() -> None:
    """A longer ``cmd_vel_timeout`` does not bring back a refusal of commands that has ended.

    The motion monitor caused the refusal, and silence of the sender ended it.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    bench.run(0.6)
    bench.configure(commands=replace(bench.settings.commands, timeout_s=10.0))
    assert bench.session.figures(bench.now).commands.interlock == ""
    assert try_to_drive(bench, 0.1) == 1


def test_the_e_stop_works_while_motion_is_refused() -> None:
    """The motion monitor has stopped the robot. The user latches and releases the e-stop.

    Motion is still refused.
    """
    bench = on_the_wrong_switch("earth")
    stopped_after_s(bench, SLOWLY)
    assert estop(bench, True) == "e-stop latched"
    estop(bench, False)
    assert try_to_drive(bench, 0.3) == 0
