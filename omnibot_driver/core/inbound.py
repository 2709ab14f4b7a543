# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The inbound path turns bytes from the board, or elapsed time, into measurements and events.

This module does not know what the bytes mean, or which motion is commanded.
"""

from collections.abc import Sequence

from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.pipeline import CommandPipeline
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.measurement.pipeline import MeasurementPipeline
from omnibot_driver.core.mode_manager import ModeManager
from omnibot_driver.core.readings import (
    ExtraReading,
    NoticeReading,
    OdometryReading,
    PausedReading,
    Reading,
)
from omnibot_driver.core.reporter import Reporter
from omnibot_driver.core.requests import RequestDone
from omnibot_driver.core.safety import SafetyStops


class Inbound:
    """Passes the board's readings on to the measurements, the safety stops and the reporter."""

    def __init__(
        self,
        board: Board,
        mode_manager: ModeManager,
        measurement: MeasurementPipeline,
        commanding: CommandPipeline,
        liveness: Liveness,
        reporter: Reporter,
        safety: SafetyStops,
    ) -> None:
        self._board, self._mode_manager = board, mode_manager
        self._measurement, self._commanding = measurement, commanding
        self._liveness, self._reporter, self._safety = liveness, reporter, safety
        self._last: Reading | None = None
        """Newest reading that ``hear`` has decoded and ``process`` has not handled yet."""

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Process bytes that arrived at ``now``: call ``hear``, then ``process``."""
        self._reporter.events += self.hear(data, now, channel)
        self.process(now)

    def hear(self, data: bytes, now: float, channel: int = 0) -> list[ImuEstimate]:
        """Decode bytes; return the IMU estimates to publish at once. Call ``process`` afterwards.

        After a change of mode, ``hear`` also calls ``process`` itself, adds the estimates to the
        reporter's events, and returns an empty list. The caller calls ``process`` in this case,
        too.
        """
        self._liveness.came_at = now
        before = self._board.mode
        if readings := self._board.receive(data, now, channel):
            self._liveness.heard_at, self._last = now, readings[-1]
        estimates = self._measurement.hear(readings, now)
        after = self._board.mode
        if after is before:
            return estimates
        self._reporter.events += estimates
        self._reporter.news_at = now
        self.process(now)
        if after.running and not before.running:
            self._safety.set_out(now)
        self._reporter.news_at = now  # so that the next ``process`` returns True
        return []

    def process(self, now: float) -> bool:
        """Handle the readings that the last call of ``hear`` has decoded.

        Return False if there is certainly nothing to write to the board and no event to report.
        """
        last, self._last = self._last, None
        if (
            now < self._reporter.news_at
            and now < self._board.wake_at
            and not self._measurement.undigested
            and not self._reporter.events
            and self._mode_manager.at_rest
        ):
            return False
        if last is None:
            return True
        if self._measurement.undigested:
            measured = self._measurement.flush()
            refused = self._measurement.refused_displacements
            if news := self._commanding.count_refused(refused, now):
                self._reporter.notify(news)
            self._safety.react(measured, now)
        if now >= self._reporter.news_at:
            self._reporter.look_for_news(now)
        if self._board.mode.running and not isinstance(last, PausedReading):
            self._mode_manager.heard_data(now, estopped=self._commanding.policy.latched)
        return True

    def elapse(self, now: float) -> None:
        """Process readings that follow from time alone, such as predicted odometry."""
        before = self._board.mode
        readings = self._board.elapse(now)
        self._reporter.events += self._measurement.hear(readings, now)
        if _show_life(readings):
            self._liveness.heard_at, self._last = now, readings[-1]
            self.process(now)
        else:
            self._safety.react(self._measurement.flush(), now)
        if self._board.mode.running and not before.running:
            self._safety.set_out(now)

    def end(self, now: float) -> None:
        """Process the remaining readings, because the port was lost or closed."""
        readings = self._board.flush(now)
        if _show_life(readings):
            self._last = readings[-1]
        self._reporter.events += self._measurement.hear(readings, now)
        self.process(now)
        self._safety.react(self._measurement.release(), now)


def _show_life(readings: Sequence[Reading]) -> bool:
    """Return whether readings that came without new bytes show that the board is alive.

    OdometryReadings, NoticeReadings and results of requests do not show this: they can follow from
    elapsed time alone.
    """
    for reading in readings:
        content = reading.content if isinstance(reading, ExtraReading) else reading
        if not isinstance(content, OdometryReading | NoticeReading | RequestDone):
            return True
    return False
