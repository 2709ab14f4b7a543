# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Draws the modes of an OmniBot as an SVG picture, from the table of modes in the code."""

import math
import textwrap
from html import escape
from typing import Final

from omnibot_driver.core.board import Mode
from omnibot_driver.core.omnibot.modes import TRANSITIONS

WIDTH, HEIGHT = 980, 500
BOX_WIDTH, BOX_HEIGHT = 176, 76
BEND: Final = 30.0
PLACES: Final = {
    Mode.UNKNOWN: (160.0, 90.0),
    Mode.NOMINAL: (820.0, 90.0),
    Mode.PAUSED: (160.0, 410.0),
    Mode.IMU_ONLY: (820.0, 410.0),
}
COLOURS: Final = {
    Mode.UNKNOWN: "#6b6b6b",
    Mode.NOMINAL: "#1b7f3b",
    Mode.PAUSED: "#b35c00",
    Mode.IMU_ONLY: "#1f5fbf",
}
Point = tuple[float, float]


def svg() -> str:
    """Return the picture. Arrows show events that change the mode; boxes show those that do not."""
    pairs = [(before, after) for before in Mode for after in Mode if before is not after]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
            ' font-family="sans-serif" text-anchor="middle">',
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
            *(line for pair in pairs for line in _arrow(*pair)),
            *(line for pair in pairs for line in _label(*pair)),
            *(line for mode in Mode for line in _box(mode)),
            "</svg>\n",
        ]
    )


def _happenings(before: Mode, after: Mode) -> list[str]:
    return [happening.value for happening, row in TRANSITIONS.items() if row.get(before) is after]


def _curve(before: Mode, after: Mode) -> tuple[Point, Point, Point]:
    """Return start, control point and end of an arrow between two boxes; it bends to the left."""
    (x0, y0), (x1, y1) = PLACES[before], PLACES[after]
    length = math.hypot(x1 - x0, y1 - y0)
    left = ((y1 - y0) / length, -(x1 - x0) / length)
    control = ((x0 + x1) / 2 + 2 * BEND * left[0], (y0 + y1) / 2 + 2 * BEND * left[1])
    return _border((x0, y0), control), control, _border((x1, y1), control)


def _border(centre: Point, towards: Point) -> Point:
    """Return the point where the line from ``centre`` to ``towards`` leaves the box."""
    dx, dy = towards[0] - centre[0], towards[1] - centre[1]
    part = min(
        (BOX_WIDTH / 2 + 4) / abs(dx) if dx else math.inf,
        (BOX_HEIGHT / 2 + 4) / abs(dy) if dy else math.inf,
    )
    return centre[0] + part * dx, centre[1] + part * dy


def _at(curve: tuple[Point, Point, Point], part: float) -> Point:
    a, b, c = (1 - part) ** 2, 2 * part * (1 - part), part**2
    (x0, y0), (x1, y1), (x2, y2) = curve
    return a * x0 + b * x1 + c * x2, a * y0 + b * y1 + c * y2


def _arrow(before: Mode, after: Mode) -> list[str]:
    if not _happenings(before, after):
        return []
    (x0, y0), (x1, y1), (x2, y2) = _curve(before, after)
    length = math.hypot(x2 - x1, y2 - y1)
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    back = (x2 - 11 * ux, y2 - 11 * uy)
    head = [(x2, y2), (back[0] - 5 * uy, back[1] + 5 * ux), (back[0] + 5 * uy, back[1] - 5 * ux)]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in head)
    colour = COLOURS[after]
    return [
        f'<path d="M {x0:.1f} {y0:.1f} Q {x1:.1f} {y1:.1f} {back[0]:.1f} {back[1]:.1f}"'
        f' fill="none" stroke="{colour}" stroke-width="1.6"/>',
        f'<polygon points="{points}" fill="{colour}"/>',
    ]


def _label(before: Mode, after: Mode) -> list[str]:
    """Return the label of an arrow.

    The labels of sloping arrows are near the start, because they would overlap in the middle.
    """
    lying = PLACES[before][1] == PLACES[after][1]
    x, y = _at(_curve(before, after), 0.5 if lying else 0.3)
    texts = [line for text in _happenings(before, after) for line in textwrap.wrap(text, 22)]
    return [
        _text(x, y + 15 * (number - (len(texts) - 1) / 2), text, 12, COLOURS[after])
        for number, text in enumerate(texts)
    ]


def _box(mode: Mode) -> list[str]:
    x, y = PLACES[mode]
    stays = [text for text in _happenings(mode, mode) if text.startswith("sent")]
    refused = [happening.value for happening, row in TRANSITIONS.items() if mode not in row]
    notes = [f"{' or '.join(texts)}: {what}" for texts, what in
             ((stays, "no change"), (refused, "refused")) if texts]  # fmt: skip
    left, top = x - BOX_WIDTH / 2, y - BOX_HEIGHT / 2
    return [
        f'<rect x="{left:g}" y="{top:g}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="10"'
        f' fill="white" stroke="{COLOURS[mode]}" stroke-width="2"/>',
        _text(x, y - 10, mode.value, 18, "black"),
        *(_text(x, y + 10 + 15 * row, note, 11, "#444444") for row, note in enumerate(notes)),
    ]


def _text(x: float, y: float, text: str, size: int, colour: str) -> str:
    return (
        f'<text x="{x:.1f}" y="{y + size / 3:.1f}" font-size="{size}" fill="{colour}"'
        f' stroke="white" stroke-width="4" paint-order="stroke">{escape(text)}</text>'
    )
