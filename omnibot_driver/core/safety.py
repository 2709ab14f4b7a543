# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Safety stops: the causes that stop the robot at once, whatever the source of its commands.

* The e-stop is latched.
* The board restarts, is paused, falls silent, or reports that the robot must be stopped.
* This process was stalled.

For all other reasons, the command policy or the motion monitor stops the robot. This module does
not know bytes, or who commands the robot.
"""

from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.interlocks import REPLAY
from omnibot_driver.core.commands.pipeline import CommandPipeline
from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.long_task import LongTask
from omnibot_driver.core.measurement.pipeline import Measured, MeasurementPipeline
from omnibot_driver.core.mode_manager import CLOSED, ModeManager
from omnibot_driver.core.readings import (
    DisplacementReading,
    EStopButtonReading,
    NoticeReading,
    PausedReading,
    PoseReading,
    ResetReading,
)
from omnibot_driver.core.reporter import Reporter

BUTTON: Final = "the button on the robot"
BUTTON_HELD: Final = (
    "e-stop not released: the e-stop button on the robot was pressed and its release was not"
    " reported; release the button, then call again. If it is released already, press and release"
    " it once more"
)


class SafetyStops:
    """The safety stops of one session. Each stop is reported to ``reporter``."""

    def __init__(
        self,
        board: Board,
        mode_manager: ModeManager,
        measurement: MeasurementPipeline,
        commanding: CommandPipeline,
        liveness: Liveness,
        reporter: Reporter,
        task: LongTask,
    ) -> None:
        self._board, self._mode_manager = board, mode_manager
        self._measurement, self._commanding = measurement, commanding
        self._policy = commanding.policy
        self._liveness, self._reporter = liveness, reporter
        self._task = task
        self._button_held = False
        """Whether the e-stop button is held, according to the last report about it.

        The report may be from an earlier connection.
        """

    def react(self, measured: list[Measured], now: float) -> None:
        """Process the readings in order: report estimates, and stop the robot where necessary."""
        notify, commanding = self._reporter.notify, self._commanding
        for reading, estimates in measured:
            self._reporter.events += estimates
            if isinstance(reading, DisplacementReading):
                notify(commanding.look(reading, estimates, now))
                if reading.restarted:
                    self._policy.halt(now)
            elif isinstance(reading, PoseReading):
                if reading.restarted:
                    self._policy.halt(now)
            elif isinstance(reading, PausedReading):
                commanding.begin(now)
                self._policy.proof.paused()
                if self._board.mode.running:  # the board paused and ran again within one read
                    self._policy.halt(now)
                self._mode_manager.heard_paused(now, continues=reading.continues)
            elif isinstance(reading, EStopButtonReading):
                unreported, self._button_held = not self._button_held, reading.pressed
                if reading.pressed:
                    self.estop(True, now, by=BUTTON)
                elif unreported:
                    by = f"{BUTTON}; its release was reported, but not its press"
                    self.estop(True, now, by=by)
            elif isinstance(reading, NoticeReading):
                if reading.text:
                    notify([reading.text])
                if reading.halt:
                    self._policy.halt(now)
            elif isinstance(reading, ResetReading):
                self._mode_manager.heard_reset(now, reading.remark)
        if self._policy.current is not None:
            notify(commanding.check_goal([], now))

    def estop(self, active: bool, now: float, *, by: str) -> str:
        """Latch or release the e-stop, and return the resulting state as a sentence.

        ``by``: who latches or releases, as named in the notice. Raises RequestRefused for a release
        while the robot's button is held.
        """
        latched = self._policy.latched
        if active:
            if not latched:
                self._reporter.notify([f"e-stop latched by {by}"])
            self._policy.latch(now)
            self._mode_manager.give_up_start()
            self._task.give_up(
                "the e-stop was latched during the request; release it, then call again"
            )
            if not latched:
                self._measurement.inertial.calibration.give_up(
                    "the e-stop was latched during the calibration; call again"
                )
            if not self._commanding.obeys:
                return f"e-stop latched; {REPLAY}"
            if self._mode_manager.phase is CLOSED:
                return "e-stop latched; the port is not open; the stop will be sent when it opens"
            if missing := self._reporter.missing:
                return (
                    f"e-stop latched; {missing}: the driver sends the stop on the other ports"
                    " only; cut the motor power if the robot moves"
                )
            if self._board.mode is Mode.UNKNOWN:
                return (
                    "e-stop latched; the board is not responding; delivery of the stop is"
                    " unconfirmed"
                )
            return "e-stop latched"
        if not latched:
            return "the e-stop was not latched"
        if self._button_held:
            raise RequestRefused(BUTTON_HELD)
        self._commanding.release(now)
        self._reporter.notify([f"e-stop released by {by}"])
        return "e-stop released; robot stopped until the next command"

    def set_out(self, now: float) -> None:
        """Stop the robot, because the board may carry out an old command.

        Call this method when the board begins to run, and when it falls silent.
        """
        self._policy.proof.begin()
        self._policy.halt(now)

    def tick(self, now: float) -> None:
        """Check how long the board has been silent, and react.

        After a short silence (``unheard_s``), stop the robot. After a long silence (``silence_s``),
        also forget the board's mode.
        """
        liveness = self._liveness
        if self._policy.current and liveness.unheard(now):
            self._reporter.notify(self._commanding.stop_unheard(liveness.unheard_s, now))
        if not liveness.fell_silent(now):
            return
        self.react(self._measurement.release(), now)
        self._board.discard()
        self._measurement.restart()
        self._reporter.silent(  # the bytes of a frame cut by a power loss do not count
            liveness.silence_s,
            bytes_came=liveness.came_at - liveness.heard_at > liveness.silence_s / 2,
        )
        if self._board.mode is not Mode.UNKNOWN:
            self._board.silence()
            self._task.give_up("the board stopped responding; check its power and cable")
            self.set_out(now)
            self._mode_manager.heard_nothing(now)

    def stalled(self, seconds: float, now: float) -> None:
        """Stop the robot, because this process was stalled for ``seconds``.

        A long task that is in progress ends as failed.
        """
        self._liveness.stalled(now)
        self._task.give_up("the driver stalled meanwhile; call again")
        self._board.stalled()
        self._policy.halt(now)
        timeout_s = self._policy.settings.timeout_s
        self._commanding.interlock.be_active(now, timeout_s, stalled_s=seconds)
        self._reporter.notify(
            [f"driver stalled for {seconds:.1f} s; robot stopped until the next command"]
        )
