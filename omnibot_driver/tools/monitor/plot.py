# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Draws pictures with characters: a path in Braille, a row of bars.

The module knows characters; it does not know colours or ROS.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose

BRAILLE: Final = 0x2800
DOTS: Final = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""The bit of each dot in a Braille character, which has four rows of two dots."""
BARS: Final = " ▁▂▃▄▅▆▇"
ARROWS: Final = "→↗↑↖←↙↓↘"
SMALLEST_M: Final = 0.5
"""Smallest length in m that the longer side of a picture shows, so that noise does not fill the
picture."""
LARGEST_M: Final = 1e6


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture: rows of equal length, and the distance in m that the length of a row shows."""

    rows: list[str]
    width_m: float


def draw_path(
    points: Iterable[tuple[float, float]], columns: int, rows: int, robot: Pose | None = None
) -> Picture:
    """Draw a path, seen from above and as large as possible.

    The x axis points to the right, the y axis up. An arrow shows the pose ``robot``.
    """
    columns, rows = max(1, columns), max(1, rows)
    seen = [point for point in points if _drawable(*point)]
    here = robot if robot and robot.finite and _drawable(robot.x_m, robot.y_m) else None
    if here:
        seen.append((here.x_m, here.y_m))
    xs, ys = [x for x, _ in seen] or [0.0], [y for _, y in seen] or [0.0]
    across, down = 2 * columns - 1, 4 * rows - 1
    m_per_dot = max(
        (max(xs) - min(xs)) / across,
        (max(ys) - min(ys)) / down,
        SMALLEST_M / max(across, down),
    )
    left_m = (min(xs) + max(xs) - across * m_per_dot) / 2
    top_m = (min(ys) + max(ys) + down * m_per_dot) / 2

    def dot(x_m: float, y_m: float) -> tuple[int, int]:
        right, below = round((x_m - left_m) / m_per_dot), round((top_m - y_m) / m_per_dot)
        return min(max(right, 0), across), min(max(below, 0), down)

    cells = [[0] * columns for _ in range(rows)]
    dots = [dot(*point) for point in seen]
    for (right, below), (next_right, next_below) in pairwise([*dots, *dots[-1:]]):
        steps = max(abs(next_right - right), abs(next_below - below), 1)
        for step in range(steps):
            x = right + round((next_right - right) * step / steps)
            y = below + round((next_below - below) * step / steps)
            cells[y // 4][x // 2] |= DOTS[y % 4][x % 2]
    drawn = [[chr(BRAILLE + dots) if dots else " " for dots in row] for row in cells]
    if here:
        right, below = dot(here.x_m, here.y_m)
        eighth = round(math.remainder(here.yaw_rad, math.tau) / (math.tau / 8)) % 8
        drawn[below // 4][right // 2] = ARROWS[eighth]
    return Picture(["".join(row) for row in drawn], 2 * columns * m_per_dot)


def sparkline(values: Sequence[float], columns: int) -> str:
    """Return the newest values as bars of different height, with the newest at the right.

    The largest value has full height.
    """
    shown = values[-columns:] if columns > 0 else []
    peak = max(shown, default=0.0) or 1.0
    bars = "".join(BARS[math.ceil(value / peak * (len(BARS) - 1))] for value in shown)
    return bars.rjust(columns)


def _drawable(x_m: float, y_m: float) -> bool:
    return abs(x_m) < LARGEST_M and abs(y_m) < LARGEST_M
