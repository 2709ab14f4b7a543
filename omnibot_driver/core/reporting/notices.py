# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Notices about lost data, unconfirmed stops and silence, each with a remedy.

Most notices are given only once, or at a limited rate. This module knows only counts, times and
texts.
"""

import math
from typing import Final

from omnibot_driver.core.board import Mode
from omnibot_driver.core.measurement.outlier_filter import Refused

NEWS_S: Final = 10.0
"""Shortest time in s between two notices about the same counter."""
HEADING_ASSUMED: Final = (
    "the board sends no valid pose, so the driver assumes that the board's heading began at 0; if"
    " the robot has turned since the board started, restart the board"
)

SIDEWAYS: Final = (
    "cmd_vel: sideways speed is set to zero; this base cannot move sideways (reported once)"
)
OUT_OF_PLANE: Final = (
    "cmd_vel: linear.z, angular.x and angular.y are set to zero; this base moves on the floor only"
    " (reported once)"
)
STOP_UNSEEN: Final = (
    "stop unconfirmed: in IMU-only mode the board does not report motion, so the driver repeats"
    " Stop for 5 s after each stop; check by eye that the robot has stopped"
)
STOP_BLIND: Final = (
    "stop unconfirmed: the board does not measure its wheels after commands like the last one;"
    " check by eye that the robot has stopped (reported once)"
)
STOP_UNANSWERED: Final = (
    "stop unconfirmed: the board is not responding; if the robot moves, cut its motor power; then"
    " check cable and power"
)
STOP_UNMEASURED: Final = (
    "stop unconfirmed: no odometry frames from the board; check by eye that the robot has stopped,"
    " and check cable and hub"
)
STOP_UNHEEDED: Final = (
    "stop unconfirmed: Stop was repeated and the robot still moves; if it is not being pushed,"
    " the board does not receive commands: switch the motors off by hand and check the cable"
)


class ThrottledNotice:
    """A counter whose growth is reported at a limited rate."""

    def __init__(self) -> None:
        self._told = 0
        self._told_at = -math.inf

    def since_told(self, count: int, now: float) -> int:
        """Return how much the counter has grown since its last report, if a new report is due.

        Return 0 if the last report is less than 10 s old (``NEWS_S``).
        """
        if count == self._told or now - self._told_at < NEWS_S:
            return 0
        new, self._told, self._told_at = count - self._told, count, now
        return new


class Notices:
    """Decides which notices to give, and remembers which were given before."""

    def __init__(self) -> None:
        self._lost, self._refused = ThrottledNotice(), ThrottledNotice()
        self._overruns = 0
        self._overran_at = -math.inf
        self._told: set[str] = set()
        self._standing = ""

    def counted(self, lost: int, overruns: int, refused: Refused, now: float) -> list[str]:
        """Return notices of lost frames and rejected readings that were not reported before.

        All counts are totals since the driver began. ``lost``: odometry frames. ``overruns``:
        overruns of the serial port, each with lost bytes.
        """
        news = []
        if overruns != self._overruns:
            self._overruns, self._overran_at = overruns, now
        if more := self._lost.since_told(lost, now):
            news.append(
                f"odometry frames lost in this computer: {more}; the serial port overran: reduce"
                " the load, or use another adapter"
                if now - self._overran_at < NEWS_S  # an earlier overrun is not the cause
                else f"odometry frames lost on the line: {more}; check cable and hub"
            )
        total = refused.imu + refused.displacements + refused.poses
        if more := self._refused.since_told(total, now):
            news.append(
                f"implausible readings rejected: {more} (in total {refused.imu} imu,"
                f" {refused.displacements} odometry, {refused.poses} poses); the line corrupts"
                " bits, or a motion limit is set too low"
            )
        return news

    def once(self, sentence: str) -> list[str]:
        """Return the sentence as a list; an empty list if the sentence was given before."""
        if sentence in self._told:
            return []
        self._told.add(sentence)
        return [sentence]

    def unconfirmed(self, mode: Mode, *, measured: bool, blind: bool = False) -> list[str]:
        """Return the notice that a stop is unconfirmed, although Stop was repeated.

        ``measured``: whether displacements have arrived since Stop.

        ``blind``: True if the board does not measure the wheels after the last motion command.
        """
        if mode is Mode.IMU_ONLY:
            return self.once(STOP_UNSEEN)
        if mode is Mode.UNKNOWN:
            return [STOP_UNANSWERED]
        if blind:
            return self.once(STOP_BLIND)
        return [STOP_UNHEEDED if measured else STOP_UNMEASURED]

    def standing(self, sentence: str) -> list[str]:
        """Return a list with the notice ``sentence`` if the reported condition has just begun.

        Otherwise return an empty list. ``sentence`` is empty while the condition does not hold.
        """
        before, self._standing = self._standing, sentence
        return [sentence] if sentence and not before else []


def why_silent(silence_s: float, *, bytes_came: bool, baudrate: bool) -> str:
    """Return a sentence that reports missing data and says what to check.

    ``bytes_came``: whether invalid bytes arrived. ``baudrate``: whether the port has a baud rate.
    """
    if bytes_came:
        return (
            f"no valid data for {silence_s:g} s; check"
            f"{' the parameter `baudrate`,' if baudrate else ''} the cable, and the type of the"
            " board"
        )
    return (
        f"no data from the board for {silence_s:g} s; check its power, its cable and the parameter"
        " `port`"
    )
