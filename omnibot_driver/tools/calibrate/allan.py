# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Allan deviation of a sensor at rest, and the noise terms that fit it. Pure.

Overlapping estimator: NIST Special Publication 1065; noise terms and the deviation of an estimate:
IEEE Std 952-1997, annex C.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from omnibot_driver.tools.calibrate.log import Column

FEWEST_CLUSTERS: Final = 9
"""Least number of averages from which a deviation is computed.

The longest averaging time is therefore a ninth of the rest.
"""
FLICKER: Final = 2 * np.log(2) / np.pi
WALK_FROM_S: Final = 60.0
"""Least length of a rest, in s, for which the wandering of a bias is fitted."""


@dataclass(frozen=True, slots=True)
class Allan:
    """An Allan deviation with its standard deviation ``sigma``, in the readings' unit.

    ``tau_s``: the averaging times in s. All have the shape (n,).
    """

    tau_s: Column
    deviation: Column
    sigma: Column


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise of readings with unit U.

    ``density`` in U/√Hz (random walk of the integral), with its ``sigma``; ``instability`` in U,
    the flicker floor; ``walk`` in U/√s, the random walk of the bias.
    """

    density: float
    sigma: float
    instability: float
    walk: float

    def deviation(self, tau_s: Column) -> Column:
        """Return the Allan deviation that this noise has at the averaging times ``tau_s``."""
        variance = self.density**2 / tau_s + FLICKER * self.instability**2
        return np.asarray(np.sqrt(variance + self.walk**2 * tau_s / 3))


def allan(readings: Column, period_s: float) -> Allan:
    """Return the Allan deviation of (n,) evenly spaced readings.

    The averaging times are a quarter octave apart.
    """
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
    """Return the noise terms that fit the curve best; for a short rest only white noise."""
    tau_s, variance = curve.tau_s, curve.deviation**2
    terms = [1 / tau_s]
    if tau_s[-1] * FEWEST_CLUSTERS >= WALK_FROM_S:
        terms += [np.full_like(tau_s, FLICKER), tau_s / 3]
    weight = 1 / np.maximum(2 * curve.deviation * curve.sigma, np.finfo(float).tiny)
    parts, _rest = nnls(np.stack(terms, axis=1) * weight[:, None], variance * weight)
    density, instability, walk = np.sqrt([*parts, 0.0, 0.0][:3])
    first = curve.sigma[0] / curve.deviation[0]
    return Noise(float(density), float(density * first), float(instability), float(walk))
