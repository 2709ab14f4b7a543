"""One connection to one board, whole: bytes and wishes in; measurements, answers and bytes out.

The shell around it calls an input, then takes ``take_output`` to the port and ``take_events`` to
whoever listens, and calls ``tick`` when ``wake_at`` has come. Not thread-safe, reads no clock, does
not log: whatever a user should hear of is an event.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.board import (
    Board,
    DisplacementReading,
    ImuReading,
    Mode,
    PausedReading,
    PoseReading,
    Reading,
    Vector3,
)
from omnibot_driver.core.commands import CommandSettings, CommandStream
from omnibot_driver.core.device_clock import DeviceClock
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.kinematics import BodyTwist
from omnibot_driver.core.limits import SpeedLimits, require_finite
from omnibot_driver.core.odometry import Odometry, OdometryEstimate, OdometrySettings
from omnibot_driver.core.se2 import Signs
from omnibot_driver.core.supervisor import Phase, Request, RequestDone, Supervisor

SILENCE_S: Final = 1.5
"""The board says something at least once a second; after this it is not known to be there."""
LOSS_NOTICE_S: Final = 10.0
"""Lost frames are counted and told no more often than this."""
DISCONNECTED: Final = "disconnected"

OnExit = Literal["stop", "pause", "reset"]


@dataclass(frozen=True, slots=True)
class ImuEstimate:
    """At ``stamp_s``: specific force in m/s², angular velocity in rad/s, in the sensor's axes."""

    stamp_s: float
    specific_force: Vector3
    angular_velocity: Vector3


@dataclass(frozen=True, slots=True)
class StateChanged:
    """``Session.state`` or ``Session.estop_active`` is another than before."""


@dataclass(frozen=True, slots=True)
class Notice:
    """Something a user should be told, in a sentence."""

    text: str


Event = ImuEstimate | OdometryEstimate | StateChanged | RequestDone | Notice


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionSettings:
    """What may change while the session runs."""

    limits: SpeedLimits
    commands: CommandSettings
    odometry: OdometrySettings


class Session:
    """``run``: whether the board is to be started whenever it is there; ``axis_signs``: 1 or -1 for
    x, y and yaw where the board's body axes are not REP-103's, for commands and odometry alike.
    """

    def __init__(
        self,
        board: Board,
        settings: SessionSettings,
        *,
        run: bool,
        axis_signs: Signs = (1, 1, 1),
    ) -> None:
        self._board = board
        self._supervisor = Supervisor(board, run=run)
        self._commands = CommandStream(
            settings.commands, stop=board.stop(), emergency_stop=board.emergency_stop()
        )
        self._odometry = Odometry(settings.odometry, axis_signs)
        self._clock = DeviceClock(board.tick_s)
        self._axis_signs = axis_signs
        self._limits = settings.limits
        self._heard_at = self._came_at = -math.inf
        self._silent = False
        self._heading_assumed = False
        self._lost = 0
        self._lost_told_at = -math.inf
        self._events: list[Event] = []
        self._shown = (self.state, self.estop_active)

    # What is so

    @property
    def state(self) -> str:
        """The public name of the link's and the board's state."""
        return DISCONNECTED if self._closed else self._board.mode.value

    @property
    def estop_active(self) -> bool:
        """The driver's own latch."""
        return self._commands.latched

    @property
    def wake_at(self) -> float:
        """When ``tick`` must be called at the latest; infinity when nothing is due."""
        if self._closed:
            return math.inf
        silent_at = math.inf if self._silent else self._heard_at + SILENCE_S
        return min(silent_at, self._supervisor.wake_at, self._commands.wake_at)

    # What happens

    def configure(self, settings: SessionSettings) -> None:
        """New settings, from the next command and frame on."""
        self._limits = settings.limits
        self._commands.settings = settings.commands
        self._odometry.settings = settings.odometry

    def opened(self, now: float) -> None:
        """The port is open."""
        self._board.connect()
        self._commands.discard()
        self._clock.restart()
        self._silent, self._heard_at, self._came_at = False, now, -math.inf
        self._supervisor.opened(now)
        if self.estop_active:
            self._commands.latch(now)

    def closed(self, now: float) -> None:
        """The port is gone."""
        self._take_in(self._board.flush(now), now)
        self._supervisor.closed()
        self._commands.discard()

    def receive(self, data: bytes, now: float) -> None:
        """Bytes came in at ``now``."""
        self._came_at = now
        was_running = self._board.mode.running
        self._take_in(self._board.receive(data, now), now)
        if self._board.mode.running and not was_running:
            self._commands.halt(now)

    def tick(self, now: float) -> None:
        """Time passed."""
        if not self._silent and now - self._heard_at >= SILENCE_S:
            self._silent = True
            self._events.append(Notice(self._why_silent()))
            if self._board.mode is not Mode.UNKNOWN:
                self._board.silence()
                self._clock.restart()
                self._commands.halt(now)
                self._supervisor.heard_nothing(now)
        self._supervisor.tick(now)

    # What is wanted

    def command_twist(self, twist: BodyTwist, now: float) -> None:
        """Drive the body. Raises CommandRefused, and then nothing changes."""
        require_finite("cmd_vel", (twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps))
        self._require_drivable()
        x, y, yaw = self._axis_signs
        limited = self._limits.twist(twist)
        signed = BodyTwist(x * limited.vx_mps, y * limited.vy_mps, yaw * limited.yaw_rate_radps)
        self._commands.command(self._board.velocity(signed), now)

    def command_wheels(self, rates_radps: Sequence[float], now: float) -> None:
        """Turn wheels A, B, C. Raises CommandRefused, and then nothing changes."""
        if len(rates_radps) != 3:
            raise CommandRefused(
                f"wheel_cmd refused: it has {len(rates_radps)} values; send exactly 3,"
                " the rates of wheels A, B, C in rad/s"
            )
        require_finite("wheel_cmd", rates_radps)
        self._require_drivable()
        self._commands.command(self._board.wheels(self._limits.wheels(rates_radps)), now)

    def request(self, request: Request, token: object, now: float) -> None:
        """Start, pause or reset; answered by a RequestDone. Raises RequestRefused at once."""
        self._supervisor.request(request, token, now)
        if request is not Request.START:
            self._commands.discard()

    def estop(self, active: bool, now: float) -> str:
        """Latch or release the e-stop; returns what is so now, in a sentence."""
        if active:
            self._commands.latch(now)
            later = "; the port is not open: the stop is sent as soon as it is"
            return "e-stop latched" + (later if self._closed else "")
        if not self.estop_active:
            return "the e-stop was not latched"
        self._commands.release(now)
        return "e-stop released; the robot stands still until a new command comes"

    def reset_odometry(self) -> None:
        """The odometry frame begins where the robot stands."""
        self._odometry.reset()

    def farewell(self, on_exit: OnExit) -> bytes:
        """The last bytes to write before the port is closed."""
        data = self._board.stop()
        settled = self._supervisor.phase is Phase.SETTLED
        if on_exit == "reset":
            data = self._board.reset()
        elif on_exit == "pause" and settled and self._board.mode.running:
            data = self._board.pause()
        elif on_exit == "pause" and not (settled and self._board.mode is Mode.PAUSED):
            data = self._board.force_pause()
        self._commands.discard()
        return data + (self._board.emergency_stop() if self.estop_active else b"")

    # What comes of it

    def take_output(self, now: float) -> bytes:
        """The bytes to write now; they count as written."""
        if self._closed:
            return b""
        data = self._supervisor.take_output()
        if data:
            self._commands.wrote(data, now)
        return data + self._commands.due(now)

    def take_events(self) -> list[Event]:
        """What happened since the last call, in order."""
        if self._supervisor.answers:
            self._events += self._supervisor.answers
            self._supervisor.answers.clear()
        shown = (self.state, self.estop_active)
        if shown != self._shown:
            self._shown = shown
            self._events.append(StateChanged())
        events, self._events = self._events, []
        return events

    @property
    def _closed(self) -> bool:
        return self._supervisor.phase is Phase.CLOSED

    def _take_in(self, readings: list[Reading], now: float) -> None:
        stamps_s = self._clock.stamps(readings, now, self._board.newest)
        if not readings:
            return
        self._heard_at, self._silent = now, False
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            match reading:
                case ImuReading(force, rate):
                    self._events.append(ImuEstimate(stamp_s, force, rate))
                case DisplacementReading(lost=lost):
                    self._count_lost(lost, now)
                    self._events += self._odometry.displace(reading, stamp_s)
                case PoseReading(lost=lost):
                    self._count_lost(lost, now)
                    self._events += self._odometry.settle(reading)
                case PausedReading(continues):
                    self._commands.discard()
                    self._clock.restart()
                    self._supervisor.heard_paused(now, continues=continues)
        if self._odometry.heading_assumed and not self._heading_assumed:
            self._heading_assumed = True
            self._events.append(
                Notice("the board sends no pose: its heading is assumed to have been 0 at first")
            )
        if self._board.mode.running and not isinstance(readings[-1], PausedReading):
            self._supervisor.heard_data(now)

    def _why_silent(self) -> str:
        if self._came_at > self._heard_at:
            return (
                f"nothing that comes in makes sense for {SILENCE_S:g} s: check the parameter"
                " `baudrate`, the cable, and that it is this board"
            )
        return (
            f"nothing comes from the board for {SILENCE_S:g} s: check its power and the cable,"
            " and that `port` is its port"
        )

    def _count_lost(self, lost: int, now: float) -> None:
        self._lost += lost
        if self._lost and now - self._lost_told_at >= LOSS_NOTICE_S:
            self._events.append(
                Notice(f"{self._lost} odometry frames were lost on the line: check cable and hub")
            )
            self._lost, self._lost_told_at = 0, now

    def _require_drivable(self) -> None:
        phase, mode = self._supervisor.phase, self._board.mode
        if self.estop_active:
            reason = "the e-stop is latched; release it with the service ~/estop (data: false)"
        elif phase is not Phase.SETTLED:
            reason = f"the board is {phase.value}"
        elif not mode.running:
            reason = f"the board is {mode.value}; the service ~/start makes it run"
        else:
            return
        raise CommandRefused(f"motion command refused: {reason}")
