# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""From what the board says, or what time alone makes known, to measurements and events.

``hear`` gives what is to be published at once, and ``process`` what comes of the rest: checked
displacements, a mode that has changed, answers, figures. Composes the board, what is measured, and
what stops the robot; must not know bytes, nor what is commanded.
"""

from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.pipeline import CommandPipeline
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.measurement.pipeline import MeasurementPipeline
from omnibot_driver.core.mode_manager import ModeManager
from omnibot_driver.core.readings import NoticeReading, OdometryReading, PausedReading, Reading
from omnibot_driver.core.reporter import Reporter
from omnibot_driver.core.safety import SafetyStops


class Inbound:
    """Feeds ``measurement`` and ``safety``; events go to ``reporter``."""

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
        """Of those that were heard and not processed yet."""

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Process bytes that arrived at ``now``."""
        self._reporter.events += self.hear(data, now, channel)
        self.process(now)

    def hear(self, data: bytes, now: float, channel: int = 0) -> list[ImuEstimate]:
        """``receive``, but for what can wait until these are published: ``process`` is to follow.

        A command that arrives in between is handled as if it came before the bytes. That must not
        be where they change the mode, so there nothing waits; nor does it where anything else is
        asked for.
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
        return []

    def process(self, now: float) -> bool:
        """What comes of the bytes that were heard last. False: nothing to write or to tell."""
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
            self._mode_manager.heard_data(now)
        return True

    def elapse(self, now: float) -> None:
        """What becomes known without bytes; odometry that is predicted does not count as heard."""
        before = self._board.mode
        readings = self._board.elapse(now)
        self._reporter.events += self._measurement.hear(readings, now)
        if all(isinstance(reading, OdometryReading | NoticeReading) for reading in readings):
            self._safety.react(self._measurement.flush(), now)
        else:
            self._liveness.heard_at, self._last = now, readings[-1]
            self.process(now)
        if self._board.mode.running and not before.running:
            self._safety.set_out(now)

    def end(self, now: float) -> None:
        """What the board has said so far is all, as the port is lost."""
        if readings := self._board.flush(now):
            self._last = readings[-1]
        self._reporter.events += self._measurement.hear(readings, now)
        self.process(now)
        self._safety.react(self._measurement.release(), now)
