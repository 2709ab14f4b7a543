# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Allan deviation of a sensor at rest, and what it says of the noise.

Overlapping estimator: NIST Special Publication 1065; noise terms and the deviation of an estimate:
IEEE Std 952-1997, annex C. Pure.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from omnibot_driver.tools.calibrate.log import Column

FEWEST_CLUSTERS: Final = 9
"""Averages are taken over a ninth of the rest at the most; longer ones say little."""
FLICKER: Final = 2 * np.log(2) / np.pi
WALK_FROM_S: Final = 60.0
"""A shorter rest says nothing of how a bias wanders."""


@dataclass(frozen=True, slots=True)
class Allan:
    """``tau_s``: (n,) averaging times; ``deviation``, ``sigma``: (n,), as the readings."""

    tau_s: Column
    deviation: Column
    sigma: Column


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of readings with unit U: ``density`` in U/√Hz (random walk of the integral), with its
    ``sigma``; ``instability`` in U, the flicker floor; ``walk`` in U/√s, of the bias itself.
    """

    density: float
    sigma: float
    instability: float
    walk: float

    def deviation(self, tau_s: Column) -> Column:
        """The Allan deviation that these make."""
        variance = self.density**2 / tau_s + FLICKER * self.instability**2
        return np.asarray(np.sqrt(variance + self.walk**2 * tau_s / 3))


def allan(readings: Column, period_s: float) -> Allan:
    """Allan deviation of (n,) evenly spaced readings, at times a quarter octave apart."""
    whole = np.concatenate(([0.0], np.cumsum(readings - readings.mean()) * period_s))
    longest = len(readings) // FEWEST_CLUSTERS
    octaves = np.arange(0.0, np.log2(max(1, longest)) + 1e-9, 0.25)
    sizes = np.unique(np.round(2.0**octaves).astype(int))
    tau_s = sizes * period_s
    variance = [
        np.mean((whole[2 * m :] - 2 * whole[m:-m] + whole[: -2 * m]) ** 2)
        / (2 * (m * period_s) ** 2)
        for m in sizes
    ]
    deviation = np.sqrt(variance)
    sigma = deviation / np.sqrt(2 * (len(readings) / sizes - 1))
    return Allan(tau_s, deviation, sigma)


def noise(curve: Allan) -> Noise:
    """The terms that fit the curve best; in a rest of seconds all of it is white noise."""
    tau_s, variance = curve.tau_s, curve.deviation**2
    terms = [1 / tau_s]
    if tau_s[-1] * FEWEST_CLUSTERS >= WALK_FROM_S:
        terms += [np.full_like(tau_s, FLICKER), tau_s / 3]
    weight = 1 / np.maximum(2 * curve.deviation * curve.sigma, np.finfo(float).tiny)
    parts, _rest = nnls(np.stack(terms, axis=1) * weight[:, None], variance * weight)
    density, instability, walk = np.sqrt([*parts, 0.0, 0.0][:3])
    first = curve.sigma[0] / curve.deviation[0]
    return Noise(float(density), float(density * first), float(instability), float(walk))
