# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One connection to one board, whole: bytes and wishes in; measurements, answers and bytes out.

The shell around it calls an input, then takes ``take_output`` to the port and ``take_events`` to
its caller, and calls ``tick`` when ``wake_at`` has come. Not thread-safe, reads no clock, does
not log: whatever a user should hear of is an event.

It knows in which order its parts have their turn, and keeps next to nothing itself: ``liveness``
when the board was heard, ``safety`` what stops the robot, ``interlocks`` what is refused,
``reporter`` what there is to tell. Must not know bytes or threads.
"""

import math
from collections.abc import Sequence

from omnibot_driver.core.board import Board, Mode
from omnibot_driver.core.commands.interlocks import Interlocks
from omnibot_driver.core.commands.pipeline import Command, CommandPipeline
from omnibot_driver.core.commands.shaping import ControlMethod
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Event
from omnibot_driver.core.geometry.se2 import Pose, Signs
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.long_task import LongTask
from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.measurement.pipeline import MeasurementPipeline
from omnibot_driver.core.mode_manager import CLOSED, ModeManager
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import (
    NoticeReading,
    OdometryReading,
    PausedReading,
    Reading,
    Vector3,
)
from omnibot_driver.core.reporter import Reporter
from omnibot_driver.core.reporting.figures import SessionFigures
from omnibot_driver.core.requests import OnExit, Request
from omnibot_driver.core.safety import SafetyStops
from omnibot_driver.core.settings import SessionSettings


class Session:
    """``run``: whether the board is to be started whenever it is there; ``axis_signs``: 1 or -1 for
    x, y and yaw where the board's body axes are not REP-103's, for commands and odometry alike;
    ``control``: where the board's switch stands, which no board tells; None where it has none;
    ``obeys``: whether the robot can be expected to follow commands, which a recorded one
    was not.
    """

    def __init__(
        self,
        board: Board,
        settings: SessionSettings,
        *,
        run: bool,
        axis_signs: Signs = (1, 1, 1),
        control: ControlMethod | None = "velocity",
        obeys: bool = True,
    ) -> None:
        self._board = board
        modes = self._mode_manager = ModeManager(board, run=run)
        measurement = self._measurement = MeasurementPipeline(board, settings, axis_signs)
        self._odometry = measurement.odometry
        commanding = self._commanding = CommandPipeline(
            board, self._odometry, settings, axis_signs, control, obeys=obeys
        )
        self._commands = commanding.policy
        self._calibration = measurement.inertial.calibration
        liveness = self._liveness = Liveness(board.traits)
        self._interlocks = Interlocks(board, modes, commanding, self._calibration, liveness)
        self._task = LongTask()
        reporter = self._reporter = Reporter(board, modes, measurement, commanding, self._task)
        self._safety = SafetyStops(
            board, modes, measurement, commanding, liveness, reporter, self._task
        )
        self._last: Reading | None = None
        """Of those that were heard and not processed yet."""

    # What is so

    @property
    def state(self) -> str:
        """The public name of the link's and the board's state."""
        return self._reporter.state

    @property
    def estop_active(self) -> bool:
        """The driver's own latch."""
        return self._commands.latched

    @property
    def shown(self) -> tuple[str, bool]:
        """State and e-stop as of the last ``take_events``."""
        return self._reporter.shown

    @property
    def refused(self) -> Refused:
        """Readings rejected as implausible."""
        return self._measurement.refused

    def figures(self, now: float) -> SessionFigures:
        """All counters and measurements."""
        return self._reporter.figures(now)

    @property
    def gyro_bias(self) -> Vector3:
        """The bias that is subtracted from the gyro's readings, in rad/s."""
        return self._calibration.bias

    @property
    def wake_at(self) -> float:
        """The latest time for the next ``tick``; infinity if nothing is due."""
        if self._mode_manager.phase is CLOSED:
            return math.inf
        return min(
            self._liveness.wake_at(driven=self._commands.current is not None),
            self._board.wake_at,
            self._mode_manager.wake_at,
            self._commands.wake_at,
            self._calibration.wake_at,
            self._task.wake_at,
        )

    # What happens

    def configure(self, settings: SessionSettings, now: float, *, board: object = None) -> None:
        """New settings, from the next command and frame on; stricter ones end the present one.

        ``board``: new settings of the board's own, in which the present command is said as well.
        """
        self._reporter.notify(self._commanding.configure(settings, now))
        if board is not None:
            self._board.settings = board
            self._reporter.notify(self._commanding.check_anew(now))
        self._measurement.configure(settings)

    def opened(self, now: float, *, missing: str = "") -> None:
        """Begin with an open port. ``missing``: a sentence on the lines that are not open.

        A robot that receives only a part of its commands is stopped, and not driven.
        """
        self._board.connect()
        self._commanding.begin(now)
        self._commands.connect(now)
        self._measurement.restart()
        self._liveness.begin(now)
        self._mode_manager.opened(now)
        self._interlocks.missing = self._reporter.missing = missing
        if missing:
            self._commands.halt(now)

    def closed(self, now: float) -> None:
        """End the connection, as the port is lost."""
        if readings := self._board.flush(now):
            self._last = readings[-1]
        self._reporter.events += self._measurement.hear(readings, now)
        self.process(now)
        self._safety.react(self._measurement.release(), now)
        self._mode_manager.closed()
        for given_up in (self._calibration.give_up, self._task.give_up):
            given_up("the port was lost meanwhile; call again once it is back")
        self._commands.discard(now)

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

    def overran(self, count: int) -> None:
        """Note how often the port has lost bytes since it was opened."""
        self._reporter.overruns = count

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

    def tick(self, now: float) -> None:
        """Time passed."""
        if now >= self._board.wake_at:
            self._elapse(now)
        self._safety.tick(now)
        self._mode_manager.tick(now)
        self._calibration.tick(now)
        self._task.tick(now)

    def stood_still(self, seconds: float, now: float) -> None:
        """This process, or its watchdog, stalled for this time: no command is current."""
        if self._mode_manager.phase is not CLOSED:
            self._safety.stalled(seconds, now)

    # What is wanted

    def command_twist(self, twist: BodyTwist, now: float, *, age_s: float = 0.0) -> None:
        """Drive the body. Raises CommandRefused, and then nothing changes.

        ``age_s``: how long ago it was sent, by the sender's stamp.
        """
        self._command(self._commanding.twist(twist, now, age_s=age_s), now)

    def command_wheels(self, rates_radps: Sequence[float], now: float) -> None:
        """Turn the wheels. If it raises CommandRefused, nothing changes."""
        self._command(self._commanding.wheels(rates_radps, now), now)

    def command_pose(self, goal: Pose, now: float) -> None:
        """Drive to a pose in the odometry frame. Raises CommandRefused; then nothing changes."""
        self._command(self._commanding.pose(goal), now)

    def request(self, request: Request, token: object, now: float) -> None:
        """Start, pause or reset; answered by a RequestDone. Raises RequestRefused at once."""
        if reason := self._interlocks.why_not_request():
            raise RequestRefused(reason)
        self.process(now)  # what came before is not an answer
        self._mode_manager.request(request, token, now)
        if request is Request.START:
            self._commanding.interlock.start()
        else:
            self._commands.halt(now)

    def calibrate_gyro(self, token: object, now: float) -> None:
        """Measure the gyro's bias; a RequestDone answers later. Raises RequestRefused at once."""
        if reason := self._interlocks.why_not_calibrate():
            raise RequestRefused(reason)
        self._calibration.measure(token, now)

    def begin_task(self, name: str, token: object, limit_s: float, now: float) -> None:
        """Something that the board takes long for; answered by a RequestDone.

        ``name`` reads well after "a". Raises RequestRefused at once where it cannot be begun.
        """
        if reason := self._interlocks.why_not_task():
            raise RequestRefused(reason)
        self._task.begin(name, token, limit_s, now)

    def task_is_current(self, token: object) -> bool:
        """Whether the task with this token still runs and was not given up."""
        return self._task.is_current(token)

    def end_task(self, token: object, success: bool, message: str) -> None:
        """End the task, as done or failed."""
        self._task.end(token, success, message)

    def estop(self, active: bool, now: float, *, by: str = "the driver") -> str:
        """Latch or release the e-stop; returns what is so now, in a sentence.

        Raises RequestRefused for a release while the button on the robot is held.
        """
        return self._safety.estop(active, now, by=by)

    def reset_odometry(self, now: float) -> None:
        """Begin the odometry frame at the robot's present pose; a goal in the old one is
        dropped."""
        self.process(now)
        self._board.reset_odometry()
        self._reporter.events += self._odometry.reset()
        self._reporter.notify(self._commanding.check_goal([], now))

    def leave(self, now: float) -> None:
        """Begin the shutdown: refuse everything, and repeat Stop."""
        self._interlocks.leaving = True
        self._board.leave()
        self._commands.halt(now)

    def fall_silent(self, now: float) -> bool:
        """Stop is not repeated any more: the last one may have been damaged, so it is proved anew.

        Whether the board can show that.
        """
        if self._board.mode is not Mode.NOMINAL or self.estop_active:
            return False
        if not self._board.shows_standstill:
            return False
        self._commands.fall_silent(now)
        return True

    @property
    def board(self) -> Board:
        """The board, for its own profile."""
        return self._board

    @property
    def stands(self) -> bool:
        """The board has shown that the robot stands, and no motion was commanded since."""
        return self._commands.proof.proved

    @property
    def proof_takes_s(self) -> float:
        """How long to wait until the robot is seen to stand, from Stop on."""
        return self._commands.proof.takes_s

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
        """The packets to write now; they count as written."""
        if self._mode_manager.phase is CLOSED:
            return NO_PACKETS
        packets = NO_PACKETS
        if self._mode_manager.output:
            packets = self._mode_manager.take_output()
            self._commanding.wrote(packets, now)
        if due := self._commands.due(now):
            self._commanding.said(now)
            packets += due
        if now >= self._board.wake_at:
            packets += self._board.due(now)
        if self._task.wake_at < math.inf:
            current = self._commands.current
            self._task.watch(driven=current is not None and not current.is_zero)
        if self._commands.unconfirmed:
            self._commands.unconfirmed = False
            self._reporter.unconfirmed()
        return packets

    def take_events(self) -> list[Event]:
        """Return and forget the events since the last call, in order."""
        return self._reporter.take()

    def _elapse(self, now: float) -> None:
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

    def _command(self, wish: Command, now: float) -> None:
        motion, expires_at = wish
        if reason := self._interlocks.why_not_drive(motion, now):
            raise CommandRefused(f"motion command refused: {reason}")
        self._commands.command(motion, now, expires_at=expires_at)
        if not motion.is_zero and self._calibration.wake_at < math.inf:
            self._calibration.give_up("a motion command came in; stop the sender, then call again")
