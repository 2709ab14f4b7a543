# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fit models with uncertainties to recorded steps of one wheel.

Time 0 of a step is its *onset*: the first control tick that could use the command. This module does
not know how data were recorded.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from omnibot_driver.tools.calibrate.log import Column, Commands, Wheels
from omnibot_driver.tools.calibrate.step_models import (
    FIRST_ORDER,
    SECOND_ORDER,
    Model,
    motor_model,
)
from omnibot_driver.tools.calibrate.wheel_loop import TICK_S, Gains, Motor
from omnibot_driver.tools.needs import ToolError

ON_THE_WAY_S: Final = 0.0015
"""Time, in s, from the publication of a command to its last bit on the line: delivery by DDS, and 9
bytes at 115200 baud."""
BEFORE: Final = 3
"""Number of odometry deltas before the onset that belong to the record of a step."""
FEWEST_DELTAS: Final = 10
ROUNDS: Final = 4
SOONER: Final = range(-20, 3)
"""Shifts of an onset that the tool tries, in ticks. A positive shift makes the onset earlier."""
UNLIKE: Final = 3.0
"""A step is rejected if its misfit exceeds the median misfit of all steps by this factor."""


LOOK_S: Final = np.arange(0.0, 2.0, 1e-3)
"""Times, in s, at which a model is evaluated to find rise time and overshoot."""
DRAWS: Final = 100


@dataclass(frozen=True, slots=True)
class Step:
    """One step from one commanded rate to another. Ticks are control ticks.

    * ``before_radps``, ``after_radps``: commanded rates.
    * ``end_ticks``: end of each odometry delta, in ticks after the onset.
    * ``rate_radps``: mean rate in each odometry delta, which lasts four ticks.
    * ``last_radps``: commanded rate before the previous step, which may not have settled.
    * ``last_ticks``: time from the previous onset to this onset.
    """

    before_radps: float
    after_radps: float
    end_ticks: Column
    rate_radps: Column
    last_radps: float
    last_ticks: int

    def sooner(self, ticks: int) -> "Step":
        """Return this step with its onset moved ``ticks`` control ticks earlier."""
        return replace(self, end_ticks=self.end_ticks + ticks, last_ticks=self.last_ticks - ticks)

    def told_by(self, mean: Callable[[Column], Column]) -> Column:
        """Return the mean rate in rad/s that a model predicts for each odometry delta of the step.

        ``mean``: function that returns the model's mean rates after a unit step, for deltas that
        end at the given ticks.
        """
        earlier = self.before_radps - self.last_radps
        height = self.after_radps - self.before_radps
        return np.asarray(
            self.last_radps
            + earlier * mean(self.end_ticks + self.last_ticks)
            + height * mean(self.end_ticks)
        )


@dataclass(frozen=True, slots=True)
class Fit:
    """A model with the parameter values that explain the steps best.

    * ``covariance``: covariance of ``values``, scaled by the residuals.
    * ``rms_radps``: root mean square of the residuals.
    * ``samples``: number of odometry deltas used.
    """

    model: Model
    values: Column
    covariance: Column
    rms_radps: float
    samples: int

    @property
    def sigmas(self) -> Column:
        """Standard deviations of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def aic(self) -> float:
        """Akaike's information criterion: smaller for the better of two fits to the same steps."""
        return 2 * self.samples * math.log(self.rms_radps) + 2 * len(self.values)

    def told(self, step: Step) -> Column:
        """Return the mean rate in rad/s that the fit predicts for each odometry delta of a step."""
        told = step.told_by(lambda ticks: self.model.mean(self.values[1:], ticks * TICK_S))
        return np.asarray(self.values[0] * told)

    def traits(self) -> dict[str, tuple[float, float]]:
        """Return "rise time" in s and "overshoot", each with its standard deviation.

        The rise is from 10 % to 90 % of the step. The overshoot is a fraction of the step.
        """
        random = np.random.default_rng(0)
        draws = random.multivariate_normal(self.values, self.covariance, DRAWS)
        draws = np.clip(draws, self.model.low, self.model.high)
        values = np.array([self._traits(drawn[1:]) for drawn in draws])
        found = self._traits(self.values[1:])
        names = ("rise time", "overshoot")
        return dict(zip(names, zip(found, values.std(axis=0).tolist(), strict=True), strict=True))

    def _traits(self, parameters: Column) -> tuple[float, float]:
        rate = np.gradient(self.model.turned(parameters, LOOK_S), LOOK_S)
        tenth, most = (LOOK_S[np.argmax(rate >= part)] for part in (0.1, 0.9))
        return float(most - tenth), float(max(0.0, rate.max() - 1.0))


def steps_of(commands: Commands, wheels: Wheels, wheel: int, levels: Sequence[float]) -> list[Step]:
    """Return the steps of one wheel between the commanded rates ``levels``, in rad/s.

    Raises ToolError if gaps in the odometry leave no complete step.
    """
    told = commands.values[:, wheel]
    heard = np.isfinite(wheels.rate_radps[:, wheel])
    stamp_s, rates = wheels.stamp_s[heard], wheels.rate_radps[heard, wheel]
    changes = [n for n in range(1, len(told)) if told[n] != told[n - 1]]
    steps = []
    for number, change in enumerate(changes):
        before, after = float(told[change - 1]), float(told[change])
        if before not in levels or after not in levels:
            continue
        seen_s = commands.stamp_s[change] + ON_THE_WAY_S
        until_s = commands.stamp_s[changes[number + 1]] if number + 1 < len(changes) else math.inf
        first = int(np.searchsorted(stamp_s, seen_s)) - BEFORE
        last = int(np.searchsorted(stamp_s, until_s))
        if first < 0 or last - first < FEWEST_DELTAS:
            continue
        reference_s = stamp_s[first]
        onset = math.ceil((seen_s - reference_s) / TICK_S)
        ends = np.rint((stamp_s[first:last] - reference_s) / TICK_S) - onset
        sooner = changes[number - 1] if number else change
        last_radps = float(told[sooner - 1])
        if last_radps not in levels:  # a start from rest, where friction matters
            last_radps = before
        ticks = round((commands.stamp_s[change] - commands.stamp_s[sooner]) / TICK_S)
        steps.append(Step(before, after, ends, rates[first:last], last_radps, ticks))
    if not steps:
        raise ToolError(
            "no step was recorded completely, because odometry was lost; see /diagnostics, and try"
            " again"
        )
    return steps


def fit(model: Model, steps: Sequence[Step]) -> Fit:
    """Fit a model by least squares. Raises ToolError if the steps do not determine the model."""
    rates = np.concatenate([step.rate_radps for step in steps])
    first = min(int(step.end_ticks.min()) for step in steps)
    last = max(int(step.end_ticks.max()) + step.last_ticks for step in steps)
    moments_s = TICK_S * np.arange(first, last + 1, dtype=np.float64)

    def residuals(parameters: Column) -> Column:
        means = model.mean(parameters[1:], moments_s)
        told = [step.told_by(lambda ticks: means[ticks.astype(int) - first]) for step in steps]
        return np.asarray(parameters[0] * np.concatenate(told) - rates)

    found = least_squares(residuals, model.start, bounds=(model.low, model.high), x_scale="jac")
    freedom = len(rates) - len(found.x)
    if not found.success or freedom <= 0:
        raise ToolError("the steps do not determine a model of the wheel: increase --steps")
    squares = float(np.sum(found.fun**2))
    information = found.jac.T @ found.jac
    covariance = np.linalg.pinv(information) * squares / freedom
    return Fit(model, found.x, covariance, math.sqrt(squares / len(rates)), len(rates))


@dataclass(frozen=True, slots=True)
class WheelFound:
    """The results of one wheel.

    * ``steps``: the steps that were used.
    * ``left_out``: number of rejected steps.
    * ``first``, ``second``: fits of models of first and second order.
    * ``motor_fit``: fit of a motor in the manual's control loop.
    """

    name: str
    steps: list[Step]
    left_out: int
    first: Fit
    second: Fit
    motor_fit: Fit

    @property
    def answer(self) -> Fit:
        """The better of the two fits ``first`` and ``second``, by Akaike's information criterion.

        These two fits assume nothing about the control loop.
        """
        return min(self.first, self.second, key=lambda fit: fit.aic)

    @property
    def motor(self) -> Motor:
        """The fitted motor. Its times are in control ticks."""
        _gain, pwm_per_count, time_constant_s, delay_s = self.motor_fit.values
        return Motor(pwm_per_count, time_constant_s / TICK_S, delay_s / TICK_S)


def fit_wheel(name: str, steps: Sequence[Step], now: Gains) -> WheelFound:
    """Fit three models to a wheel's steps: first order, second order, and a motor.

    ``now``: the firmware's gains, with which the motor's control loop is simulated.
    """
    whole = alike(aligned(alike(aligned(steps))))
    first, second, motor = (
        fit(model, whole) for model in (FIRST_ORDER, SECOND_ORDER, motor_model(now))
    )
    return WheelFound(name, whole, len(steps) - len(whole), first, second, motor)


def aligned(steps: Sequence[Step], model: Model = SECOND_ORDER) -> list[Step]:
    """Return the steps with their onsets shifted so that the steps fit the model best.

    If a busy computer delays a command, the true onset is later than the computed one.
    """
    shifts = [0] * len(steps)
    for _ in range(ROUNDS):
        guess = fit(model, [step.sooner(n) for step, n in zip(steps, shifts, strict=True)])
        best = [
            min(SOONER, key=lambda n, step=step: _misfit(guess, step.sooner(n)))  # type: ignore[misc]
            for step in steps
        ]
        # A shift that all steps share is a delay of the wheel.
        middle = sorted(best)[len(best) // 2]
        best = [n - middle for n in best]
        if best == shifts:
            break
        shifts = best
    return [step.sooner(n) for step, n in zip(steps, shifts, strict=True)]


def alike(steps: Sequence[Step], model: Model = SECOND_ORDER) -> list[Step]:
    """Return the steps that fit a common model well.

    Their misfit is at most three times the median misfit.
    """
    guess = fit(model, steps)
    misfits = [_misfit(guess, step) for step in steps]
    most = UNLIKE * sorted(misfits)[len(misfits) // 2]
    return [step for step, misfit in zip(steps, misfits, strict=True) if misfit <= most]


def _misfit(guess: Fit, step: Step) -> float:
    return float(np.sqrt(np.mean((guess.told(step) - step.rate_radps) ** 2)))
