# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Allan deviation of a sensor at rest, and the noise terms that fit it.

Sources: NIST Special Publication 1065 and IEEE Std 952-1997, annex C. This module does not know the
sensor.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from omnibot_driver.tools.calibrate.log import Column

FEWEST_CLUSTERS: Final = 9
"""Minimum number of successive averages of the readings from which an Allan deviation is computed.
The longest averaging time is thus the duration of the recording divided by this number."""
FLICKER: Final = 2 * np.log(2) / np.pi
WALK_FROM_S: Final = 58.0
"""Shortest recording, in s, from which bias instability and random walk are estimated. It is a
little less than a minute, because some readings may be missing."""


@dataclass(frozen=True, slots=True)
class Allan:
    """Allan deviations of a sensor. All arrays have the shape (n,).

    * ``recorded_s``: duration of the recording, in s.
    * ``tau_s``: averaging times, in s.
    * ``deviation``: deviation for each averaging time, in the unit of the readings.
    * ``sigma``: standard deviation of each deviation.
    """

    recorded_s: float
    tau_s: Column
    deviation: Column
    sigma: Column


@dataclass(frozen=True, slots=True)
class Noise:
    """Noise terms of a sensor whose readings have the unit U.

    * ``density``: white noise, in U/√Hz.
    * ``sigma``: standard deviation of ``density``.
    * ``instability``: bias instability (flicker noise), in U.
    * ``walk``: random walk of the bias, in U/√s.
    """

    density: float
    sigma: float
    instability: float
    walk: float

    def deviation(self, tau_s: Column) -> Column:
        """Return the Allan deviation of this noise at the averaging times ``tau_s``, in s.

        The result has the unit of the readings.
        """
        variance = self.density**2 / tau_s + FLICKER * self.instability**2
        return np.asarray(np.sqrt(variance + self.walk**2 * tau_s / 3))


def allan(readings: Column, period_s: float) -> Allan:
    """Return the Allan deviations of ``readings``, (n,), which are ``period_s`` seconds apart.

    The averaging times grow by a quarter of an octave from one to the next.
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
    return Allan(len(readings) * period_s, tau_s, deviation, sigma)


def noise(curve: Allan) -> Noise:
    """Return the noise terms that fit the Allan deviations in ``curve`` best.

    If the recording is shorter than 58 s (``WALK_FROM_S``), only white noise is fitted.
    """
    tau_s, variance = curve.tau_s, curve.deviation**2
    terms = [1 / tau_s]
    if curve.recorded_s >= WALK_FROM_S:
        terms += [np.full_like(tau_s, FLICKER), tau_s / 3]
    weight = 1 / np.maximum(2 * curve.deviation * curve.sigma, np.finfo(float).tiny)
    parts, _rest = nnls(np.stack(terms, axis=1) * weight[:, None], variance * weight)
    density, instability, walk = np.sqrt([*parts, 0.0, 0.0][:3])
    first = curve.sigma[0] / curve.deviation[0]
    return Noise(float(density), float(density * first), float(instability), float(walk))
