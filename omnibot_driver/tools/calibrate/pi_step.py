# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``calibrate step`` for a board that records encoder ticks and accepts gains.

1. Record steps with the current gains.
2. Measure the levels of each encoder's signal at a constant duty.
3. Start the motors at full duty, and fit each plant (motor with wheel) to the recorded ticks.
4. In several rounds: compute gains, record steps, fit the dead time.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import numpy as np

from omnibot_driver.tools.calibrate.console import Console
from omnibot_driver.tools.calibrate.pi_loop import Loop
from omnibot_driver.tools.calibrate.pi_result import Measured, WheelTuned, result_of
from omnibot_driver.tools.calibrate.pi_tuning import (
    LEAST_DEAD_S,
    Goals,
    Steps,
    Tuned,
    dead_time_s,
    tune,
)
from omnibot_driver.tools.calibrate.result import Result
from omnibot_driver.tools.calibrate.tick_fit import Column, Plant, PlantFit, fit
from omnibot_driver.tools.calibrate.tick_records import SIDES, Levels, levels, read, response
from omnibot_driver.tools.needs import ToolError

FREE_PERCENT: Final = 50.0
FULL_PERCENT: Final = 100.0
FIRST_RPM: Final = 30.0
"""Set-point, in RPM, of the steps that are recorded before the plants are known."""
ROUNDS: Final = 3
WRITTEN_WITHIN_S: Final = 4.0
"""Longest time until settings have reached the board, in s. The driver sends each setting several
times, because the board does not acknowledge settings."""

QUIET_S: Final = 0.5
"""Period, in s, with which the board sends its tick counts during a record. It is long, because the
board can miss encoder ticks while it sends."""
RATE_SHOWN: Final = "Odometry rate (Hz)"
"""Name in /diagnostics of the rate at which the board sends its ticks.

The value has the form "measured of expected". If ``ticks_period`` is not set, the driver derives
the expected rate from measurements.
"""
RECORDING: Final = ("drive_mode", "record_samples", "ticks_period")
"""Parameters whose values the tool restores after it has recorded the wheels."""
UNRESTORED: Final = (
    "driver and board still use values of this measurement: {}; restart both to remove them"
)

Records = dict[str, list[Column]]
"""For each side (left or right) a list with one entry per record: the times between ticks, in s."""


def run(robot: Any, console: Console, arguments: argparse.Namespace) -> Result:
    """Record the wheels, fit their plants, tune their gains, and measure the effect.

    Raises ToolError if a record or a fit fails, after an attempt to restore the parameters.
    """
    goals = Goals(
        overshoot=arguments.overshoot / 100,
        band=arguments.band / 100,
        destination=arguments.destination / 100,
        settled_s=arguments.settling,
        phase_margin_deg=None if arguments.gain_optimum else arguments.phase_margin,
    )
    _require_full_duty(robot.parameters)
    total = 1 + arguments.records + (1 + ROUNDS) * arguments.responses
    console.confirm(
        f"In each of {total} measurements, both wheels will turn for some seconds, at up to full"
        " duty. Is the robot on a box, with both wheels off the ground and nothing near them?"
    )
    names = [*RECORDING, *_names("kp", "tn", "td")]
    names += _names("short_correction", "long_correction")
    before = {name: robot.parameters[name] for name in names}
    with console.progress("records") as show:
        bench = _Bench(robot, lambda count: show(count / total), arguments.responses)
        try:
            wheels = _found(bench, arguments, goals)
        except BaseException as error:
            with suppress(ToolError):  # the first error matters more
                _restore(bench, before, names)
            left = [name for name in names if robot.parameters[name] != before[name]]
            if left and isinstance(error, ToolError):
                raise type(error)(f"{error}; {UNRESTORED.format(', '.join(left))}") from error
            raise
        worse = [wheel.name for wheel in wheels if wheel.worse]
        gains = [name for side in worse for name in _names("kp", "tn", "td", sides=(side,))]
        _restore(bench, before, [*RECORDING, *gains])
    found = _corrections({wheel.name: wheel.levels for wheel in wheels})
    found |= _gains({wheel.name: wheel.tuned for wheel in wheels if wheel.name not in worse})
    return result_of(wheels, goals, found)


def _require_full_duty(parameters: Mapping[str, Any]) -> None:
    """Raise ToolError if a limit of the driver would reduce the commanded full duty."""
    wheel_radps = FULL_PERCENT / (parameters["duty_scale"] * parameters["wheel_radius"])
    needed = {"max_duty": FULL_PERCENT, "max_wheel_speed": wheel_radps}
    for name, least in needed.items():
        if parameters[name] < least:
            raise ToolError(
                f"the measurement needs full duty, but {name} ({parameters[name]:g}) reduces it:"
                f" set {name} to {least:.4g} or more for the measurement"
            )


class _Bench:
    """Sets parameters, and records the wheels of the robot, which is on a box.

    ``show``: called after each record, with the number of records made so far.
    """

    def __init__(self, robot: Any, show: Callable[[int], object], responses: int) -> None:
        self.robot, self._show, self._responses, self._done = robot, show, responses, 0
        self.ticks = int(robot.parameters["ticks_per_revolution"])

    def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the driver, and wait until the board has received the values."""
        self.robot.set_parameters(values)
        self.robot.rest(WRITTEN_WITHIN_S)

    def record(self, topic: str, command: Sequence[float], count: int = 1) -> Records:
        """Record ``count`` starts from standstill.

        Return, for each start, the times between the encoder ticks.
        """
        found: Records = {side: [] for side in SIDES}
        for _ in range(count):
            for side, column in read(self.robot.record("record_rpm", topic, command)).items():
                found[side].append(column)
            self._done += 1
            self._show(self._done)
        return found

    def steps(self, rpm: Sequence[float]) -> Records:
        """Record several steps of the set-point from rest to the wheel speeds ``rpm``.

        Return, for each step, the times between the encoder ticks.
        """
        rates = [one * 2 * np.pi / 60 for one in rpm]
        return self.record("wheel_cmd", rates, self._responses)


def _found(bench: _Bench, arguments: argparse.Namespace, goals: Goals) -> list[WheelTuned]:
    ticks = bench.ticks
    loop = Loop(
        1.0 / arguments.control_frequency,
        ticks,
        LEAST_DEAD_S,
        sends_each_s=_sends_each_s(bench.robot),
    )
    # Without ``ticks_period``, the tool could not restore the board's own period.
    quiet = {"ticks_period": QUIET_S} if bench.robot.parameters["ticks_period"] else {}
    bench.set({"drive_mode": "rpm", "record_samples": arguments.samples, **quiet})
    was = bench.steps([FIRST_RPM] * 2)
    corrections = _encoders(bench)
    starts = bench.record("duty_cmd", [FULL_PERCENT] * 2, arguments.records)
    fits = {side: fit(starts[side], ticks) for side in SIDES}
    plants = {side: _plant(fits[side], corrections[side]) for side in SIDES}
    loops = {side: _with_set_point(loop, bench.robot.parameters, side) for side in SIDES}
    tuned: dict[str, Tuned] = {}
    shown: Records = {}
    made: dict[str, list[Steps]] = {side: [] for side in SIDES}
    for _ in range(ROUNDS):
        tuned = {side: tune(plants[side], loops[side], goals) for side in SIDES}
        bench.set({"drive_mode": "rpm", **_gains(tuned)})
        shown = bench.steps([tuned[side].target_rpm for side in SIDES])
        for side in SIDES:
            made[side].append((tuned[side].gains, tuned[side].target_rpm, shown[side]))
        dead_s = dead_time_s([(plants[side], loops[side], made[side]) for side in SIDES])
        loops = {side: replace(loops[side], dead_s=dead_s) for side in SIDES}
    return [
        WheelTuned(
            side,
            corrections[side],
            fits[side],
            plants[side],
            loops[side],
            tuned[side],
            Measured([response(one, ticks) for one in was[side]]),
            Measured([response(one, ticks) for one in shown[side]]),
        )
        for side in SIDES
    ]


def _sends_each_s(robot: Any) -> float:
    """Return the period with which the board sends its tick counts, in s."""
    if period_s := robot.parameters["ticks_period"]:
        return float(period_s)
    with suppress(ValueError, ZeroDivisionError):
        return 1.0 / float(robot.diagnosed(RATE_SHOWN).rpartition(" of ")[2])
    raise ToolError(
        "the driver does not report how often the board sends its tick counts; set `ticks_period`"
    )


def _with_set_point(loop: Loop, parameters: Mapping[str, Any], side: str) -> Loop:
    """Return ``loop`` with the user's settings of feed-forward and low-pass filter."""
    forward, low_pass = parameters.get(f"{side}_feed_forward"), parameters.get("low_pass")
    return replace(
        loop,
        feed_forward=0.0 if forward is None else float(forward),
        low_pass=1.0 if low_pass is None else float(low_pass),
    )


def _encoders(bench: _Bench) -> dict[str, Levels]:
    """Measure and set the corrections of the encoders, by wheel.

    The corrections are factors that make the durations of the two levels of an encoder's signal
    equal.
    """
    ones = dict.fromkeys(_names("short_correction", "long_correction"), 1.0)
    bench.set({"drive_mode": "duty", **ones})
    free = bench.record("duty_cmd", [FREE_PERCENT] * 2)
    found = {side: levels(free[side][0][len(free[side][0]) // 4 :], bench.ticks) for side in SIDES}
    bench.set(_corrections(found))
    return found


def _plant(found: PlantFit, free: Levels) -> Plant:
    """Return the plant of a wheel. Its gain and dead zone come from the speeds at two duties.

    ``found``: the fit at full duty. ``free``: the levels and the speed measured at half duty.
    """
    slope = (found.final_rpm - free.rpm) / (FULL_PERCENT - FREE_PERCENT)
    if slope <= 0.0:
        raise ToolError(
            f"a wheel turns at {free.rpm:.0f} RPM with half duty, but only at"
            f" {found.final_rpm:.0f} RPM with full duty; check that nothing blocks the wheel, and"
            " charge the battery"
        )
    dead_zone = FULL_PERCENT - found.final_rpm / slope
    return Plant(slope, found.slow_s, found.fast_s, float(np.clip(dead_zone, 0.0, 50.0)))


def _names(*parts: str, sides: Sequence[str] = SIDES) -> list[str]:
    return [f"{side}_{part}" for side in sides for part in parts]


def _corrections(found: Mapping[str, Levels]) -> dict[str, float]:
    return {
        f"{side}_{level}_correction": round(float(value), 5)
        for side, one in found.items()
        for level, value in (("short", one.short), ("long", one.long))
    }


def _gains(tuned: Mapping[str, Tuned]) -> dict[str, float]:
    return {
        f"{side}_{name}": round(float(value), 4)
        for side, one in tuned.items()
        for name, value in (("kp", one.gains.kp), ("tn", one.gains.tn_s), ("td", one.gains.td_s))
    }


def _restore(bench: _Bench, before: Mapping[str, Any], names: Sequence[str]) -> None:
    """Restore the parameters ``names`` to their values in ``before``.

    If a value in ``before`` is None, the parameter keeps its new value until a restart.
    """
    known = {name: before[name] for name in names if before[name] is not None}
    bench.robot.restore_parameters(known)
