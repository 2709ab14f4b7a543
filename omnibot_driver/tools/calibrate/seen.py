# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The user's answers about the directions in which the wheels turn.

A pattern has a number for each of the wheels A, B and C, seen from outside: 1 counter-clockwise
(positive in the manual), -1 clockwise, 0 still.
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.twist import BodyTwist

Pattern = tuple[int, int, int]

WHEELS: Final = "ABC"
AXES: Final = ("x", "y", "yaw")
WORDS: Final = {1: "counter-clockwise", -1: "clockwise", 0: "still"}
STILL: Final[Pattern] = (0, 0, 0)


class Contradiction(Exception):
    """Raised if an answer or a measurement cannot be right. The message gives the reason."""


def understand(answer: str) -> Pattern | None:
    """Return the three directions in an answer such as ``+0-``, or None if it is not valid.

    Spaces and commas are ignored.
    """
    signs = answer.replace(" ", "").replace(",", "")
    values = [{"+": 1, "-": -1, "0": 0}.get(sign) for sign in signs]
    if len(values) != 3:
        return None
    a, b, c = values
    return None if a is None or b is None or c is None else (a, b, c)


def in_words(pattern: Sequence[int]) -> str:
    """Return a text for the user that describes the directions of wheels A, B and C."""
    return ", ".join(f"{wheel} {WORDS[sign]}" for wheel, sign in zip(WHEELS, pattern, strict=True))


def wanted(axis: int) -> Pattern:
    """Return the directions of wheels A, B and C in a motion along +x, +y or +yaw.

    Source: the manual's equations. ``axis``: 0 for x, 1 for y, 2 for yaw.
    """
    x, y, yaw = (float(axis == n) for n in range(3))
    rates = OmniKinematics(1.0, 1.0).wheel_rates(BodyTwist(x, y, yaw))
    a, b, c = ((rate > 1e-6) - (rate < -1e-6) for rate in rates)
    return a, b, c


def wheel_sign(wheel: int, seen: Pattern) -> int:
    """Return 1 if the wheel turned in the manual's direction, -1 if in reverse.

    Raises Contradiction if the wheel did not turn, or if another wheel turned.
    """
    name = WHEELS[wheel]
    turned = [n for n in range(3) if seen[n]]
    if not turned:
        raise Contradiction(
            f"wheel {name} was commanded, but you saw no wheel turn: look again, and check that"
            " the motors have power"
        )
    if len(turned) > 1:
        raise Contradiction(
            f"wheel {name} alone was commanded, but you saw {in_words(seen)}: the command turns"
            " only one wheel, so look again"
        )
    if turned != [wheel]:
        raise Contradiction(
            f"wheel {name} was commanded, but you saw wheel {WHEELS[turned[0]]} turn. According"
            " to the manual, A is front right, B front left, C at the back. Perhaps you take the"
            " wrong side of the robot for its front. If not, the wheels are in the wrong order,"
            " which no parameter corrects"
        )
    return seen[wheel]


def axis_sign(axis: int, seen: Pattern) -> int:
    """Return 1 if the wheels show a motion along +axis, -1 if along -axis.

    ``axis``: 0 for x, 1 for y, 2 for yaw. Raises Contradiction if the wheels show neither.
    """
    expected = wanted(axis)
    if seen == expected:
        return 1
    if seen == tuple(-sign for sign in expected):
        return -1
    raise Contradiction(
        f"for +{AXES[axis]} the wheels should turn {in_words(expected)}, or all of them in"
        f" reverse; you saw {in_words(seen)}, which is neither"
    )


def mirrored(signs: Sequence[int]) -> bool:
    """Return whether a robot with these signs of its axes would be a mirror image of the real one.

    The result is False if the user has only mistaken another side of the robot for its front.
    """
    x, y, yaw = signs
    return x * y != yaw
