# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Detectors of quirks in motion: how a board counts ticks, and how it measures and controls speeds.

A quirk is a deviation from the manual. Each function detects the quirk after which it is named.
"""

import math
from statistics import median

from lois_rig import Rig, odometry_in, ticks_in

from omnibot_driver.core.lois_ecu import (
    SetDuty,
    SetPeriod,
    SetRpm,
    Setting,
    Stream,
    WriteSetting,
)
from omnibot_driver.simulator.lois_ecu import Quirks

STRAIGHT = 20


def ticks_of_forward_targets(quirks: Quirks) -> bool:
    """Return whether the board counts ticks only for forward commands, not for backward ones."""
    rig = Rig(quirks).booted()
    rig.drive(-STRAIGHT, -STRAIGHT, 4.0)
    return ticks_in(rig.run(1.0))[-1].left == 0


def odometry_stands_at_equal_speeds(quirks: Quirks) -> bool:
    """Return whether message 0x20 reports less than 75 % of the distance driven straight.

    For this test, the controllers of both wheels get equal gains.
    """
    rig = Rig(quirks).booted()
    rig.say(WriteSetting(Setting.RIGHT_KP, 0.4412), WriteSetting(Setting.RIGHT_TN, 0.2865))
    rig.drive(STRAIGHT, STRAIGHT, 10.0)
    last, truth = odometry_in(rig.run(1.0))[-1], rig.board.truth
    return math.hypot(last.x_m, last.y_m) < 0.75 * math.hypot(truth.x_m, truth.y_m)


def velocity_may_be_nan(quirks: Quirks) -> bool:
    """Return whether some velocities that are reported in a straight drive are not finite.

    With this quirk, two ticks in one count of the timer make the board divide by zero.
    """
    rig = Rig(quirks).booted()
    rig.say(SetPeriod(Stream.TICKS, 60), SetDuty(60, 60))
    rig.run(3.0)
    groups = odometry_in([report for _, report in rig.heard])
    return any(not math.isfinite(group.dx_mps) for group in groups)


def sign_of_command(quirks: Quirks) -> bool:
    """Return whether the measured speed of a reversing wheel is negative too early.

    The wheel still turns forward when the measured speed becomes negative.
    """
    rig = Rig(quirks).booted()
    rig.drive(30, 40, 6.0)
    rig.say(SetRpm(-30, -40))
    for _ in range(60):
        rig.board.step()
        if rig.board.wheels[1].rpm < 0 < rig.board.motors[1].rpm:
            return True
    return False


def keeps_speed_of_stalled_wheel(quirks: Quirks) -> bool:
    """Return whether a wheel that has been blocked for 3 s still has a measured speed."""
    rig = Rig(quirks).booted()
    rig.drive(20, 30, 6.0)
    rig.board.hold(left=True, right=True)
    rig.run(3.0)
    return rig.board.wheels[0].rpm > 0


def duty_drags_target(quirks: Quirks) -> bool:
    """Return whether, after a negative duty, a positive duty gives a negative measured speed."""
    rig = Rig(quirks).booted()
    rig.say(SetDuty(-40, -30))
    rig.run(3.0)
    rig.say(SetDuty(0, 0))
    rig.run(1.0)
    rig.say(SetDuty(30, 40))
    rig.run(3.0)
    return rig.board.motors[0].rpm > 5 and rig.board.wheels[0].rpm < 0


def reverse_runs_fast(quirks: Quirks) -> bool:
    """Return whether the wheel turns at more than 31.2 RPM backward when 30 RPM are commanded."""
    rig = Rig(quirks).booted()
    rig.drive(-30, -30, 6.0)
    speeds = []
    for _ in range(300):
        rig.board.step()
        speeds.append(-rig.board.motors[0].rpm)
    return sum(speeds) / len(speeds) > 31.2


def low_pass_starts_at_zero(quirks: Quirks) -> bool:
    """Return whether the robot obeys no speed command before the low-pass filter is set."""
    rig = Rig(quirks)
    rig.run(2.1)
    rig.drive(30, 30, 5.0)
    return rig.board.standing


def slow_timer(quirks: Quirks) -> bool:
    """Return whether the measured speed is over 0.35 % too high.

    If the board has a slow timer, the measured speed is 0.7 % too high.
    """
    rig = Rig(quirks).booted()
    rig.drive(30, 30, 0.5)
    rig.say(SetDuty(50, 50))
    rig.run(2.0)
    parts = []
    for _ in range(500):
        rig.board.step()
        parts.append(rig.board.wheels[0].exact_rpm / rig.board.motors[0].rpm)
    near = [part for part in parts if abs(part - 1) < 0.03]  # without edges that were served late
    return sum(near) / len(near) > 1.0035


def limits_rpm(quirks: Quirks) -> bool:
    """Return whether the wheel turns at less than 55 RPM when 58 RPM are commanded."""
    rig = Rig(quirks).booted()
    rig.drive(58, 58, 2.0)
    speeds = []
    for _ in range(400):
        rig.board.step()
        speeds.append(rig.board.motors[0].rpm)
    return median(speeds) < 55


def fast_control(quirks: Quirks) -> bool:
    """Return whether each set-point takes effect within 110 ms."""
    delays = []
    rig = Rig(quirks).booted()
    for _ in range(12):
        rig.say(SetDuty(0, 0))
        rig.run(0.43)
        rig.say(SetDuty(50, 50))
        began = rig.board.commands[-1].tick
        while not rig.board.driven:
            rig.board.step()
        delays.append(rig.board.tick - began)
    return max(delays) <= 11
