# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The counters of the board's deltas and poses: missing deltas, and whether the board restarted.

SEQ, the counter of the deltas, is one byte. At 25 Hz it returns to 0 every 10.24 s, and arrival
times show how often it has done so. Poses have a counter of their own. A pose comes with every
fifth delta, or with every second delta at 10 Hz. So a pose can reveal lost deltas before the next
delta does.

This module knows counters and arrival times; it does not know what a frame contains.
"""

from typing import Final

from omnibot_driver.core.omnibot.schedule import USUAL, Schedule
from omnibot_driver.core.values import value

WRAP: Final = 256

LATE_S: Final = 0.5
"""A restart is assumed if the elapsed time and the time that the counter shows differ by more than
this time, in s.

The possible drift of the board's clock is added to this limit. The limit is about twice the largest
error of arrival times, 0.24 s. This error occurs when the host's buffer is full (4096 bytes, 2.4 s)
and lacks one byte in ten.
"""
DRIFT: Final = 0.01
"""Largest relative error of the board's clock, and so of the time that the counter shows.

After a silence of minutes, the error may be seconds. After such a silence, only the board's pose is
reliable evidence of a restart. The counter is not.
"""
EARLY_S: Final = 0.2
"""After a restart, the counter may show at most this much more time, in s, than has elapsed.

The elapsed time is too short if the last delta before the restart was read late. A restart of the
board takes longer than this tolerance.
"""


@value(frozen=True, slots=True)
class Step:
    """What the counter of a new delta or pose shows, compared with its previous value.

    ``lost``: number of missing deltas that were not reported before.

    ``duration_s``: time in s that the delta covers; None if this is unknown.

    ``restarted``: whether the counter seems to have restarted from zero. Only the board's pose can
    prove a restart.
    """

    lost: int
    duration_s: float | None = USUAL.delta_period_s
    restarted: bool = False


class Sequence:
    """The counters of one board, over any number of connections."""

    def __init__(self, schedule: Schedule = USUAL) -> None:
        self._period_s = schedule.delta_period_s
        self._per_pose = schedule.deltas_per_pose
        self._imus_per_delta = schedule.imus_per_delta
        self._delta: int | None = None
        self._delta_at = 0.0
        self._pose: int | None = None
        self._since_pose = 0
        self._told = 0
        self._regular = False
        """Whether a pose has ever come after the expected number of deltas. Until then, the
        counters of poses are ignored."""
        self._paused = self._reconnected = False
        self._ahead: int | None = None
        """Counter of the last delta if it was too high for the elapsed time, else None.

        A counter that is too high may have a flipped bit, or its bytes may not be a true frame.
        Until another delta continues this counter, lost deltas are computed from the elapsed time.
        """
        self._left: tuple[int, float, int] | None = None
        """The last counter before a supposed restart, its arrival time in s, and the first counter
        after it."""

    def pause(self) -> None:
        """Record that the board paused. Its next counter may continue the count or be zero."""
        self._paused, self._pose = True, None

    def reconnect(self) -> None:
        """Begin a new connection: the board may have restarted in the meantime."""
        self._reconnected, self._pose = True, None

    def delta(self, count: int, now: float, *, imus: int = 0) -> Step:
        """Return what the counter of a new delta shows about lost deltas and about a restart.

        ``count``: the counter. ``now``: arrival time of the delta in s. ``imus``: number of IMU
        frames since the previous delta.
        """
        self._take_back(count, now)
        period_s, per_pose = self._period_s, self._per_pose
        before, self._delta = self._delta, count
        before_at, self._delta_at = self._delta_at, now
        elapsed_s = now - before_at
        paused, self._paused = self._paused, False
        reconnected, self._reconnected = self._reconnected, False
        told, self._told = self._told, 0
        if before is None:
            return Step(0, None if paused else period_s)
        lost = (count - before - 1) % WRAP
        if paused:
            return Step(0, None, restarted=count <= lost)
        wraps = max(0, round((elapsed_s / period_s - lost - 1) / WRAP))
        lost += wraps * WRAP
        late_s = abs((lost + 1) * period_s - elapsed_s)
        latest_late_s = LATE_S + DRIFT * elapsed_s
        from_zero = count * period_s <= elapsed_s + EARLY_S
        if lost and late_s > latest_late_s and (reconnected or from_zero):
            self._pose, self._left = None, (before, before_at, count)
            return Step(0, None, restarted=True)
        latest_s = (lost + 1) * period_s - (
            period_s / 2 if imus == self._imus_per_delta else latest_late_s
        )
        ahead = lost > told and elapsed_s < latest_s
        goes_on = self._ahead is not None and 0 < (count - self._ahead) % WRAP <= per_pose
        self._ahead = count if ahead and not goes_on else None
        in_time = max(0, round(elapsed_s / period_s) - 1)
        if self._ahead is not None:
            lost, self._delta = in_time, (before + in_time + 1) % WRAP
        elif ahead and lost >= WRAP - per_pose:
            lost = in_time  # not a wrap: a false delta was counted before
        lost -= min(lost, told)
        self._since_pose += lost + 1
        return Step(lost, period_s)

    def pose(self, count: int, now: float) -> Step:
        """Return what the counter of a new pose shows about lost deltas and about a restart.

        ``count``: the counter. ``now``: arrival time of the pose in s. In the result, ``lost`` is
        the number of missing deltas whose motion the pose includes.
        """
        before, self._pose = self._pose, count
        counted, self._since_pose = self._since_pose, 0
        if before is None or self._delta is None:
            return Step(0)
        passed = (count - before) % WRAP * self._per_pose
        self._regular = self._regular or 0 < passed == counted
        if not self._regular:
            return Step(0)
        from_zero = abs(count * self._per_pose - self._delta) <= self._per_pose
        goes_on = passed == self._per_pose or self._ahead is not None  # until a delta confirms it
        if from_zero and not goes_on and abs(passed - counted) > 2 * self._per_pose:
            return Step(0, None, restarted=True)
        missing = max(0, passed - counted)
        if (self._told + missing) * self._period_s > now - self._delta_at + self._period_s:
            return Step(0)  # too little time has passed for these losses
        self._told += missing
        return Step(missing)

    def _take_back(self, count: int, now: float) -> None:
        """Withdraw a supposed restart if ``count`` continues the counter from before the
        restart."""
        left, self._left = self._left, None
        if left is not None:
            was, at, anew = left
            deltas, elapsed_s = (count - was) % WRAP, now - at
            deltas += max(0, round((elapsed_s / self._period_s - deltas) / WRAP)) * WRAP
            late_s = abs(deltas * self._period_s - elapsed_s)
            on_time = late_s <= LATE_S + DRIFT * elapsed_s
            if on_time and not 0 < (count - anew) % WRAP <= self._per_pose:
                self._delta, self._delta_at = was, at
