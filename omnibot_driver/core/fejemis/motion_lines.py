# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""``rc`` for each board, in digits of which no two can be lost unseen.

The numbers that can be written so have gaps (`numerals.py`), but neither board needs both: the
front board takes the angle from the ratio of speed and turn rate, the drive board the speed of the
outer wheel from the root of the sum of their squares and the sign of the speed. So each line is one
that says that exactly enough; among these the nearest to what is commanded, with a sum that stands
for no character of a number (`outbound.py`).
"""

import math
from functools import lru_cache
from typing import Final

from omnibot_driver.core.fejemis.numerals import between, nearest
from omnibot_driver.core.fejemis.outbound import robust

STOP: Final = b"rc 2 0 0"
LEAST_MPS: Final = 0.001
"""A slower wheel is commanded to stand."""
SLOWEST_MPS: Final = 2e-4
"""No slower speed has numbers around it."""
LEAST_RAD: Final = 1e-5
SPEED_WITHIN: Final = 0.004
"""Part of a speed by which a line may be off."""
ANGLE_WITHIN_RAD: Final = 0.003
SLOWEST: Final = 30.0
"""A line to the drive board has at least such a part of the outer wheel's speed."""
SCALES: Final = 4.0
"""Numbers for the front board are at most four times those commanded, at least a quarter."""
Candidate = tuple[float, str, str]
"""Cost, speed in m/s, turn rate in degrees a second; without signs."""


@lru_cache(maxsize=512)
def front_line(speed_mps: float, turn_radps: float, wheelbase_m: float) -> bytes:
    """Says atan2(wheelbase · turn, speed); the sizes of both together mean nothing."""
    speed, turn_deg = abs(speed_mps), math.degrees(abs(turn_radps))
    negative = speed_mps < 0.0 or turn_radps < 0.0
    signs = "-" if speed_mps < 0.0 else "", "-" if turn_radps < 0.0 else ""

    def around(size: float) -> list[tuple[float, str]]:
        return between(size / SCALES, size * SCALES, negative=negative)

    angle_rad = math.atan2(wheelbase_m * math.radians(turn_deg), speed)
    if angle_rad < LEAST_RAD:
        near = max(speed, LEAST_MPS)
        return _best(signs, [(_far(one, near), text, "0") for one, text in around(near)])
    if angle_rad > math.pi / 2 - LEAST_RAD or speed < SLOWEST_MPS:
        return _best(signs, [(_far(one, turn_deg), "0", text) for one, text in around(turn_deg)])
    found = []
    for number, text in around(speed):
        turn_number, turn_text = nearest(turn_deg * number / speed, negative=negative)
        told_rad = math.atan2(wheelbase_m * math.radians(turn_number), number)
        off_rad = max(0.0, abs(told_rad - angle_rad) - ANGLE_WITHIN_RAD)
        found.append((off_rad * 1e3 + _far(number, speed), text, turn_text))
    return _best(signs, found)


@lru_cache(maxsize=512)
def drive_line(speed_mps: float, turn_radps: float) -> bytes:
    """Says the root of speed² + turn² with the sign of the speed."""
    rim_mps = math.hypot(speed_mps, turn_radps)
    if rim_mps < LEAST_MPS:
        return STOP
    backward = speed_mps < 0.0
    negative = backward or turn_radps < 0.0
    signs = "-" if backward else "", "-" if turn_radps < 0.0 else ""
    candidates = [(0.0, "0")] if not backward else []
    candidates += between(rim_mps / SLOWEST, 1.01 * rim_mps, negative=negative)
    wanted_rad = math.atan2(abs(turn_radps), abs(speed_mps))
    found = []
    for number, text in candidates:
        rest = math.degrees(math.sqrt(max(0.0, rim_mps * rim_mps - number * number)))
        for turn_number, turn_text in ((0.0, "0"), nearest(rest, negative=negative)):
            turn = math.radians(turn_number)
            off = abs(math.hypot(number, turn) / rim_mps - 1.0)
            aside = abs(math.atan2(turn, number) - wanted_rad)
            found.append((max(0.0, off - SPEED_WITHIN) * 1e3 + aside + off, text, turn_text))
    return _best(signs, found)


def _best(signs: tuple[str, str], found: list[Candidate]) -> bytes:
    """The cheapest line whose sum is robust; there is always one, or else the cheapest."""
    found.sort()
    lines = (_line(signs, speed, turn) for _, speed, turn in found)
    return next(filter(robust, lines), _line(signs, *found[0][1:]))


def _far(number: float, wanted: float) -> float:
    return abs(math.log(number / wanted))


def _line(signs: tuple[str, str], speed: str, turn: str) -> bytes:
    words = (
        sign + text if text != "0" else text
        for sign, text in zip(signs, (speed, turn), strict=True)
    )
    return " ".join(("rc 2", *words)).encode("ascii")
