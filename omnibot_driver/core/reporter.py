# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The reports of a session: events in order, notices when they are due, state and figures.

The reporter changes no part of a session. It must not know who receives the reports.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.pipeline import CommandPipeline
from omnibot_driver.core.events import Event, Notice, StateChanged
from omnibot_driver.core.long_task import LongTask
from omnibot_driver.core.measurement.pipeline import MeasurementPipeline
from omnibot_driver.core.mode_manager import CLOSED, ModeManager, Phase
from omnibot_driver.core.reporting.figures import SessionFigures
from omnibot_driver.core.reporting.notices import (
    HEADING_ASSUMED,
    OUT_OF_PLANE,
    SIDEWAYS,
    Notices,
    why_silent,
)

NEWS_EVERY_S: Final = 0.1
"""Shortest time between two searches for new notices, in s. A search at every read would be too
slow."""
DISCONNECTED: Final = "disconnected"


class Reporter:
    """The collector of events, state and figures of a session.

    * ``events``: events since the last ``take``.
    * ``news_at``: time of the next ``look_for_news``, in s.
    * ``missing``: which of the board's ports are not open, as a sentence; empty if all are open.
    * ``overruns``: how often a port has lost bytes, over all connections.
    * ``shown``: public state and e-stop latch at the last ``take``.
    """

    def __init__(
        self,
        board: Board,
        mode_manager: ModeManager,
        measurement: MeasurementPipeline,
        commanding: CommandPipeline,
        task: LongTask,
    ) -> None:
        self._task = task
        self._board, self._mode_manager = board, mode_manager
        self._measurement, self._commanding = measurement, commanding
        self._policy, self._calibration = commanding.policy, measurement.inertial.calibration
        self._notices = Notices()
        self.events: list[Event] = []
        self.news_at = -math.inf
        self.overruns = 0
        self.missing = ""
        self.shown = (self.state, self._policy.latched)
        self._beneath: tuple[Phase, Mode, bool, str] | None = None
        """Values from which the attribute ``shown`` was computed. If they change, ``shown`` is
        computed again."""

    @property
    def state(self) -> str:
        """Public name of the state of the link and the board."""
        if self._mode_manager.phase is CLOSED:
            return DISCONNECTED
        unknown = self.missing or self._mode_manager.phase is Phase.RESETTING
        return str((Mode.UNKNOWN if unknown else self._board.mode).value)

    def figures(self, now: float) -> SessionFigures:
        """Return all counters and measurements of the session."""
        return SessionFigures(
            state=self.state,
            tally=replace(self._measurement.tally),
            board=self._board.figures,
            refused=self._measurement.refused,
            skew_ppm=self._measurement.skew_ppm,
            commands=self._commanding.figures(now),
            imu=self._measurement.inertial.figures,
            task=self._task.progress(now),
        )

    def notify(self, sentences: Sequence[str]) -> None:
        """Append each sentence to the events, as a notice to the user."""
        if sentences:
            self.events += map(Notice, sentences)

    def look_for_news(self, now: float) -> None:
        """Add the notices that follow from counters and observations."""
        self.news_at = now + NEWS_EVERY_S
        notices, measuring, advice = self._notices, self._measurement, self._board.advice
        news = notices.counted(
            measuring.tally.lost_displacements, self.overruns, measuring.refused, now
        )
        news += notices.standing(measuring.inertial.advice)
        if advice is not None:
            news += notices.once(advice)
        if measuring.odometry.heading_assumed:
            news += notices.once(HEADING_ASSUMED)
        self.notify(news)

    def silent(self, silence_s: float, *, bytes_came: bool) -> None:
        """Report that no valid data arrived for ``silence_s``, if all ports of the board are open.

        ``bytes_came``: whether bytes arrived that could not be decoded.
        """
        if self.missing:
            return
        self.notify(
            [why_silent(silence_s, bytes_came=bytes_came, baudrate=self._board.traits.baudrate)]
        )
        if bytes_came and (advice := self._board.advice):
            self.notify(self._notices.once(advice))

    def unconfirmed(self) -> None:
        """Report that Stop was repeated for its full time without proof of a standstill."""
        measured = self._policy.proof.measured
        blind = not self._board.shows_standstill
        self.notify(self._notices.unconfirmed(self._board.mode, measured=measured, blind=blind))

    def set_to_zero(self, *, sideways: bool, planar: bool) -> None:
        """Report which parts of a body velocity the driver has set to zero, each part only once.

        ``planar``: False if there was motion out of the plane.
        """
        if sideways:
            self.notify(self._notices.once(SIDEWAYS))
        if not planar:
            self.notify(self._notices.once(OUT_OF_PLANE))

    def take(self) -> list[Event]:
        """Return and clear the events since the last call, in order."""
        for answers in (
            self._mode_manager.answers,
            self._calibration.answers,
            self._task.answers,
        ):
            if answers:
                self.events += answers
                answers.clear()
        beneath = (
            self._mode_manager.phase,
            self._board.mode,
            self._policy.latched,
            self.missing,
        )
        if beneath != self._beneath:
            self._beneath = beneath
            shown = (self.state, self._policy.latched)
            if shown != self.shown:
                self.shown = shown
                self.events.append(StateChanged(*shown))
        events, self.events = self.events, []
        return events
