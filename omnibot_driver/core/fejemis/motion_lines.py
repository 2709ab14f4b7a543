# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Writes motion lines (``rc``) in which damage is detected, or has a limited effect.

Several lines command the same motion. With a checksum, this module chooses a line in which the loss
of any two characters is detected. Without a checksum, some losses give a wrong number, which is
valid until the next line.
"""

import math
from functools import lru_cache
from typing import Final

from omnibot_driver.core.fejemis.numerals import beside, between, nearest
from omnibot_driver.core.fejemis.sums import robust

STOP: Final = b"rc 2 0 0"
LEAST_MPS: Final = 0.001
"""Speed of the outer wheel in m/s below which the robot is commanded to stop."""
SLOWEST_MPS: Final = 2e-4
"""Speed in a curve, in m/s, below which the front board gets the speed 0.

Damage to the line could turn nearly every smaller number into a harmful one.
"""
LEAST_RAD: Final = 1e-5
SPEED_WITHIN: Final = 0.004
"""Tolerated relative error of the outer wheel's speed."""
ANGLE_COST: Final = 1e4
"""Cost of an error of 1 rad in the front wheel's angle. For comparison: a speed that is wrong by a
factor of 2.7 (e) costs 1.
"""
SLOWEST: Final = 30.0
"""Largest ratio of the outer wheel's speed to the linear speed that is sent to the drive board.

For forward motion, the linear speed can also be 0. For backward motion, it cannot, because 0 has no
minus sign.
"""
SCALES: Final = 4.0
"""Largest factor by which a number in the front board's line may differ from the commanded number.
"""
Candidate = tuple[float, str, str]
"""A possible line: its cost, its speed (m/s) and its turn rate (degrees/s).

The last two are texts without signs.
"""


@lru_cache(maxsize=512)
def front_line(speed_mps: float, turn_radps: float, wheelbase_m: float) -> bytes:
    """Return the front board's line, which sets the angle atan2(wheelbase · turn rate, speed).

    Only the ratio of speed and turn rate matters.
    """
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
        off_rad = abs(told_rad - angle_rad)
        found.append((ANGLE_COST * off_rad + _far(number, speed), text, turn_text))
    return _best(signs, found)


@lru_cache(maxsize=512)
def drive_line(speed_mps: float, turn_radps: float) -> bytes:
    """Return the drive board's line for a speed in m/s and a turn rate in rad/s.

    The outer wheel runs at sqrt(``speed_mps``² + ``turn_radps``²) in m/s, with the sign of
    ``speed_mps``. The board ignores the units.
    """
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
        for turn_number, turn_text in ((0.0, "0"), *beside(rest, negative=negative)):
            turn = math.radians(turn_number)
            off = abs(math.hypot(number, turn) / rim_mps - 1.0)
            aside = abs(math.atan2(turn, number) - wanted_rad)
            found.append((max(0.0, off - SPEED_WITHIN) * 1e3 + aside + off, text, turn_text))
    return _best(signs, found)


def plain_front_line(speed_mps: float, turn_radps: float) -> bytes:
    """Return the front board's line for firmware without checksums.

    It has few digits, because short lines are damaged less often.
    """
    return b"rc 2 %s %s" % (_short(speed_mps, 4), _short(math.degrees(turn_radps), 2))


def plain_drive_line(speed_mps: float, turn_radps: float) -> bytes:
    """Return the drive board's line for firmware without checksums.

    It has the outer wheel's speed with its sign, and a turn rate of 0. The board computes the turn
    from the angle of the front wheel.
    """
    # The line has a source (``2``), a speed and a turn rate. The board uses only the root of the
    # sum of squares. If the source or the space after it is lost, the 0 becomes the speed: the line
    # is a stop. If the space before the 0 is lost, the speed is the same: it has a decimal point,
    # so ``1. 0`` becomes ``1.0``, not ``10``.
    rim_mps = math.hypot(speed_mps, turn_radps)
    if rim_mps < LEAST_MPS:
        return STOP
    speed = f"{math.copysign(rim_mps, speed_mps or 1.0):.3f}".rstrip("0")
    return b"rc 2 %s 0" % speed.encode("ascii")


def _best(signs: tuple[str, str], found: list[Candidate]) -> bytes:
    """Return the line nearest to the command among the lines whose checksum reveals damage.

    If there is no such line, return the nearest of all lines. ``signs``: signs of speed and turn
    rate, as text.
    """
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


def _short(number: float, decimals: int) -> bytes:
    text = f"{number:.{decimals}f}".rstrip("0").rstrip(".")
    return (text if text.strip("-") else "0").encode("ascii")
