# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Calculate how exactly any fit could find a wheel's time constants, by the Cramér-Rao bound.

Run this by hand:

    PYTHONPATH=. python test/tools/lois_ecu/bound_of_step.py

The robots are random, as in ``judge_step.py``. A *mark* is a place on the encoder's disc at which
the board counts a tick. The load varies between records, which changes the final speed of the wheel
by 0.5 %. The kinds of noise are:

- "each time": every time between ticks has an independent error of 10 %.
- "other marks": the marks are displaced by 10 %, differently in each turn.
- "same marks": the positions of the marks are known; times are rounded to 0.1 ms.
"""

from random import Random
from statistics import median

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.calibrate.tick_search import turned

TICKS, RECORDS, SAMPLES = 60, 24, 120
NOISE = 0.1
COUNT_S = 1e-4
LOAD = 0.005
Column = NDArray[np.float64]


def times_s(values: Column) -> Column:
    """Return the times, in s, at which a starting wheel passes the marks of its encoder.

    ``values``: final rate (marks/s), slow and fast time constant (s), positions of the marks.
    """
    rate, slow_s, fast_s = values[:3]
    grid_s = np.linspace(0.0, 1.0, 20_000) ** 2 * (SAMPLES + 3) / rate * 1.5
    return np.interp(values[3:], rate * turned(grid_s, slow_s, fast_s), grid_s)


def bound(rate: float, slow_s: float, fast_s: float, kind: str) -> float:
    """Return the lower bound of the relative standard deviation of the fast time constant.

    ``kind`` is the kind of noise, as in the module's list.
    """
    information = np.zeros((3, 3))
    for record in range(RECORDS):
        places = (record + 0.5) / RECORDS + np.arange(SAMPLES + 1)
        values = np.array([rate, slow_s, fast_s, *places])
        slopes = np.array([_slope(values, place) for place in range(3)]).T
        begin = _slope(values, slice(3, None))  # the record begins at an unknown place
        ways_s = np.diff(times_s(values))
        jacobian = np.diff(np.column_stack((slopes, begin, rate * slopes[:, 0])), axis=0)
        jacobian /= ways_s[:, None]
        part = jacobian.T @ np.linalg.solve(_covariance(kind, ways_s), jacobian)
        part[4, 4] += 1 / LOAD**2
        rest = part[:3, 3:] @ np.linalg.solve(part[3:, 3:], part[3:, :3])
        information += part[:3, :3] - rest
    return float(np.sqrt(np.linalg.inv(information)[2, 2]) / fast_s)


def _slope(values: Column, place: int | slice) -> Column:
    step = np.zeros(len(values))
    step[place] = 1e-4 * (values[place] if isinstance(place, int) else 1.0)
    size = step[place] if isinstance(place, int) else 1e-4
    return np.asarray((times_s(values + step) - times_s(values - step)) / (2 * size))


def _covariance(kind: str, ways_s: Column) -> Column:
    """Return the covariance of the relative errors of the times between the encoder's marks.

    ``kind``: the kind of noise. ``ways_s``: the times between the marks, in s.
    """
    count = len(ways_s)
    if kind == "each time":
        return NOISE**2 * np.eye(count)
    neighbours = np.eye(count) - 0.4999 * (np.eye(count, k=1) + np.eye(count, k=-1))
    if kind == "other marks":
        return NOISE**2 * neighbours
    return np.asarray(2 * (COUNT_S / ways_s.mean()) ** 2 / 12 * neighbours)


def main(robots: int = 20) -> None:
    """Print how exactly a fit can at best find the fast time constant, for each kind of noise.

    The printed values are relative standard deviations: the median and the greatest of ``robots``
    random robots.
    """
    for kind in ("each time", "other marks", "same marks"):
        found = []
        for seed in range(robots):
            random = Random(f"plant {seed}")
            slow_s = random.uniform(0.15, 0.5)
            fast_s = slow_s * random.uniform(0.25, 0.6)
            rate = random.uniform(0.55, 0.8) * 94.0 * TICKS / 60
            found.append(bound(rate, slow_s, fast_s, kind))
        print(f"{kind}: fast time constant at best {median(found):.1%} (greatest {max(found):.1%})")


if __name__ == "__main__":
    main()
