# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The lines that make the robot move and stop. The board can lose characters and whole lines."""

from typing import Final

from omnibot_driver.core.lois_ecu.codec import decode_command, encode_command
from omnibot_driver.core.lois_ecu.lines import LENGTH, LENGTH_WITHOUT_SUM
from omnibot_driver.core.lois_ecu.messages import (
    Command,
    SetDuty,
    SetRpm,
)

# Duty 0/0 and RPM 0/0 both remove the power with the controller's next step. But duty 0/0 keeps the
# RPM target. So after a drive forward, the board continues to count ticks, which can prove the
# standstill. RPM 0/0 ends the counting and clears the measured speed. While the emergency stop is
# latched, RPM 0/0 and Stop are sent in turn.
#
# Damage almost never changes a line into another valid line. Two lines become one only if fourteen
# characters in a row are lost (twelve without checksum): the end of one line and the beginning of
# the next. The board receives nothing for at most 13 ms, and set-points are at least 18 ms apart.
STOP: Final = SetDuty(0, 0)
EMERGENCY_STOP: Final = SetRpm(0, 0)
MOST_RPM: Final = 50
"""Largest allowed set-point in RPM. The firmware limits larger set-points."""
MOST_PERCENT: Final = 100
# After a Stop, the controller still uses the last measured speed of a wheel at rest. Without RPM
# 0/0, a slower set-point in the same direction would never start the wheel.
CLEARED_TIMES: Final = 3
"""Number of times that RPM 0/0 is sent after a Stop, because lines may be lost.

If the robot drives again earlier, RPM 0/0 precedes each RPM set-point until the number is reached.
"""


def saturated(pair: tuple[float, float], most: float) -> tuple[tuple[int, int], bool]:
    """Return a pair of values, limited to ±``most`` and rounded, and whether it was limited.

    The limit reduces both values by the same factor.
    """
    fastest = max(map(abs, pair))
    scale = most / fastest if fastest > most else 1.0
    left, right = (round(one * scale) for one in pair)
    return (left, right), scale < 1.0


def set_points(data: bytes, *, with_sum: bool) -> list[SetRpm | SetDuty]:
    """Return the set-points in ``data``, in order. Other lines in ``data`` are left out."""
    length = LENGTH if with_sum else LENGTH_WITHOUT_SUM
    found: list[SetRpm | SetDuty] = []
    for line in data.splitlines(keepends=True):
        if len(line) == length and line[1:3] in (b"01", b"02"):
            command = decode_command(line, with_sum=with_sum)
            if isinstance(command, SetRpm | SetDuty):
                found.append(command)
    return found


def lines(*commands: Command, with_sum: bool) -> bytes:
    """Return the lines of the given commands, one after the other."""
    return b"".join(encode_command(command, with_sum=with_sum) for command in commands)
