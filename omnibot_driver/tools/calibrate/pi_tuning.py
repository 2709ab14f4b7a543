# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Find gains of a band-limited PI controller that suit a plant.

This module also finds the plant's dead time, from recorded steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from omnibot_driver.tools.calibrate.pi_loop import (
    STEP_S,
    Array,
    Loop,
    PiGains,
    Traits,
    answer,
    overshoot,
    phase_margin_deg,
    traits,
)
from omnibot_driver.tools.calibrate.tick_fit import Column, Plant
from omnibot_driver.tools.calibrate.tick_records import Response, response
from omnibot_driver.tools.needs import ToolError

SECONDS: Final = 4.0
CANDIDATES: Final = 48
ROUNDS: Final = 2
DEAD_S: Final = np.arange(0.0, 0.101, 0.005)
FIRST_BEGUN: Final = np.arange(0.05, 1.0, 0.1)
BEGUN: Final = np.array([0.0, 0.4, 0.8])
"""Starting positions of a simulated wheel between two encoder ticks, as fractions of a tick. They
decide in which control period a tick arrives."""
SENT: Final = np.arange(0.0, 1.0, 0.125)
"""Times at which the board begins to send tick counts in a simulated step, as fractions of the
sending period. Each of these times is simulated. While the board sends, it notices encoder ticks
late."""
DISTURBED: Final = 0.02
"""Additional overshoot, as a fraction of the speed, that is allowed if the board sends its tick
counts during a step."""
OVER_S: Final = 1.5
LEAST_DEAD_S: Final = 0.02
TDS: Final = (0.25, 0.5, 1.0)
"""Candidates for Td, as fractions of the nominal control period, if a phase margin is required.
With Td = 0, an oscillation between control periods would not decay."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goals:
    """The goals of a tuning, for the response to a step of the set-point.

    * ``overshoot``: largest overshoot, as a fraction of the final speed.
    * ``band``: largest deviation of a settled step, as a fraction of the final speed.
    * ``destination``: set-point of the step, as a fraction of the speed at full duty.
    * ``settled_s``: settling time above which the tool warns, in s.
    * ``phase_margin_deg``: smallest phase margin. If it is None, Td is 0, and ``overshoot`` limits
      the gain.
    """

    overshoot: float = 0.05
    band: float = 0.05
    destination: float = 0.5
    settled_s: float = 2.0
    phase_margin_deg: float | None = None


@dataclass(frozen=True, slots=True)
class Tuned:
    """Gains, and their predicted effect on a step to ``target_rpm``."""

    gains: PiGains
    target_rpm: float
    overshoot: float
    settled_s: float
    error_s: float
    phase_margin_deg: float


def tune(plant: Plant, loop: Loop, goals: Goals) -> Tuned:
    """Return the best gains for this plant. Raises ToolError if no gain meets the goals."""
    target = target_of(plant, goals)
    tds = [0.0] if goals.phase_margin_deg is None else [part * loop.nominal_s for part in TDS]
    low, high = 0.02, 5.0
    best: tuple[float, float] | None = None
    # Tn compensates the plant's slow time constant. It is stretched, because the board computes its
    # coefficients for a longer control period than the real one.
    scale, tn_s = 1.0 / plant.rpm_per_percent, plant.slow_s * loop.stretch
    for _ in range(ROUNDS):
        kps, used = np.meshgrid(scale * np.geomspace(low, high, CANDIDATES), tds, indexing="ij")
        gains = PiGains(kps, tn_s, used)
        found = _foreseen(plant, gains, loop, goals)
        # Gains above the first gain that overshoots too much are not allowed, even if saturation
        # hides their overshoot.
        allowed = np.logical_and.accumulate(found.overshoot <= goals.overshoot, axis=0)
        allowed &= np.isfinite(found.settled_s)
        if goals.phase_margin_deg is not None:
            margin = phase_margin_deg(plant, gains, loop, target)
            allowed &= margin >= goals.phase_margin_deg
        if allowed.any():
            rows = 1 + int(np.flatnonzero(allowed.any(axis=1))[-1])
            slower = PiGains(kps[:rows], tn_s, used[:rows])
            tame = _disturbed(plant, slower, loop, goals) <= goals.overshoot + DISTURBED
            allowed[:rows] &= np.logical_and.accumulate(tame, axis=0)
        if not allowed.any():
            break
        cost = np.where(allowed, found.settled_s + found.error_s, np.inf)
        place = np.unravel_index(int(np.argmin(cost)), cost.shape)
        best = float(kps[place]), float(used[place])
        factor = (high / low) ** (2.0 / (CANDIDATES - 1))
        low, high, tds = best[0] / scale / factor, best[0] / scale * factor, [best[1]]
    if best is None:
        raise ToolError(
            f"no gain meets the goals for a step to {target:.0f} RPM (overshoot up to"
            f" {goals.overshoot:.0%}, band {goals.band:.0%}): allow more overshoot, or choose"
            " another --destination"
        )
    return told(plant, PiGains(best[0], tn_s, best[1]), loop, goals)


def target_of(plant: Plant, goals: Goals) -> float:
    """Return the set-point after the step (``goals.destination``) in whole RPM, at least 5 RPM."""
    return float(max(round(goals.destination * plant.final_rpm(100.0)), 5))


def told(plant: Plant, gains: PiGains, loop: Loop, goals: Goals) -> Tuned:
    """Return ``gains``, and their predicted effect on a step to the set-point (``target_of``)."""
    target = target_of(plant, goals)
    found = _foreseen(plant, gains, loop, goals)
    return Tuned(
        gains,
        target,
        float(found.overshoot),
        float(found.settled_s),
        float(found.error_s),
        float(phase_margin_deg(plant, gains, loop, target)),
    )


def _foreseen(plant: Plant, gains: PiGains, loop: Loop, goals: Goals) -> Traits:
    """Predict a step from several starting positions of the wheel, and return its traits.

    They are the largest overshoot, the longest settling time and the mean ``error_s``.
    """
    target = target_of(plant, goals)
    rpm = answer(plant, _apart(gains), loop, target, SECONDS, begun=BEGUN)
    found = traits(rpm, target, goals.band)
    return Traits(found.overshoot.max(-1), found.settled_s.max(-1), found.error_s.mean(-1))


def _disturbed(plant: Plant, gains: PiGains, loop: Loop, goals: Goals) -> Array:
    """Return the largest overshoot of a step during which the board sends its tick counts."""
    target = target_of(plant, goals)
    begun, sent_s = (one.ravel() for one in np.meshgrid(BEGUN, loop.sends_each_s * SENT))
    rpm = answer(plant, _apart(gains), loop, target, SECONDS, begun=begun, sent_s=sent_s)
    return np.asarray(overshoot(rpm, target).max(-1))


def _apart(gains: PiGains) -> PiGains:
    return PiGains(*(np.asarray(one)[..., None] for one in (gains.kp, gains.tn_s, gains.td_s)))


Steps = tuple[PiGains, float, Sequence[Column]]
"""Gains, a set-point in RPM, and the records of steps with these gains to this set-point."""


def dead_time_s(wheels: Sequence[tuple[Plant, Loop, Sequence[Steps]]]) -> float:
    """Return the dead time, in s, with which the model explains the steps of all wheels best.

    The result is at least 0.02 s, so that the tuned gains do not overshoot.
    """
    costs = sum((_costs(*wheel) for wheel in wheels), np.zeros(len(DEAD_S)))
    return max(float(DEAD_S[int(np.argmin(costs))]), LEAST_DEAD_S)


def _costs(plant: Plant, loop: Loop, made: Sequence[Steps]) -> Array:
    """Return the misfit of the model to the recorded steps, for each candidate of the dead time."""
    costs = np.zeros(len(DEAD_S))
    for gains, target_rpm, records in made:
        shown = [response(record, loop.ticks_per_revolution) for record in records]
        late_s, begun = DEAD_S[:, None], FIRST_BEGUN
        rpm = answer(plant, gains, loop, target_rpm, OVER_S + 1.0, dead_s=late_s, begun=begun)
        ticks = begun + np.cumsum(rpm, axis=0) * STEP_S * loop.ticks_per_revolution / 60
        for place in range(len(DEAD_S)):
            models = [_recorded(one, loop.ticks_per_revolution) for one in ticks[:, place].T]
            costs[place] += sum(min(_unlike(one, model) for model in models) for one in shown)
    return costs


def _recorded(ticks: Column, ticks_per_revolution: int) -> Response:
    """Return the response that a board would record while a wheel turns through these positions.

    ``ticks``: positions in ticks, one for each ms.
    """
    marks = np.arange(1.0, ticks[-1])
    at_s = np.interp(marks, ticks, STEP_S * np.arange(1, len(ticks) + 1))
    return response(np.diff(at_s, prepend=0.0), ticks_per_revolution)


def _unlike(shown: Response, model: Response) -> float:
    """Return the mean square of two responses' relative difference, over their first 1.5 s."""
    times_s = shown.times_s[shown.times_s < OVER_S]
    told_rpm = np.interp(times_s, model.times_s, model.rpm)
    return float(np.mean((shown.rpm[: len(times_s)] / told_rpm - 1.0) ** 2))
