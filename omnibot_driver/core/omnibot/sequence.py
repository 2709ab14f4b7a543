# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The counters of the board's deltas and poses. They show lost deltas and a restart of the board.

The counter SEQ of the deltas has one byte and wraps every 10.24 s at 25 Hz. The arrival times show
how often it has wrapped. The poses have a counter of their own. The board sends a fixed number of
deltas between two poses, so a pose also shows how many deltas were lost.

Input: counters and arrival times; this module does not know what a frame contains.
"""

from typing import Final

from omnibot_driver.core.omnibot.schedule import USUAL, Schedule
from omnibot_driver.core.values import value

WRAP: Final = 256

# With a full buffer on the host, and every tenth byte lost, an arrival time is wrong by up to
# 0.24 s.
LATE_S: Final = 0.5
"""Limit, in s, for the difference between measured and counted time from delta to delta.

Beyond this limit plus the drift (``DRIFT``), the board may have restarted. Keep the limit above
0.24 s, the largest error of an arrival time.
"""
DRIFT: Final = 0.01
"""Largest relative error of the board's clock, and of times that are computed from its counters.

After minutes of silence, this error can hide a restart; only the board's pose then shows it.
"""
EARLY_S: Final = 0.2
"""Tolerance, in s, for the time since the last delta, within which a counter must have reached its
value. If the last delta was read late, this time seems too short."""
LONG_GAP_S: Final = 1.0
"""Longest gap before a pose, in s, after which this pose can still show a restart of the board. The
pose is compared with the last delta, which is too old after a longer gap."""


@value(frozen=True, slots=True)
class Step:
    """What the counter of a new delta or pose shows, compared with its previous value.

    * ``lost``: number of missing deltas that were not reported before.
    * ``duration_s``: time that the delta covers; None if unknown.
    * ``restarted``: whether the counter seems to have restarted, which only the board's pose can
      prove.
    * ``doubtful``: whether ``restarted`` is True although a continued count is more likely.
    """

    lost: int
    duration_s: float | None = USUAL.delta_period_s
    restarted: bool = False
    doubtful: bool = False


class Sequence:
    """The counters of one board, over any number of connections."""

    def __init__(self, schedule: Schedule = USUAL) -> None:
        self._period_s = schedule.delta_period_s
        self._per_pose = schedule.deltas_per_pose
        self._imus_per_delta = schedule.imus_per_delta
        self._delta: int | None = None
        self._delta_at = 0.0
        self._pose: int | None = None
        self._pose_at = 0.0
        self._since_pose = 0
        self._renewed = False
        """Whether the counter of the deltas seems to have restarted since the last pose."""
        self._told = 0
        self._regular = False
        """Whether a pose has ever come after the expected number of deltas.

        Until then, the counters of poses are ignored.
        """
        self._paused = self._reconnected = False
        self._ahead: int | None = None
        """Counter of the last delta, if it was too high for the elapsed time; else None. Such a
        counter may be damaged; the next delta shows whether it was right."""
        self.ambiguous = False
        """Whether the counters at the last pose have two explanations: a restart of the board in
        the gap before this pose, or a loss of all deltas in this gap."""
        self._may_be_new = False
        """Whether the board may have restarted in a gap since the last pose. True if deltas were
        lost in the gap, and the counter after the gap is low enough for a restart from zero."""
        self._left: tuple[int, float, int] | None = None
        """Data to undo an assumed restart, else None: the last counter before the restart, its
        arrival time in s, and the first counter after the restart."""

    def pause(self) -> None:
        """Record that the board is paused. Its counters may then continue, or restart at zero.

        The next delta decides which is assumed; only the board's pose can prove a restart.
        """
        self._paused, self._pose = True, None

    def reconnect(self) -> None:
        """Begin a new connection: the board may have restarted in the meantime."""
        self._reconnected = True

    def delta(self, count: int, now: float, *, imus: int = 0) -> Step:
        """Return what the counter of a new delta shows about lost deltas and about a restart.

        ``now``: arrival time of the delta in s. ``imus``: number of IMU frames since the previous
        delta.
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
            # The duration of the pause is unknown. If poses can disprove a restart, every jump of
            # the count is regarded as a restart, because the first deltas after it may be lost.
            # Without poses, only a low count is. A restart is doubtful if it would mean more lost
            # deltas than a continued count.
            anew = lost > 0 or count == 0 if self._regular else count <= lost
            return Step(0, None, restarted=anew, doubtful=anew and lost < count)
        wraps = max(0, round((elapsed_s / period_s - lost - 1) / WRAP))
        lost += wraps * WRAP
        late_s = abs((lost + 1) * period_s - elapsed_s)
        latest_late_s = LATE_S + DRIFT * elapsed_s
        if 2 * latest_late_s > WRAP * period_s:
            self._pose = None  # the number of wraps is not known, so poses cannot be compared
        from_zero = count * period_s <= elapsed_s + EARLY_S
        if (
            (lost or self._regular)  # without poses, nothing could disprove a restart
            and late_s > latest_late_s
            and (reconnected or from_zero)
        ):
            self._renewed, self._left = True, (before, before_at, count)
            return Step(0, None, restarted=True, doubtful=lost % WRAP == 0)
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
        self._may_be_new |= from_zero and lost > 0
        self._since_pose += lost + 1
        return Step(lost, period_s)

    def pose(self, count: int, now: float) -> Step:
        """Return what the counter of a new pose shows about lost deltas and about a restart.

        ``now``: arrival time in s. ``lost`` in the result: number of missing deltas, whose motion
        the pose contains.
        """
        may_be_new, self._may_be_new, self.ambiguous = self._may_be_new, False, False
        if may_be_new and self._delta is not None:
            self.ambiguous = self._from_zero(count, self._delta, now - self._pose_at)
        if self._reconnected:
            return Step(0)  # the next delta counts the losses from before and after this pose
        before, self._pose = self._pose, count
        counted, self._since_pose = self._since_pose, 0
        renewed, self._renewed = self._renewed, False
        elapsed_s, self._pose_at = now - self._pose_at, now
        if before is None or self._delta is None:
            return Step(0)
        passed = (count - before) % WRAP * self._per_pose
        self._regular = self._regular or 0 < passed == counted
        if not self._regular:
            return Step(0)
        most_off = 2.0 * self._per_pose
        if renewed:  # the time shows where the old counter would be now
            counted = round(elapsed_s / self._period_s)
            most_off = (LATE_S + DRIFT * elapsed_s) / self._period_s
        missing = max(0, passed - counted)
        time_s = now - self._delta_at + self._period_s
        in_time = (self._told + missing) * self._period_s <= time_s
        delta = self._delta if self._ahead is None else self._ahead
        goes_on = passed == self._per_pose
        goes_on = goes_on or (in_time and missing * self._period_s > LONG_GAP_S)
        wrap = WRAP * self._per_pose
        off = (passed - counted) % wrap
        jumped = not goes_on and min(off, wrap - off) > most_off
        if jumped and self._from_zero(count, delta, elapsed_s):
            self._delta, self._ahead, self.ambiguous = delta, None, False
            return Step(0, None, restarted=True)
        if renewed or not in_time:
            return Step(0)  # too little time has passed for these losses, or they are unknown
        self._told += missing
        return Step(missing)

    def _from_zero(self, count: int, delta: int, elapsed_s: float) -> bool:
        """Return whether the counters of poses and deltas can have begun at zero together.

        ``count``, ``delta``: the counters of a new pose and of the last delta. ``elapsed_s``: time
        since the previous pose.
        """
        passed = count * self._per_pose
        wraps = max(0, round((passed - delta) / WRAP))
        in_time = not wraps or passed * self._period_s <= elapsed_s + EARLY_S
        return in_time and abs(passed - delta - wraps * WRAP) <= self._per_pose

    def _take_back(self, count: int, now: float) -> None:
        """Undo an assumed restart if ``count`` shows that the old counter has continued."""
        left, self._left = self._left, None
        if left is not None:
            was, at, anew = left
            deltas, elapsed_s = (count - was) % WRAP, now - at
            deltas += max(0, round((elapsed_s / self._period_s - deltas) / WRAP)) * WRAP
            late_s = abs(deltas * self._period_s - elapsed_s)
            on_time = late_s <= LATE_S + DRIFT * elapsed_s
            if on_time and not 0 < (count - anew) % WRAP <= self._per_pose:
                self._delta, self._delta_at = was, at
