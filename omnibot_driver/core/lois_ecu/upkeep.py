# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Schedule of all that is written to a LOIS ECU except set-points, resets and the ball command.

The ball command drops a ball from the robot. This module does not know the board's reports.
"""

import math

from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.messages import SetTerminalMode, TerminalMode
from omnibot_driver.core.lois_ecu.opening import (
    AFTER_SET_POINT_S,
    RECOVER_AFTER_S,
    UNANSWERED_S,
    SettingsWriter,
)
from omnibot_driver.core.lois_ecu.record_request import RecordRequest
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.terminal import ModeChange


class Upkeep:
    """Scheduler of settings, modes, records and recovery. ``due`` returns the lines to write now.

    ``opened``: whether the writing of the current settings has begun.
    """

    def __init__(self, settings: LoisEcuSettings, points: SetPoints) -> None:
        self._points = points
        self.writer = SettingsWriter(settings, points)
        self.change = ModeChange()
        self.change.want(settings.terminal_mode)
        self.connect()

    def connect(self) -> None:
        """Begin a new connection. The settings are then written to the board again."""
        self.opened = False
        self.change.connect()
        self.request = RecordRequest()
        self.heard_at_s = self._recovered_at_s = -math.inf

    def configure(self, settings: LoisEcuSettings) -> None:
        """Use new settings, and write changed ones to the board.

        The robot is stopped before these changes:

        * a new drive mode;
        * the terminal mode of a sensor;
        * in duty mode, a new duty scale or a lower ``max_duty``.
        """
        before, self.writer.settings = self.writer.settings, settings
        if settings.drive_mode != before.drive_mode:
            self.change.stop_first("drive_mode", settings.drive_mode)
        elif settings.drive_mode == "duty" and settings.duty_scale != before.duty_scale:
            self.change.stop_first("duty_scale", f"{settings.duty_scale:g}")
        elif settings.drive_mode == "duty" and settings.max_duty < before.max_duty:
            self.change.stop_first("max_duty", f"{settings.max_duty}")
        if settings.terminal_mode is not before.terminal_mode:
            self.change.want(settings.terminal_mode)
        if _written(settings) != _written(before):
            self.opened = False

    def due(self, now: float, *, stands: bool) -> bytes:
        """Return the bytes to write now. Called at the time ``wake_at``.

        ``stands``: whether the robot is seen at rest.
        """
        if not self.opened:
            self.opened = True
            self.writer.begin(now)
            self._recovered_at_s = now
        with_sum = self.writer.settings.with_sum
        recovers = now >= self._recover_at
        data = b"" if recovers else self.writer.due(now)  # a recovery begins all rounds anew
        data += self._change_mode(now, stands=stands)
        if (record := self.request.due(now)) is not None:
            data += outbound.lines(record, with_sum=with_sum)
        if self._points.clears(now):
            data += outbound.lines(outbound.EMERGENCY_STOP, with_sum=with_sum)
        if recovers:
            self._recovered_at_s = now
            data += self.writer.recovery()
            self.writer.begin(now)
        return data

    @property
    def wake_at(self) -> float:
        """Time at which to call ``due`` next."""
        if not self.opened:
            return -math.inf
        return min(
            self.writer.wake_at,
            self._points.clears_at,
            self._recover_at,
            self.change.wake_at,
            self.request.wake_at,
        )

    def _change_mode(self, now: float, *, stands: bool) -> bytes:
        """Return the bytes to write now to change a mode, or no bytes if nothing is due.

        If the change needs a robot at rest, the first calls return zero set-points.
        """
        change, with_sum = self.change, self.writer.settings.with_sum
        if stop := change.stops(now, stands=stands, cleared=self._points.cleared):
            return outbound.lines(stop, with_sum=with_sum)
        mode = change.due(now, settled=self.writer.done)
        if mode is None:
            return b""
        if mode is TerminalMode.HOST:
            return self.writer.recovery()
        self.writer.overwritten = True
        return outbound.lines(outbound.STOP, *[SetTerminalMode(mode)] * 3, with_sum=with_sum)

    @property
    def _recover_at(self) -> float:
        if self.change.sensor_wanted or self.change.terminal or self._points.driving:
            return math.inf
        silent_since_s = self._recovered_at_s if self.writer.ignored else self.heard_at_s
        due_at_s = max(silent_since_s, self._recovered_at_s) + RECOVER_AFTER_S
        unanswered_since_s = self.writer.unanswered_since_s
        if unanswered_since_s < math.inf:
            due_at_s = min(due_at_s, max(unanswered_since_s, self._recovered_at_s) + UNANSWERED_S)
        if due_at_s >= self._points.said_at_s + AFTER_SET_POINT_S:  # no set-point delays it
            return due_at_s
        return self.writer.after_set_points(due_at_s)


def _written(settings: LoisEcuSettings) -> tuple[object, ...]:
    return settings.low_pass, settings.written, settings.periods_ms, settings.with_sum
