# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judges whether the robot followed its commands, by comparing commanded and measured motion."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Final

import numpy as np

from omnibot_driver.core.reporting.status import RUNNING
from omnibot_driver.tools.report.commanded import Pair, pairs, twists
from omnibot_driver.tools.report.findings import Finding, Level, counted, span
from omnibot_driver.tools.report.log import COMMAND_TIMEOUT_S, Array, Log, Mask, Series, Span

LAGS_S: Final = np.arange(0.0, 0.62, 0.02)
TOLERANCE: Final = 0.1
STEADY_S: Final = 1.5
"""Time in s for which a command must be constant before it is compared with the measured motion.

Until then, the motors may still be changing their speed.
"""
CONSTANT: Final = 0.02
"""Relative change of a command up to which the command is regarded as constant."""
REVERSED: Final = -0.5
"""Ratio of measured to commanded motion below which the robot clearly moves the wrong way.

This limit also applies if no command was constant for long enough to compare the speeds.
"""
TOLD: Final = 0.05
"""Speed of a wheel's rim, in m/s, above which a command or a measurement is regarded as motion.

Friction may prevent slower motions.
"""
STANDS: Final = 0.2
"""Ratio of measured to commanded speed below which the robot is regarded as standing still."""
SUSTAINED_S: Final = 1.0
SLOW_START_S: Final = 3.0
"""Length in s from which a standstill despite a command is reported, for two driving wheels.

A shorter standstill is normal: the front wheel may have to turn first, or the motors may start
slowly.
"""
AFTER_STOP_S: Final = 1.5
"""Time in s within which the robot must come to rest after an e-stop, or after the last command has
timed out."""


@dataclass(frozen=True, slots=True)
class Answer:
    """How the robot responded to commands.

    * ``lag_s``: delay of the motion.
    * ``gains``: for each axis, measured / commanded motion; NaN if unknown.
    * ``error``: for each axis, rms of measured - gain · commanded motion.
    * ``spread``: for each axis, ``error`` / rms of the command; infinite if no command was constant
      for long enough.
    """

    lag_s: float
    gains: Array
    error: Array
    spread: Array

    @property
    def off(self) -> Mask:
        """For each axis, whether the gain differs from 1 by more than ``TOLERANCE``.

        The gain is the measured motion divided by the commanded motion.
        """
        return np.abs(self.gains - 1.0) > TOLERANCE

    @property
    def wrong(self) -> Mask:
        """For each axis, whether the gain differs from 1 by more than slow motors can explain.

        The gain is the measured motion divided by the commanded motion.
        """
        clear = np.abs(self.gains - 1.0) > TOLERANCE + self.spread
        return np.asarray(clear | (self.gains < REVERSED))


def answer(pair: Pair, usable: Mask) -> Answer | None:
    """Return how the robot responded to its commands; None if no motion was commanded.

    ``usable``: for each measurement, whether to use it. If an axis's command was constant for at
    least ``SUSTAINED_S`` (s) in all, the gain of this axis comes from these times only.
    """
    times_s, values = pair.measured.stamp_s[usable], pair.measured.values[usable]
    weights = np.array(pair.weights)
    best_s, least = 0.0, np.inf
    for lag_s in LAGS_S:
        told = pair.commands.held(times_s - lag_s) * weights
        moved = values * weights
        power = (told**2).sum()
        if not power:
            return None
        gain = (told * moved).sum() / power
        error = float(((moved - gain * told) ** 2).sum())
        if error < least:
            best_s, least = float(lag_s), error
    told = pair.commands.held(times_s - best_s)
    enough = np.sqrt(((told * weights) ** 2).mean(axis=0)) > 0.1 * TOLD
    rows = _constant(pair.commands, times_s) & (np.abs(told) * weights > 0.1 * TOLD)
    steady = rows.sum(axis=0) * np.median(np.diff(times_s, append=np.inf)) >= SUSTAINED_S
    rows |= ~steady
    power = np.where(enough, (told**2).sum(axis=0, where=rows), np.nan)
    gains = (told * values).sum(axis=0, where=rows) / power
    rest = values - np.nan_to_num(gains, nan=1.0) * told
    errors = np.sqrt((rest**2).mean(axis=0, where=rows))
    spread = np.where(steady, errors / np.sqrt(power / rows.sum(axis=0)), np.inf)
    return Answer(best_s, gains, errors, spread)


def _constant(commands: Series, at_s: Array) -> Mask:
    """Return, for each time and axis, whether the command had been constant for ``STEADY_S``."""
    now = commands.held(at_s)
    constant = np.ones(now.shape, dtype=bool)
    for ago_s in np.arange(0.05, STEADY_S, 0.05):
        constant &= np.abs(commands.held(at_s - ago_s) - now) <= CONSTANT * np.abs(now)
    return constant


def judge(log: Log) -> Iterator[Finding]:
    """Judge the commands: whether they were valid, had no pauses, and were followed by the robot.

    Also report motion during an e-stop. If the log has commands, also report motion without a
    command.
    """
    yield from _despite_the_estop(log, twists(log))
    if not len(log.cmd_vel) and not len(log.wheel_cmd):
        yield Finding(
            Level.NOTE,
            "Commands",
            "No message of cmd_vel or wheel_cmd, so the report cannot say whether the robot"
            " followed its commands.",
            "",
        )
        return
    for name, series in (("cmd_vel", log.cmd_vel), ("wheel_cmd", log.wheel_cmd)):
        broken = int((~series.finite).sum())
        if broken:
            yield Finding(
                Level.WARN,
                "Commands",
                f"{counted(broken, 'message')} of {name} with NaN, infinity or a wrong length.",
                "The driver rejects such messages; fix the node that publishes them.",
            )
    found = pairs(log)
    for pair in found:
        yield from _ceased(log, pair)
    told, moved, times_s = _speeds(found)
    if not len(times_s):
        return
    free = ~_stopped(log, times_s)
    commanded, stands = free & (told > TOLD), moved < STANDS * told
    stalls = _sustained(times_s, commanded & stands)
    moves_s = times_s[commanded & ~stands]
    yield from _stalled(_without_slow_starts(stalls, moves_s) if log.two_wheels else stalls)
    for pair in found:
        usable = ~_stopped(log, pair.measured.stamp_s)
        usable &= ~log.within(stalls, pair.measured.stamp_s)
        yield from _followed(log, pair, answer(pair, usable))
    yield from _untold(log, times_s, told, moved)


def _speeds(found: list[Pair]) -> tuple[Array, Array, Array]:
    """Return the commanded and the measured speed of a wheel's rim in m/s, and the times in s.

    If several topics command the robot, the fastest command is used.
    """
    if not found:
        return np.empty(0), np.empty(0), np.empty(0)
    times_s, moved = found[0].measured.stamp_s, _rim_speed(found[0])
    told = np.zeros(len(times_s))
    for pair in found:
        command = np.linalg.norm(pair.commands.held(times_s) * np.array(pair.weights), axis=1)
        told = np.maximum(told, command)
    return told, moved, times_s


def _rim_speed(pair: Pair) -> Array:
    """Return the measured speed of a wheel's rim in m/s, at the times of the measurements."""
    return np.asarray(np.linalg.norm(pair.measured.values * np.array(pair.weights), axis=1))


def _stopped(log: Log, at_s: Array) -> Mask:
    """Return, for each time, whether commands were ignored at this time or up to 0.5 s before it.

    The driver ignores commands while the e-stop is latched or the board does not run.
    """
    off = [state for state in log.states if state.what not in RUNNING]
    spans = [
        Span(item.begin_s, item.end_s + COMMAND_TIMEOUT_S, "") for item in (*off, *log.latched)
    ]
    return log.within(spans, at_s)


def _sustained(times_s: Array, rows: Mask) -> list[Span]:
    """Return the spans of at least 1 s (``SUSTAINED_S``) in which ``rows`` is always true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    spans = [Span(times_s[first], times_s[last - 1], "") for first, last in edges.reshape(-1, 2)]
    return [item for item in spans if item.length_s >= SUSTAINED_S]


def _without_slow_starts(stalls: list[Span], moves_s: Array) -> list[Span]:
    """Return the standstills in ``stalls`` that last at least ``SLOW_START_S`` (s).

    Standstills without motion between them count as one. ``moves_s``: times in s at which the robot
    moves as commanded.
    """
    groups = groupby(stalls, key=lambda stall: int(np.searchsorted(moves_s, stall.begin_s)))
    together = [list(group) for _, group in groups]
    return [
        stall
        for group in together
        if sum(each.length_s for each in group) >= SLOW_START_S
        for stall in group
    ]


def _ceased(log: Log, pair: Pair) -> Iterator[Finding]:
    commands = pair.commands
    waits_s = np.diff(commands.arrived_s)
    moving = (commands.values[:-1] != 0.0).any(axis=1)
    moving &= ~_stopped(log, commands.arrived_s[:-1] + COMMAND_TIMEOUT_S)
    ceased = np.flatnonzero(moving & (waits_s > COMMAND_TIMEOUT_S))
    if len(ceased):
        yield Finding(
            Level.NOTE,
            "Commands",
            f"The robot was commanded to move, then {pair.topic} paused for more than"
            f" {COMMAND_TIMEOUT_S:g} s: {counted(len(ceased), 'time')}, first at"
            f" {commands.arrived_s[ceased[0]]:.1f} s. In such a pause the driver stops the robot.",
            "If you did not intend a pause, publish at a steady rate of 10 Hz or more.",
        )


def _stalled(stalls: list[Span]) -> Iterator[Finding]:
    if stalls:
        yield Finding(
            Level.BAD,
            "Commands",
            "The robot stood still although it was commanded to move:"
            f" {counted(len(stalls), 'time')}, {span(sum(item.length_s for item in stalls))} in"
            f" all, first at {stalls[0].begin_s:.1f} s.",
            "Check the motors' power, the board's own e-stop and the board's switch for velocity"
            " control. Check that nothing blocks the wheels.",
        )


def _followed(log: Log, pair: Pair, found: Answer | None) -> Iterator[Finding]:
    if found is None or np.isnan(found.gains).all():
        return
    told = [axis for axis in range(len(pair.axes)) if np.isfinite(found.gains[axis])]
    figures = ", ".join(
        f"{pair.axes[axis]} {found.gains[axis]:.2f} (±{found.error[axis]:.2g})" for axis in told
    )
    figure = (
        f"The robot follows {pair.topic} with a lag of {1e3 * found.lag_s:.0f} ms. Measured divided"
        f" by commanded velocity: {figures}"
    )
    wrong = [axis for axis in told if found.wrong[axis]]
    unclear = [pair.axes[axis] for axis in told if found.off[axis] and not found.wrong[axis]]
    if unclear and not wrong:
        yield Finding(
            Level.NOTE,
            "Commands",
            f"{figure}. The speed was not constant for long enough to judge {', '.join(unclear)}.",
            "To judge this, record a drive with constant commands of 6 s each.",
        )
        return
    if not wrong:
        yield Finding(Level.GOOD, "Commands", f"{figure}.")
        return
    if any(found.gains[axis] < -TOLERANCE for axis in wrong):
        advice = (
            "The robot moves the wrong way: check the wiring of the motors and the encoders."
            if log.two_wheels
            else "The robot moves the wrong way: set axis_signs (docs/commissioning.md)."
        )
    elif log.two_wheels:
        advice = (
            "If the commands are within the limits max_…, check a drive with a tape measure"
            " (calibrate scale). Only this shows whether odom or the speed of the motors is wrong."
        )
    else:
        scales = sorted({pair.scales[axis] for axis in wrong})
        advice = (
            f"If the commands are within the limits max_…, divide {' and '.join(scales)} by these"
            " ratios. Then check a drive with a tape measure."
        )
    yield Finding(Level.WARN, "Commands", f"{figure}.", advice)


def _despite_the_estop(log: Log, pair: Pair) -> Iterator[Finding]:
    if not len(pair.measured):
        return
    times_s, moved = pair.measured.stamp_s, _rim_speed(pair)
    late = [Span(item.begin_s + AFTER_STOP_S, item.end_s, "") for item in log.latched]
    if moving := _sustained(times_s, log.within(late, times_s) & (moved > TOLD)):
        yield Finding(
            Level.BAD,
            "E-stop",
            f"The robot moved while the e-stop was latched, first at {moving[0].begin_s:.1f} s.",
            "If the robot was not pushed, cut its power with the switch in the power line. Do not"
            " drive the robot before you know the cause.",
        )


def _untold(log: Log, times_s: Array, told: Array, moved: Array) -> Iterator[Finding]:
    since = np.flatnonzero(told > 0.0)
    last_s = np.full(len(times_s), -np.inf)
    if len(since):
        newest = np.searchsorted(times_s[since], times_s, "right") - 1
        last_s = np.where(newest >= 0, times_s[since][np.maximum(newest, 0)], -np.inf)
    untold = (times_s - last_s > AFTER_STOP_S) & ~log.within(log.latched, times_s)
    moving = _sustained(times_s, untold & (moved > TOLD))
    if moving:
        yield Finding(
            Level.WARN,
            "Commands",
            f"The robot moved {counted(len(moving), 'time')} without a command, first at"
            f" {moving[0].begin_s:.1f} s.",
            "Someone may have pushed the robot, or a topic that is not in the recording may have"
            " commanded it. If neither is the case, see docs/safety.md.",
        )
