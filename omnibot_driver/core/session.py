# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A session with one board: it takes bytes and commands, and gives measurements and packets.

After each input, the caller writes ``take_output`` and handles ``take_events``. The caller calls
``tick`` at ``wake_at``. The session is not thread-safe, and reads no clock.

This module connects the parts of a session. It does not know what the bytes mean, or which threads
exist.
"""

import math
from collections.abc import Sequence
from enum import Enum

from omnibot_driver.core.board import Board
from omnibot_driver.core.commands.interlocks import Interlocks
from omnibot_driver.core.commands.pipeline import Command, CommandPipeline
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.shaping import ControlMethod
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.events import Event
from omnibot_driver.core.geometry.se2 import Pose, Signs
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.inbound import Inbound
from omnibot_driver.core.liveness import Liveness
from omnibot_driver.core.long_task import LongTask
from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.measurement.pipeline import MeasurementPipeline
from omnibot_driver.core.mode_manager import CLOSED, ModeManager
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.reporter import Reporter
from omnibot_driver.core.reporting.figures import SessionFigures
from omnibot_driver.core.requests import Request
from omnibot_driver.core.safety import SafetyStops
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.core.shutdown import Shutdown


class Session:
    """The driver's core for one board, across all its connections.

    * ``run``: whether to start the board whenever it is connected.
    * ``axis_signs``: for x, y, yaw: -1 if the board's axis is opposite to REP-103's.
    * ``control``: control method (velocity or position) that a switch on the board selects; None if
      the board has no such switch.
    * ``obeys``: False if the session replays a recording, which cannot follow commands.
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
        self.interlocks = Interlocks(board, modes, commanding, self._calibration, liveness)
        self._task = LongTask()
        reporter = self._reporter = Reporter(board, modes, measurement, commanding, self._task)
        safety = self._safety = SafetyStops(
            board, modes, measurement, commanding, liveness, reporter, self._task
        )
        self.inbound = Inbound(board, modes, measurement, commanding, liveness, reporter, safety)
        self.shutdown = Shutdown(board, modes, self._commands, self.interlocks)

    # State

    @property
    def state(self) -> str:
        """Public name of the state of the link and the board."""
        return self._reporter.state

    @property
    def estop_active(self) -> bool:
        """Whether the driver's own e-stop is latched."""
        return self._commands.latched

    @property
    def shown(self) -> tuple[str, bool]:
        """Public state, and whether the e-stop was latched, at the last ``take_events``."""
        return self._reporter.shown

    @property
    def refused(self) -> Refused:
        """Numbers of readings that were rejected as implausible since the driver began."""
        return self._measurement.refused

    def figures(self, now: float) -> SessionFigures:
        """Return all counters and measurements of the session."""
        return self._reporter.figures(now)

    @property
    def gyro_bias(self) -> Vector3:
        """Bias that is subtracted from the gyro's readings, in rad/s."""
        return self._calibration.bias

    @gyro_bias.setter
    def gyro_bias(self, bias_radps: Vector3) -> None:
        self._calibration.bias = bias_radps

    @property
    def wake_at(self) -> float:
        """Latest time for the next ``tick``, in s; infinity if nothing is due."""
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

    # Inputs from the link and from the clock

    def configure(self, settings: SessionSettings, now: float, *, board: object = None) -> None:
        """Apply new settings to later commands and frames.

        * A stricter limit or timeout stops the robot, except while it drives to a goal.
        * A new scale of the odometry drops the current goal.
        * ``board``: new settings of the board itself; None if unchanged. If the current command
          cannot be encoded with them, the robot is stopped.
        """
        self._reporter.notify(self._commanding.configure(settings, now))
        if board is not None:
            self._board.settings = board
            self._reporter.notify(self._commanding.check_anew(now))
        self._measurement.configure(settings)
        self._reporter.notify(self._commanding.check_goal([], now))

    def opened(self, now: float, *, missing: str = "") -> None:
        """Begin a connection, because the port is open now.

        ``missing``: which ports are not open, as a sentence. If it is not empty, the driver does
        not drive the robot.
        """
        self._board.connect()
        self._commanding.begin(now)
        self._commands.connect(now)
        self._measurement.restart()
        self._liveness.begin(now)
        self._mode_manager.opened(now)
        self.interlocks.missing = self._reporter.missing = missing
        if missing:
            self._commands.halt(now)

    def closed(self, now: float) -> None:
        """End the connection, because the port is lost or closed."""
        self.inbound.end(now)
        self.interlocks.missing = self._reporter.missing = ""
        why = self.interlocks.why_not_request()  # empty unless the driver shuts down
        why = why or "the port was lost during the request; call again once it is back"
        for given_up in (self._mode_manager.closed, self._calibration.give_up, self._task.give_up):
            given_up(why)
        self._commands.discard(now)

    def overran(self, count: int) -> None:
        """Record that a port has lost bytes ``count`` times, counted over all connections."""
        self._reporter.overruns = count

    def tick(self, now: float) -> None:
        """Process elapsed time, timeouts and retries that are due at ``now``."""
        if now >= self._board.wake_at:
            self.inbound.elapse(now)
        self._safety.tick(now)
        self._mode_manager.tick(now)
        self._calibration.tick(now)
        self._task.tick(now)

    def stood_still(self, seconds: float, now: float) -> None:
        """Stop the robot, because this process or its pacer thread stalled for ``seconds``.

        This has no effect while the port is closed.
        """
        if self._mode_manager.phase is not CLOSED:
            self._safety.stalled(seconds, now)

    # Commands and requests

    def command_twist(
        self, twist: BodyTwist, now: float, *, age_s: float = 0.0, planar: bool = True
    ) -> None:
        """Command a body velocity.

        If this method raises CommandRefused, the earlier command stays in effect. ``age_s``: age of
        the sender's stamp in s. ``planar``: False if the sender's command also contained motion out
        of the plane.
        """
        self._command(self._commanding.twist(twist, now, age_s=age_s), now)
        sideways = self._commanding.shaper.sideways
        if sideways or not planar:
            self._reporter.set_to_zero(sideways=sideways, planar=planar)

    def command_wheels(
        self, rates_radps: Sequence[float], now: float, *, by: Enum = Authority.WHEELS
    ) -> None:
        """Command wheel rates, in rad/s.

        If this method raises CommandRefused, the earlier command stays in effect.

        ``by``: the topic that commands the rates. It may be a topic that only this board has.
        """
        self._command(self._commanding.wheels(rates_radps, now, by=by), now)

    def command_pose(self, goal: Pose, now: float) -> None:
        """Command a pose in the odometry frame.

        If this method raises CommandRefused, the earlier command stays in effect.
        """
        self._command(self._commanding.pose(goal), now)

    def end_goal(self, now: float) -> None:
        """End a drive to a goal, or a docking, because ``cmd_vel`` commanded zero velocity.

        The command was refused, but no ``cmd_vel_timeout`` would end these motions. A commanded
        velocity stays in effect, because it may be newer.
        """
        self._reporter.notify(self._commanding.end_goal(now))

    def request(self, request: Request, token: object, now: float) -> None:
        """Start, pause or reset the board. A RequestDone event reports the result later.

        Raises RequestRefused at once if the request is not possible now.
        """
        if reason := self.interlocks.why_not_request():
            raise RequestRefused(reason)
        self.inbound.process(now)  # earlier data is not an answer
        self._mode_manager.request(request, token, now)
        if request is Request.START:
            self._commanding.interlock.start()
        else:
            self._commands.halt(now)

    def calibrate_gyro(self, token: object, now: float) -> None:
        """Measure the gyro's bias. A RequestDone event reports the result later.

        Raises RequestRefused at once if a measurement is not possible now.
        """
        if reason := self.interlocks.why_not_calibrate():
            raise RequestRefused(reason)
        self._calibration.measure(token, now)

    def begin_task(self, name: str, token: object, limit_s: float, now: float) -> None:
        """Begin a task that takes the board a long time.

        A RequestDone event reports the result within ``limit_s``. ``name``: noun in messages, e.g.
        "recording". Raises RequestRefused if no task can begin now.
        """
        if reason := self.interlocks.why_not_task():
            raise RequestRefused(reason)
        self._task.begin(name, token, limit_s, now)

    def task_is_current(self, token: object) -> bool:
        """Return whether the task with this token is in progress."""
        return self._task.is_current(token)

    def end_task(self, token: object, success: bool, message: str) -> None:
        """End the task as done or failed. This has no effect if the task has already ended."""
        self._task.end(token, success, message)

    def estop(self, active: bool, now: float, *, by: str = "the driver") -> str:
        """Latch or release the e-stop, and return the resulting state as a sentence.

        ``by``: who latches or releases the e-stop; the notice contains this name. Raises
        RequestRefused for a release while the robot's button is held.
        """
        return self._safety.estop(active, now, by=by)

    def reset_odometry(self, now: float) -> None:
        """Move the origin of the odometry frame to the robot's current pose.

        A goal of ``cmd_pose`` in the old frame is dropped. Raises RequestRefused while the board is
        silent or the port is closed.
        """
        self.inbound.process(now)
        if reason := self.interlocks.why_not_reset_odometry(now):
            raise RequestRefused(f"odometry not reset: {reason}")
        self._board.reset_odometry()
        self._reporter.events += self._odometry.reset(now)
        self._reporter.notify(self._commanding.check_goal([], now))

    @property
    def board(self) -> Board:
        """Board of this session. The ROS interfaces of this kind of board use it directly."""
        return self._board

    # Outputs

    def take_output(self, now: float) -> Packets:
        """Return the packets to write now, and regard them as written."""
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
        """Return and clear the events since the last call, in order."""
        return self._reporter.take()

    def _command(self, wish: Command, now: float) -> None:
        motion, expires_at = wish
        if reason := self.interlocks.why_not_drive(motion, now):
            raise CommandRefused(f"motion command refused: {reason}")
        self._commands.command(motion, now, expires_at=expires_at)
        if not motion.is_zero and self._calibration.wake_at < math.inf:
            self._calibration.give_up(
                "a motion command arrived; stop sending commands, then call again"
            )
