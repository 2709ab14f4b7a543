# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One connection to one board, whole: bytes and wishes in; measurements, answers and bytes out.

The shell around it calls an input, then takes ``take_output`` to the port and ``take_events`` to
whoever listens, and calls ``tick`` when ``wake_at`` has come. Not thread-safe, reads no clock, does
not log: whatever a user should hear of is an event.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.interlocks import why_not_calibrate, why_not_drive
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.pipeline import Command, CommandPipeline
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.commands.shaping import ControlMethod
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Event, Notice, StateChanged
from omnibot_driver.core.geometry.se2 import Pose, Signs
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuCorrection, ImuEstimate
from omnibot_driver.core.measurement.outlier_filter import MotionLimits, Refused
from omnibot_driver.core.measurement.pipeline import Measured, MeasurementPipeline
from omnibot_driver.core.mode_manager import CLOSED, ModeManager, Phase
from omnibot_driver.core.odometry.estimator import OdometrySettings
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import (
    DisplacementReading,
    PausedReading,
    PoseReading,
    Reading,
    Vector3,
)
from omnibot_driver.core.reporting.figures import SessionFigures
from omnibot_driver.core.reporting.notices import HEADING_ASSUMED, Notices, why_silent
from omnibot_driver.core.requests import OnExit, Request

TELL_EVERY_S: Final = 0.1
"""News need not be looked for with every read."""
DISCONNECTED: Final = "disconnected"


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSettings:
    """What may change while the session runs."""

    limits: SpeedLimits
    commands: CommandSettings
    odometry: OdometrySettings
    motion: MotionLimits = field(default_factory=MotionLimits)
    imu: ImuCorrection = field(default_factory=ImuCorrection)
    motion_monitor: bool = True
    """Whether a robot that does not move as commanded is stopped."""


class Session:
    """``run``: whether the board is to be started whenever it is there; ``axis_signs``: 1 or -1 for
    x, y and yaw where the board's body axes are not REP-103's, for commands and odometry alike;
    ``control``: where the board's switch stands, which no board tells; ``obeys``: whether the robot
    can be expected to do what it is told here, which a recorded one was not.
    """

    def __init__(
        self,
        board: Board,
        settings: SessionSettings,
        *,
        run: bool,
        axis_signs: Signs = (1, 1, 1),
        control: ControlMethod = "velocity",
        obeys: bool = True,
    ) -> None:
        self._board, self._traits = board, board.traits
        self._mode_manager = ModeManager(board, run=run)
        self._measurement = MeasurementPipeline(
            board, settings.odometry, settings.motion, settings.imu, axis_signs
        )
        self._odometry, self._imu = self._measurement.odometry, self._measurement.inertial
        self._commanding = CommandPipeline(
            board,
            self._odometry,
            settings.limits,
            settings.commands,
            axis_signs,
            control,
            obeys=obeys,
            monitored=settings.motion_monitor,
        )
        self._commands = self._commanding.policy
        self._heard_at = self._came_at = -math.inf
        self._silent = self._leaving = False
        self._last: Reading | None = None
        self._tell_at = -math.inf
        self._notices_due = Notices()
        self._overruns = 0
        self._events: list[Event] = []
        self.shown = (self.state, self.estop_active)
        """As of the last ``take_events``: nothing that is only passed through amid an input."""
        self._beneath: tuple[Phase, Mode, bool] | None = None
        """What that is made of, which is quicker to look at."""

    # What is so

    @property
    def state(self) -> str:
        """The public name of the link's and the board's state."""
        if self._closed:
            return DISCONNECTED
        resetting = self._mode_manager.phase is Phase.RESETTING
        return str((Mode.UNKNOWN if resetting else self._board.mode).value)

    @property
    def estop_active(self) -> bool:
        """The driver's own latch."""
        return self._commands.latched

    @property
    def refused(self) -> Refused:
        """What the wire said and nobody was told."""
        return self._measurement.refused

    def figures(self, now: float) -> SessionFigures:
        """All that is counted and measured."""
        return SessionFigures(
            state=self.state,
            tally=replace(self._measurement.tally),
            board=self._board.figures,
            refused=self.refused,
            skew_ppm=self._measurement.skew_ppm,
            commands=self._commanding.figures(now),
            imu=self._imu.figures,
        )

    @property
    def gyro_bias(self) -> Vector3:
        """What is taken off the gyro's readings, in rad/s."""
        return self._imu.calibration.bias

    @property
    def wake_at(self) -> float:
        """When ``tick`` must be called at the latest; infinity when nothing is due."""
        if self._mode_manager.phase is CLOSED:
            return math.inf
        silent_at = math.inf if self._silent else self._heard_at + self._traits.silence_s
        unheard_at = self._heard_at + self._traits.unheard_s if self._commands.current else math.inf
        return min(
            silent_at,
            unheard_at,
            self._board.wake_at,
            self._mode_manager.wake_at,
            self._commands.wake_at,
            self._imu.calibration.wake_at,
        )

    # What happens

    def configure(self, settings: SessionSettings, now: float, *, board: object = None) -> None:
        """New settings, from the next command and frame on; stricter ones end the present one.

        ``board``: new settings of the board's own, in which the present command is said as well.
        """
        self._notify(self._commanding.configure(settings.limits, settings.commands, now))
        self._commanding.monitor(settings.motion_monitor)
        if board is not None:
            self._board.settings = board
            self._notify(self._commanding.check_anew(now))
        self._measurement.configure(settings.odometry, settings.motion, settings.imu)

    def opened(self, now: float) -> None:
        """The port is open."""
        self._board.connect()
        self._commanding.begin(now)
        self._commands.connect(now)
        self._measurement.restart()
        self._silent, self._heard_at, self._came_at = False, now, -math.inf
        self._mode_manager.opened(now)

    def closed(self, now: float) -> None:
        """The port is gone."""
        self._events += self._take_in(self._board.flush(now), now)
        self.process(now)
        self._react(self._measurement.release(), now)
        self._mode_manager.closed()
        self._imu.calibration.give_up("the port was lost meanwhile; call again once it is back")
        self._commands.discard(now)

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        """Bytes came in at ``now``."""
        self._events += self.hear(data, now, channel)
        self.process(now)

    def hear(self, data: bytes, now: float, channel: int = 0) -> list[ImuEstimate]:
        """``receive``, but for what can wait until these are told: ``process`` is to follow.

        Whoever commands in between is as one who came before the bytes. That must not be where they
        change the mode, so there nothing waits; nor does it where anything else is asked for.
        """
        self._came_at = now
        before = self._board.mode
        estimates = self._take_in(self._board.receive(data, now, channel), now)
        after = self._board.mode
        if after is before:
            return estimates
        self._events += estimates
        self._tell_at = now
        self.process(now)
        if after.running and not before.running:
            self._commands.proof.begin()
            self._commands.halt(now)
        return []

    def overran(self, count: int) -> None:
        """So often the port has lost bytes since it was opened: they never came to us."""
        self._overruns = count

    def process(self, now: float) -> bool:
        """What comes of the bytes that were heard last. False: nothing to write or to tell."""
        last, self._last = self._last, None
        if last is None:
            return True
        if (
            now < self._tell_at
            and now < self._board.wake_at
            and not self._measurement.undigested
            and not self._events
            and self._mode_manager.at_rest
        ):
            return False
        if self._measurement.undigested:
            measured = self._measurement.flush()
            self._notify(
                self._commanding.count_refused(self._measurement.refused_displacements, now)
            )
            self._react(measured, now)
        if now >= self._tell_at:
            self._tell(now)
        if self._board.mode.running and not isinstance(last, PausedReading):
            self._mode_manager.heard_data(now)
        return True

    def tick(self, now: float) -> None:
        """Time passed."""
        if self._commands.current and now - self._heard_at >= self._traits.unheard_s:
            self._commands.halt(now)
        if not self._silent and now - self._heard_at >= self._traits.silence_s:
            self._silent = True
            self._react(self._measurement.release(), now)
            self._notify(
                [why_silent(self._traits.silence_s, bytes_came=self._came_at > self._heard_at)]
            )
            if self._board.mode is not Mode.UNKNOWN:
                self._board.silence()
                self._measurement.restart()
                self._commands.proof.begin()
                self._commands.halt(now)
                self._mode_manager.heard_nothing(now)
        self._mode_manager.tick(now)
        self._imu.calibration.tick(now)

    def stood_still(self, seconds: float, now: float) -> None:
        """This process, or its watchdog, did not run for so long: no command is current."""
        if not self._closed:
            self._heard_at = now  # the silence was ours
            self._commands.halt(now)
            self._notify(
                [
                    f"the driver stood still for {seconds:.1f} s: the robot is stopped"
                    " until a new command comes"
                ]
            )

    # What is wanted

    def command_twist(self, twist: BodyTwist, now: float, *, age_s: float = 0.0) -> None:
        """Drive the body. Raises CommandRefused, and then nothing changes.

        ``age_s``: how long ago it was sent, by the sender's stamp.
        """
        self._command(self._commanding.twist(twist, now, age_s=age_s), now)

    def command_wheels(self, rates_radps: Sequence[float], now: float) -> None:
        """Turn the wheels. Raises CommandRefused, and then nothing changes."""
        self._command(self._commanding.wheels(rates_radps, now), now)

    def command_pose(self, goal: Pose, now: float) -> None:
        """Drive to a pose in the odometry frame. Raises CommandRefused; then nothing changes."""
        self._command(self._commanding.pose(goal), now)

    def request(self, request: Request, token: object, now: float) -> None:
        """Start, pause or reset; answered by a RequestDone. Raises RequestRefused at once."""
        if self._leaving:
            raise RequestRefused("the driver is shutting down")
        self.process(now)  # what came before is no answer
        self._mode_manager.request(request, token, now)
        if request is Request.START:
            self._commanding.interlock.start()
        else:
            self._commands.halt(now)

    def calibrate_gyro(self, token: object, now: float) -> None:
        """Find the gyro's bias; answered by a RequestDone. Raises RequestRefused at once."""
        calibration, phase = self._imu.calibration, self._mode_manager.phase
        if reason := why_not_calibrate(
            phase, self._board.mode, self._commands.current, measuring=calibration.measuring
        ):
            raise RequestRefused(reason)
        calibration.measure(token, now)

    def estop(self, active: bool, now: float, *, by: str = "the driver") -> str:
        """Latch or release the e-stop; returns what is so now, in a sentence."""
        if active:
            if not self.estop_active:
                self._notify([f"e-stop latched by {by}"])
            self._commands.latch(now)
            if self._closed:
                return "e-stop latched; the port is not open: the stop is sent as soon as it is"
            if self._board.mode is Mode.UNKNOWN:
                return "e-stop latched; nothing comes from the board: nobody knows if it hears us"
            return "e-stop latched"
        if not self.estop_active:
            return "the e-stop was not latched"
        self._commanding.release(now)
        self._notify([f"e-stop released by {by}"])
        return "e-stop released; the robot stands still until a new command comes"

    def reset_odometry(self, now: float) -> None:
        """The odometry frame begins where the robot stands; a goal in the old one is dropped."""
        self.process(now)
        self._events += self._odometry.reset()
        self._notify(self._commanding.check_goal([], now))

    def leave(self, now: float) -> None:
        """The driver ends: nothing is obeyed any more, and Stop is repeated."""
        self._leaving = True
        self._commands.halt(now)

    def fall_silent(self, now: float) -> bool:
        """Stop is not repeated any more: the last one may have been damaged, so it is proved anew.

        Whether the board can show that.
        """
        if self._board.mode is not Mode.NOMINAL or self.estop_active:
            return False
        self._commands.fall_silent(now)
        return True

    @property
    def stands(self) -> bool:
        """The board has shown that the robot stands, and no motion was commanded since."""
        return self._commands.proof.proved

    def shutdown_sequence(self, on_exit: OnExit, now: float) -> Packets:
        """The last packets to write before the port is closed."""
        proved = self._commands.quiet and self.stands
        packets = self._mode_manager.shutdown_sequence(on_exit, proved=proved)
        self._commands.discard(now)
        return packets + self._estop_again()

    def broken_off(self) -> Packets:
        """What is to follow a write that failed half-way, before the port is closed."""
        return self._board.wake() + self._estop_again()

    def _estop_again(self) -> Packets:
        return self._board.emergency_stop() if self.estop_active else NO_PACKETS

    # What comes of it

    def take_output(self, now: float) -> Packets:
        """What to write now; it counts as written."""
        if self._mode_manager.phase is CLOSED:
            return NO_PACKETS
        packets = self._board.due(now) if now >= self._board.wake_at else NO_PACKETS
        if self._mode_manager.output:
            said = self._mode_manager.take_output()
            self._commanding.wrote(said, now)
            packets += said
        if due := self._commands.due(now):
            self._commanding.said(now)
            packets += due
        if self._commands.unconfirmed:
            self._commands.unconfirmed = False
            measured = self._commands.proof.measured
            self._notify(self._notices_due.unconfirmed(self._board.mode, measured=measured))
        return packets

    def take_events(self) -> list[Event]:
        """What happened since the last call, in order."""
        for answers in (self._mode_manager.answers, self._imu.calibration.answers):
            if answers:
                self._events += answers
                answers.clear()
        beneath = (self._mode_manager.phase, self._board.mode, self._commands.latched)
        if beneath != self._beneath:
            self._beneath = beneath
            shown = (self.state, self.estop_active)
            if shown != self.shown:
                self.shown = shown
                self._events.append(StateChanged(*shown))
        events, self._events = self._events, []
        return events

    @property
    def _closed(self) -> bool:
        return self._mode_manager.phase is CLOSED

    def _take_in(self, readings: list[Reading], now: float) -> list[ImuEstimate]:
        if readings:
            self._heard_at, self._silent, self._last = now, False, readings[-1]
        return self._measurement.hear(readings, now)

    def _react(self, measured: list[Measured], now: float) -> None:
        for reading, estimates in measured:
            self._events += estimates
            if isinstance(reading, DisplacementReading):
                self._notify(self._commanding.look(reading, estimates, now))
                if reading.restarted:
                    self._commands.halt(now)
            elif isinstance(reading, PoseReading):
                if reading.restarted:
                    self._commands.halt(now)
            elif isinstance(reading, PausedReading):
                self._commanding.begin(now)
                self._commands.proof.paused()
                if self._board.mode.running:  # again, within one read
                    self._commands.halt(now)
                self._mode_manager.heard_paused(now, continues=reading.continues)
        if self._commands.current is not None:
            self._notify(self._commanding.check_goal([], now))

    def _tell(self, now: float) -> None:
        self._tell_at = now + TELL_EVERY_S
        bulletin, measuring, advice = self._notices_due, self._measurement, self._board.advice
        news = bulletin.counted(
            measuring.tally.lost_displacements, self._overruns, measuring.refused, now
        )
        news += bulletin.standing(self._imu.advice)
        if advice is not None:
            news += bulletin.once(advice)
        if self._odometry.heading_assumed:
            news += bulletin.once(HEADING_ASSUMED)
        self._notify(news)

    def _notify(self, sentences: Sequence[str]) -> None:
        if sentences:
            self._events += map(Notice, sentences)

    def _command(self, wish: Command, now: float) -> None:
        if self._leaving:
            raise CommandRefused("motion command refused: the driver is shutting down")
        motion, expires_at = wish
        unheard = now - self._heard_at >= self._traits.unheard_s and not motion.is_zero
        if reason := why_not_drive(
            self._mode_manager.phase,
            self._board.mode,
            latched=self._commands.latched,
            unheard_s=self._traits.unheard_s if unheard else 0.0,
            interlock=self._commanding.interlock.arrive(
                now, self._commands.settings.timeout_s, stands=motion.is_zero
            ),
        ):
            raise CommandRefused(f"motion command refused: {reason}")
        self._commands.command(motion, now, expires_at=expires_at)
        if not motion.is_zero:
            self._imu.calibration.give_up(
                "a motion command came in; stop the sender, then call again"
            )
