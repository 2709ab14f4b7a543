# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is said to make the robot move and stop, to a board that loses characters and whole lines.

The argument. A line is accepted if it is 14 characters from a ``:`` (12 without checksum) up to a
line feed, and its checksum is right. The public firmware counts characters from the last ``:`` and
begins anew after the fourteenth. So a line that lost characters is too short. For two lines to
become one, fourteen characters in a row must be lost, the end of one and the beginning of the next
among them (twelve without checksum). No loss of up to two characters makes another line. The board
is deaf for 13 ms while it sends a group, and set-points are 18 ms apart at least, so one deaf time
does not take the end of one and the beginning of the next.

Which zero. By its firmware both take the power away with the controller's next step. Duty 0/0
leaves the hidden RPM target, so ticks go on counting while a robot that drove forward rolls out:
its standstill is proved. RPM 0/0 ends the counting, and forgets the measured speed. It must be said
before the wheels are to turn again: a wheel that stands keeps its last speed in the controller's
eyes, and a slower set-point in the same direction would never start it. So Stop is duty 0/0, the
emergency stop is RPM 0/0 (under the latch both alternate), and the first set-points after a Stop
are preceded by RPM 0/0.
"""

from typing import Final

from omnibot_driver.core.lois_ecu.codec import decode_command, encode_command
from omnibot_driver.core.lois_ecu.lines import LENGTH, LENGTH_WITHOUT_SUM
from omnibot_driver.core.lois_ecu.messages import (
    Command,
    SetDuty,
    SetRpm,
)

STOP: Final = SetDuty(0, 0)
EMERGENCY_STOP: Final = SetRpm(0, 0)
MOST_RPM: Final = 50
"""The firmware drives no faster."""
MOST_PERCENT: Final = 100
CLEARED_TIMES: Final = 3
"""The first set-points after a Stop that have RPM 0/0 before them: it may be lost."""


def saturated(pair: tuple[float, float], most: float) -> tuple[tuple[int, int], bool]:
    """Rounded; both slowed alike where one is faster than ``most``, and whether that was so."""
    fastest = max(map(abs, pair))
    scale = most / fastest if fastest > most else 1.0
    left, right = (round(one * scale) for one in pair)
    return (left, right), scale < 1.0


def set_points(data: bytes, *, with_sum: bool) -> list[SetRpm | SetDuty]:
    """The set-points in written bytes, whole lines, in order."""
    length = LENGTH if with_sum else LENGTH_WITHOUT_SUM
    found: list[SetRpm | SetDuty] = []
    for line in data.splitlines(keepends=True):
        if len(line) == length and line[1:3] in (b"01", b"02"):
            command = decode_command(line, with_sum=with_sum)
            if isinstance(command, SetRpm | SetDuty):
                found.append(command)
    return found


def lines(*commands: Command, with_sum: bool) -> bytes:
    """The lines one after the other."""
    return b"".join(encode_command(command, with_sum=with_sum) for command in commands)
