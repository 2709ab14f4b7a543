# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The file in which the server records the angle of a controlled turn (LAST TURN).

The public server never closes a file that it has sent, and can have only about 1,000 files open. So
the driver downloads only a few files. This module knows the form of the file; it does not know when
the file is downloaded.
"""

import re
from typing import Final

from omnibot_driver.core.mart.words import Request

SAME_DEG: Final = 0.5
"""Largest accepted difference, in degrees, between two angles: the requested angle in the
command of a turn, and the requested angle in a file. If they differ more, the file belongs to
another turn."""
LEAST_RAD, ENOUGH_RAD = 1.0, 12.0
"""Limits, in rad, for the sum of the turns that were read from records.

From LEAST_RAD on, the driver uses the ratio of the motors' speeds that the records show. From
ENOUGH_RAD on, it downloads no more records.
"""
MOST: Final = 30
"""Largest number of records that one run of the driver downloads."""
UNRECORDED: Final = 3
"""Number of failed downloads in a row after which the driver downloads no more records.

A download without a usable record is a failure, but a cancelled one is not. A new connection resets
the count.
"""
_HEAD: Final = re.compile(
    rb"MC Spin sensor data log\r?\n"
    rb".*\nTarget motion \([^)]*\): (?P<asked>\d+\.\d+)\r?\n"
    rb".*\n +@ stop detected - (?P<turned>-?\d+\.\d+)\r?\n",
    re.DOTALL,
)


class TurnRecords:
    """The records of controlled turns, and the ratio of the motors' speeds that they show."""

    def __init__(self) -> None:
        self._downloads = 0
        self.connect()
        self.forget()

    def connect(self) -> None:
        """Begin a new connection. The server may be another one than before."""
        self._failures, self._name = 0, ""

    def forget(self) -> None:
        """Forget the ratio of the motors' speeds, because parameters of the robot have changed."""
        self._told_rad = self._wheel_rad = 0.0

    @property
    def wanted(self) -> bool:
        """Whether the record of the next turn is needed."""
        few = self._downloads < MOST and self._failures < UNRECORDED
        return few and self._told_rad < ENOUGH_RAD

    @property
    def balance(self) -> float | None:
        """The speed of the left motor divided by the speed of the right motor, in controlled turns.

        None until the recorded turns add up to LEAST_RAD.
        """
        return self._told_rad / self._wheel_rad - 1.0 if self._told_rad >= LEAST_RAD else None

    def asked(self) -> None:
        """Record that the driver begins to download a record.

        At first, the download is counted as a failure. When the odometry has used the record, the
        method ``used`` sets the count of failures to zero.
        """
        self._downloads += 1
        self._failures += 1

    def degrees(self, name: str, pieces: list[bytes], request: Request) -> float | None:
        """Return a turn's angle in degrees, with the server's sign, from the file of the turn.

        None if the file has no angle, or belongs to another turn than ``request``.
        """
        # the previous name: the server could not write a new file, and has sent the old file again
        again, self._name = name == self._name, name
        return None if again else recorded_deg(pieces, request)

    def used(self, told_rad: float, wheel_rad: float) -> None:
        """Learn the ratio of the motors' speeds from a recorded turn that the odometry has used.

        ``told_rad``: the recorded angle. ``wheel_rad``: the part that the right wheel has caused;
        with equal motors, half of the turn.
        """
        self._failures = 0
        self._told_rad += abs(told_rad)
        self._wheel_rad += abs(wheel_rad)

    def cancelled(self) -> None:
        """Record that a command or a job has ended the download before the file was complete.

        This shows nothing about the server, so the download is not regarded as a failure.
        """
        self._failures -= 1


def recorded_deg(pieces: list[bytes], request: Request) -> float | None:
    """Return a turn's angle in degrees, with the server's sign, from the file of the turn.

    ``pieces``: content of the file. None if the file has no angle, or belongs to another turn than
    ``request``.
    """
    for piece in pieces:  # the angle is in the first piece, so a later piece may be lost
        if head := _HEAD.match(piece):
            asked = float(request.data.split()[-1])
            if abs(float(head["asked"]) - asked) > SAME_DEG:
                return None
            return float(head["turned"])
    return None
