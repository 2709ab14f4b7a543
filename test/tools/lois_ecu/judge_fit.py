# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judge how well the tool finds and tunes the unknown motors of random robots.

Run this by hand. This command judges 20 robots:

    PYTHONPATH=.:test:test/core:test/tools/lois_ecu python test/tools/lois_ecu/judge_fit.py 20

An optional second argument is the seed of the first robot. Each wheel takes 10 s. No driver runs.
The steps come from the simulated board with the public firmware.
"""

import sys
from random import Random

import numpy as np
from lois_robot import random_motors
from numpy.typing import NDArray

from omnibot_driver.core.lois_ecu import SetRpm, Setting, WriteSetting, encode_command
from omnibot_driver.simulator.lois_ecu import FIRMWARE, LoisSettings, MotorSettings, SimulatedLois
from omnibot_driver.simulator.lois_ecu.motors import Encoder, Motor
from omnibot_driver.simulator.lois_ecu.tuning import CORRECTIONS, LEFT_GAINS, RIGHT_GAINS
from omnibot_driver.tools.calibrate.pi_loop import Loop, PiGains
from omnibot_driver.tools.calibrate.pi_tuning import LEAST_DEAD_S, Goals, Steps, dead_time_s, tune
from omnibot_driver.tools.calibrate.tick_fit import Plant, fit

Column = NDArray[np.float64]

TICKS, RECORDS, SAMPLES, ROUNDS = 60, 24, 120, 3
STEP_S, LOAD_PERCENT, MARK_NOISE = 0.001, 0.5, 0.1
COUNT_S, TOLD_S = 7251 / 72 * 1e-6, 1e-4
GOALS = Goals(phase_margin_deg=60.0)
FREQUENCY_HZ = 11.0


def starts(motor: MotorSettings, wheel: int, random: Random) -> list[Column]:
    """Return records of starts at full duty. Each start is from a random position of the wheel."""
    short, long = CORRECTIONS[wheel]
    encoder = Encoder(TICKS, long / (short + long), noise=MARK_NOISE, random=random)
    found = []
    for _ in range(RECORDS):
        turning, times_s, step, before = Motor(motor, LOAD_PERCENT, random), [], 0, -3000
        while len(times_s) < SAMPLES:
            step += 1
            for part, is_long, _ in encoder.turn(turning.advance(100.0, STEP_S)):
                count = int((step - 1 + part) * STEP_S / COUNT_S)
                corrected_s = (count - before) * TOLD_S * (long if is_long else short)
                times_s.append(int(corrected_s / TOLD_S) * TOLD_S)
                before = count
        found.append(np.array(times_s))
        for _ in range(random.randrange(20, 200)):
            encoder.turn(0.005)
    return found


def stepped(motor: MotorSettings, gains: PiGains, target_rpm: float) -> Column:
    """Return the wheel's true speed in RPM, every 10 ms after a step to ``target_rpm``."""
    board = SimulatedLois(LoisSettings(quirks=FIRMWARE, running=True, motors=(motor, motor)))
    for setting, value in (
        (Setting.RPM_LOW_PASS, 1.0),
        (Setting.LEFT_KP, gains.kp),
        (Setting.LEFT_TN, gains.tn_s),
        (Setting.LEFT_TD, gains.td_s),
    ):
        for _ in range(4):
            board.receive(encode_command(WriteSetting(setting, float(value))))
            board.step()
    for _ in range(3):
        board.receive(encode_command(SetRpm(round(target_rpm), 0)))
        board.step()
    rpm = []
    for _ in range(400):
        rpm.append(board.motors[0].rpm)
        board.step()
    return np.array(rpm)


def recorded(rpm: Column) -> Column:
    """Return the times between ticks, in s, of a wheel that turns at these speeds.

    The encoder's marks, at which the board counts ticks, are evenly spaced.
    """
    ticks = np.cumsum(rpm) * 0.01 * TICKS / 60
    at_s = np.interp(np.arange(0.4, ticks[-1]), ticks, 0.01 * np.arange(1, len(ticks) + 1))
    return np.diff(at_s, prepend=0.0)[:SAMPLES]


def judge(motor: MotorSettings, wheel: int, random: Random) -> str:
    """Return a row of text: the errors of the time constants, and overshoot and error of a step."""
    found = fit(starts(motor, wheel, random), TICKS)
    half_rpm = motor.rpm_per_percent * (50.0 - motor.dead_zone_percent)
    slope = (found.final_rpm - half_rpm) / 50.0
    zone = float(np.clip(100.0 - found.final_rpm / slope, 0.0, 50.0))
    plant = Plant(slope, found.slow_s, found.fast_s, zone)
    loop, made = Loop(1.0 / FREQUENCY_HZ, TICKS, LEAST_DEAD_S), list[Steps]()
    rpm, target = np.zeros(1), 0.0
    for _ in range(ROUNDS):
        tuned = tune(plant, loop, GOALS)
        target = tuned.target_rpm
        rpm = stepped(motor, tuned.gains, target)
        made.append((tuned.gains, target, [recorded(rpm)]))
        loop = Loop(loop.period_s, TICKS, dead_time_s([(plant, loop, made)]))
    own = (LEFT_GAINS, RIGHT_GAINS)[wheel]
    before = stepped(motor, PiGains(own.kp, own.tn, own.td), target)
    errors = [float(np.abs(one - target).sum()) * 0.01 / target for one in (rpm, before)]
    overshoot = rpm.max() / max(rpm[-100:].mean(), target) - 1.0
    return (
        f"slow {found.slow_s / motor.time_constant_s - 1.0:+.1%},"
        f" fast {found.fast_s / motor.second_time_constant_s - 1.0:+.1%} (order {found.order}),"
        f" overshoot {overshoot:.1%}, error {errors[0]:.2f} s (before {errors[1]:.2f} s)"
    )


def main(robots: int, first: int = 0) -> None:
    """Print a row for each wheel of ``robots`` random robots, whose seeds begin at ``first``."""
    for seed in range(first, first + robots):
        for wheel, motor in enumerate(random_motors(seed)):
            row = judge(motor, wheel, Random(f"judge {seed} {wheel}"))
            print(f"{seed:2} {('left', 'right')[wheel]:5} {row}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
