# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Turns on the spot: how the driver sets their speed, and what it learns from them.

This module knows rates and motor units; it does not know when a turn begins or ends. The caller
passes the time.
"""

import math
from typing import Final

from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.motors import Lines
from omnibot_driver.core.mart.odometry import SLOWING_S, MartOdometry
from omnibot_driver.core.mart.replies import Fail, Ok, Reply
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.speed_loop import SpeedLoop
from omnibot_driver.core.mart.words import Form, Request

RATIO: Final = 0.35
"""Relative change of the commanded rate above which the driver begins a new turn."""
OFF, OFF_AGAIN, EARLY_S = 0.05, 0.12, 1.0
"""Relative error of a turn's rate above which the driver begins the turn anew.

* ``OFF``: until the driver has learned from a turn, in the first EARLY_S (s) of a steady rate.
* ``OFF_AGAIN``: otherwise. This limit is higher, because a new start disturbs the motion.
"""
HELD, LEAST_LESSON = 0.6, 0.6
"""Limits for learning from slow turns, as fractions of the commanded rate.

* ``LEAST_LESSON``: lowest rate that the driver learns. It replaces a lower measured rate.
* ``HELD``: lowest measured rate from which the driver learns, except in the first turn. In a slower
  turn, something holds the robot.
"""
EVEN: Final = 0.15
"""Relative change of the rate during a turn, below which the driver learns from the turn."""
HINDERED, TOO_FAST = 0.8, 1.12
"""Limits of a turn's measured rate, as fractions of its commanded rate. If a turn above TOO_FAST
follows one below HINDERED, the driver undoes what it learned from the slow turn."""
SAME, CORRECTIONS = 0.2, 2
"""Limits for turns that the driver begins anew to correct their rate.

``SAME``: largest relative difference of two commanded rates that are regarded as equal.
``CORRECTIONS``: largest number of corrections for equal rates.
"""
STEADY: Final = 0.03
"""Relative change of the commanded rate above which it is regarded as a new rate."""
SPINS_UP_S, SEEN_RAD, TOLD_RAD = 0.2, 0.1, 0.6
"""Conditions for learning from a turn how fast the motors turn.

* ``SPINS_UP_S``: least time in s from the turn's start to the averaging window.
* ``SEEN_RAD``: least angle of the turn, in rad.
* ``TOLD_RAD``: angle in rad above which the server's angle is used instead of the wheel's.
"""
UNSURE_RAD, UNSURE_PART = 0.15, 0.4
"""Terms of the largest plausible error of the angle in a stop's reply.

It is UNSURE_RAD (rad), plus UNSURE_PART times the expected turn, plus the turn during two queries.
If the error is larger, the reply may be an encoder count.
"""
JUST_SET_S: Final = 2.0
"""Time in s after an SSP request for which the server certainly keeps the speed that SSP has set.
"""
SLOW_UNITS: Final = 20
"""Motor units of the server's speed SLOW, in backward drives (B) and in turns on the spot."""
SETTING_REFUSED: Final = (
    "the server does not accept a speed for turns on the spot. It makes every such turn at its own"
    " speed SLOW, which is faster than most commanded turns. If you accept this, set `spin_speed:"
    " fixed`, and this message does not return (reported once)"
)


class SpotTurns:
    """The turns on the spot, which the commands R (right) and L (left) start.

    * ``units``: motor units of the last turn, or those that SSP (the command for the speed of
      turns) has set for the next turn; 0 at the beginning of a connection.
    * ``seen_radps``: measured rate of the last turn, in rad/s.
    """

    def __init__(self, settings: MartSettings, odometry: MartOdometry, loop: SpeedLoop) -> None:
        self.settings = settings
        self._odometry, self._loop = odometry, loop
        self.connect()

    def connect(self) -> None:
        """Begin a new connection. The speed that the server has set for turns is unknown."""
        self.units = 0
        self.seen_radps = self._rate_radps = self._corrected_radps = 0.0
        self._corrections, self._has_learned = 0, False
        self._before_slow: Lines | None = None
        self._wanted_radps, self._wanted_s = 0.0, -math.inf
        self._set_units: int | None = None
        self._set_s = -math.inf
        self._refused = False

    @property
    def is_fixed(self) -> bool:
        """Whether all turns have the controller's own speed SLOW, not the commanded speed."""
        return self._refused or self.settings.spin_speed == "fixed"

    def request(self, rate_radps: float) -> Request:
        """Return the command that starts a turn with this rate."""
        word = words.L if rate_radps > 0.0 else words.R
        return word.request("SLOW" if self.is_fixed else "CUSTOM")

    def setting(self, rate_radps: float, now: float, delay_s: float) -> Request | None:
        """Return the request (SSP) that sets the speed for a turn, or None if it is not due.

        Send SSP before the turn's check of the IMU. ``delay_s``: time in s within which a copy of
        the last SSP can arrive.
        """
        units = self._loop.spin_units(rate_radps)
        if self.is_fixed or units == self._set_units or now < self._set_s + delay_s:
            return None
        self.units, self._set_s = units, now
        return words.SSP.request(5, units)

    def answered(self, reply: Ok | Fail) -> bool:
        """Evaluate the reply to SSP, which sets the speed; return whether SSP was accepted."""
        if isinstance(reply, Ok):
            self._set_units = self.units
        else:
            self._refused = True
        return not self._refused

    def refused(self) -> None:
        """Record that the server does not support turns with a set speed (CUSTOM)."""
        self._refused = True

    def forget_setting(self) -> None:
        """Record that the server may have been restarted and may have lost the speed of turns."""
        self._set_units = None

    def may_be_forgotten(self, now: float) -> bool:
        """Return whether the server may have been restarted since the speed of turns was set."""
        return now - self._set_s > JUST_SET_S

    def begin(self, rate_radps: float) -> None:
        """Record that a turn with this rate begins."""
        self._rate_radps = self._wanted_radps = rate_radps
        self._wanted_s = -math.inf
        if self.is_fixed:
            self.units = SLOW_UNITS

    def fits(self, rate_radps: float, now: float, *, turned_s: float, disturbed: bool) -> bool:
        """Return whether the current turn may continue although ``rate_radps`` is commanded now.

        ``turned_s``: time since the current turn began, in s.

        ``disturbed``: whether measurements may be missing.
        """
        if abs(rate_radps - self._wanted_radps) > STEADY * abs(rate_radps):
            self._wanted_radps, self._wanted_s = rate_radps, now
        if rate_radps * self._rate_radps <= 0.0:
            return False
        if self.is_fixed:
            return True
        near = abs(rate_radps - self._rate_radps) <= RATIO * abs(self._rate_radps)
        steady_s = min(turned_s, now - self._wanted_s)
        return near and not self._is_off(rate_radps, steady_s, disturbed=disturbed)

    def _is_off(self, rate_radps: float, steady_s: float, *, disturbed: bool) -> bool:
        """Return whether the turn's rate is so wrong that the driver must begin the turn anew.

        The result is False while the commanded rate changes.
        """
        if disturbed or not self._is_seen(steady_s):
            return False
        if not math.isclose(rate_radps, self._corrected_radps, rel_tol=SAME):
            self._corrected_radps, self._corrections = rate_radps, 0
        seen_radps = self._odometry.speeds.means[1]
        if self._is_held(seen_radps):
            return False
        is_early = not self._has_learned and steady_s < EARLY_S
        most_radps = (OFF if is_early else OFF_AGAIN) * abs(rate_radps)
        if abs(seen_radps - rate_radps) <= most_radps or self._corrections >= CORRECTIONS:
            return False
        lesson_radps = self._lesson(seen_radps)
        if self._loop.corrected_spin_units(self.units, lesson_radps, rate_radps) == self.units:
            return False
        self._corrections += 1
        return True

    def _is_seen(self, seconds: float) -> bool:
        """Return whether a turn that lasted ``seconds`` shows how fast the motors turn."""
        speeds = self._odometry.speeds
        if seconds < SPINS_UP_S + speeds.window_s or abs(self._odometry.turn.spun_rad) <= SEEN_RAD:
            return False
        return abs(speeds.changes[1]) < EVEN * abs(speeds.means[1])

    def _is_held(self, seen_radps: float) -> bool:
        """Return whether the robot turns so slowly that something must be holding it.

        If so, the driver must not learn from the turn. ``seen_radps``: measured rate of the turn.
        The result is False before the first learned turn.
        """
        return self._has_learned and abs(seen_radps) < HELD * abs(self._rate_radps)

    def _lesson(self, seen_radps: float) -> float:
        """Return the magnitude of the turn rate that the driver learns from a turn, in rad/s.

        The rate is ``seen_radps``, but at least LEAST_LESSON times the commanded rate.
        """
        return max(abs(seen_radps), LEAST_LESSON * abs(self._rate_radps))

    def may_be_count(self, reply: Reply, unseen_s: float, trip_s: float) -> bool:
        """Return whether a number in a reply may be an encoder count instead of a turn's angle.

        ``unseen_s``: time in s from the last encoder count to the first stop command. ``trip_s``:
        average duration of a query.
        """
        if not isinstance(reply, Ok) or reply.form is not Form.INTEGER:
            return False
        expected_rad = self._odometry.turn.spun_rad + self._rate_radps * unseen_s
        if abs(reply.number) <= 1 and abs(expected_rad) > UNSURE_RAD:
            return True  # maybe the reply to MCSTAT or to a sonar query
        told_rad = math.radians(reply.number) * self.settings.heading_scale
        most_rad = UNSURE_RAD + UNSURE_PART * abs(expected_rad) + abs(self._rate_radps) * 2 * trip_s
        return abs(told_rad - expected_rad) > most_rad

    def stopped(
        self, degrees: float | None, uncounted_s: float, turned_s: float, *, disturbed: bool
    ) -> None:
        """Evaluate a turn that was stopped.

        * ``degrees``: angle in the reply to the stop command; None if there was no angle.
        * ``uncounted_s``: time in s from the last encoder count to the first stop command.
        * ``turned_s``: time in s since the turn began.
        * ``disturbed``: whether the network is disturbed, so that nothing is learned.
        """
        odometry = self._odometry
        spun_rad = odometry.turn.spun_rad
        if degrees is not None:
            odometry.spin_told(degrees)
        if disturbed or not (self.units and self._is_seen(turned_s)):
            return
        rate_radps = self.seen_radps
        if self._is_held(rate_radps):
            return
        # whole degrees are more precise than the wheel if the turn is long
        if degrees is not None and abs(spun_rad) > TOLD_RAD:
            whole_rad = abs(spun_rad + rate_radps * (uncounted_s + SLOWING_S))
            rate_radps *= abs(self.settings.heading_scale * math.radians(degrees)) / whole_rad
        self._undo_false_lesson(abs(rate_radps / self._rate_radps))
        self._loop.spun(self.units, self._lesson(rate_radps))
        self._has_learned = True

    def keep_lessons(self) -> None:
        """Keep what the driver has learned, even if the next turn is fast.

        Otherwise, a fast turn undoes what the driver has learned from the slow turn before it.
        """
        self._before_slow = None

    def _undo_false_lesson(self, part: float) -> None:
        """Undo what was learned from a slow turn if the next turn is fast.

        Call this each time before the driver learns from a turn. ``part``: the turn's measured rate
        divided by its commanded rate.
        """
        if self._before_slow is not None and part > TOO_FAST:
            # otherwise the driver would learn from both turns a dead zone that does not exist
            self._loop.restore(self._before_slow)
            self._before_slow = None
        else:
            self._before_slow = self._loop.lines() if part < HINDERED else None
