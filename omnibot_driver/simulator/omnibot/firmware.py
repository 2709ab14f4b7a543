# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The board's firmware: its modes, the 100 Hz control loop, and when each frame is sent.

Equal settings and input give equal output. Comments mark assumptions. This module must not know
ports or real time.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from enum import Enum

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.omnibot import targets
from omnibot_driver.simulator.omnibot.chassis import PlanarPose, Wheels
from omnibot_driver.simulator.omnibot.imu import Mpu6050
from omnibot_driver.simulator.omnibot.logs import CommandKind, ReceivedCommand, SentFrame
from omnibot_driver.simulator.omnibot.motors import TICK_S, WheelController
from omnibot_driver.simulator.omnibot.odometry import Odometry
from omnibot_driver.simulator.omnibot.output import Output
from omnibot_driver.simulator.omnibot.position import approach, commanded_pose
from omnibot_driver.simulator.omnibot.receivers import CommandReceiver
from omnibot_driver.simulator.omnibot.settings import BoardPose, BoardSettings
from omnibot_driver.simulator.omnibot.wire import (
    BYTE_S,
    ControlFrame,
    ControlMode,
    StateLetter,
    imu_frame,
)
from omnibot_driver.simulator.omnibot.world import Force, Held, TruePose, Twist, World

CHANNELS = (Channel(),)
"""The board's channels: one serial line."""

COMMAND_LOG = 100_000
SENT_LOG = 10_000
RECEIVED_LOG_BYTES = 1_000_000

_ALL_ZERO = (0.0, 0.0, 0.0)
_IDEAL = BoardSettings()


class BoardMode(Enum):
    """The states of the manual's Operation State Machine, and the boot before them."""

    BOOTING = "booting"
    PAUSED = "paused"
    NOMINAL = "nominal"
    IMU_ONLY = "imu_only"


_RUNNING = (BoardMode.NOMINAL, BoardMode.IMU_ONLY)

_FRAME_KINDS: dict[int, CommandKind] = {
    ControlMode.VELOCITY: "velocity",
    ControlMode.WHEELS: "wheels",
    ControlMode.ESTOP: "estop",
}
_LETTER_KINDS: dict[StateLetter, CommandKind] = {
    StateLetter.START: "start",
    StateLetter.PAUSE: "pause",
    StateLetter.RESET: "reset",
}


class SimulatedBoard:
    """An OmniBot board with its robot.

    * ``tick``: number of control ticks of 10 ms since construction.
    * ``commands``: commands that the board obeyed, newest last.
    * ``sent``: frames and texts that the board sent, newest last.
    * ``received``: all bytes that reached the board; above a million, the older half is discarded.
    """

    channels = CHANNELS
    tick_s = TICK_S

    _goal: PlanarPose | None
    _targets: Wheels
    _pwm: Wheels

    def __init__(self, settings: BoardSettings = _IDEAL) -> None:
        self.settings = settings
        self.tick = 0
        self.commands: deque[ReceivedCommand] = deque(maxlen=COMMAND_LOG)
        self.sent: deque[SentFrame] = deque(maxlen=SENT_LOG)
        self.received = bytearray()
        self._world = World(settings)
        self._imu = Mpu6050(settings)
        self._power_up(settings.initial_pose)
        if settings.running:
            self._receiver = CommandReceiver(settings.receiver, awake=True)
            self._run()

    def reboot(self) -> None:
        """Restart the board, as a power cycle or an R does; the robot keeps its true pose."""
        self._power_up(BoardPose())

    def _power_up(self, pose: BoardPose) -> None:
        self.mode = BoardMode.BOOTING
        self.estopped = False
        self._boot_ticks_left = max(1, round(self.settings.boot_time_s / TICK_S))
        self._ticks_since_boot = 0
        self._receiver = CommandReceiver(self.settings.receiver)
        self._encoders = self._world.encoders
        self._odometry = Odometry(self.settings, pose)
        self._output = Output(self.settings)
        self._motors_off()

    @property
    def truth(self) -> TruePose:
        """True pose and twist of the robot."""
        return self._world.truth

    @property
    def rim_speeds_mps(self) -> Wheels:
        """True rim speeds of wheels A, B, C, in m/s."""
        return self._world.rim_speeds_mps

    @property
    def odometry(self) -> BoardPose:
        """The board's own pose in mm and mrad, as the board sends it at 5 Hz."""
        return self._odometry.reported

    def hold(self, *, roll_rad: float = 0.0, pitch_rad: float = 0.0, yaw_rate: float = 0.0) -> None:
        """Hold the robot by hand: tilt it by angles in rad, and turn it left at a rate in rad/s.

        Only the IMU measures this motion; the true pose does not change.
        """
        self._world.held = Held(roll_rad, pitch_rad, yaw_rate)

    def push(self, x_pwm: float = 0.0, y_pwm: float = 0.0, turning_pwm: float = 0.0) -> None:
        """Push the robot along its own axes, and turn it to the left, from now on.

        The arguments are a force and a torque in PWM steps, which are added to the efforts of the
        motors.
        """
        self._world.force = Force(x_pwm, y_pwm, turning_pwm)

    def grip(self, vx_mps: float = 0.0, vy_mps: float = 0.0, yaw_rate: float = 0.0) -> None:
        """Force this twist on the robot against its motors. A zero twist holds the robot."""
        self._world.gripped = Twist(vx_mps, vy_mps, yaw_rate)

    def let_go(self) -> None:
        """Release the robot from ``grip``."""
        self._world.gripped = None

    @property
    def driven(self) -> bool:
        """Whether the last command makes the motors turn."""
        return self._goal is not None or self._targets != _ALL_ZERO

    @property
    def facts(self) -> Mapping[str, object]:
        """Facts that the simulator's console prints."""
        return {
            **asdict(self.truth),
            "mode": self.mode.value,
            "estopped": self.estopped,
            "odometry": asdict(self.odometry),
            "tick": self.tick,
        }

    def receive(self, data: bytes, at_s: float | None = None, channel: int = 0) -> None:
        """Receive bytes, in chunks of any size. Each command takes effect at once.

        ``at_s``: arrival of the first byte, in s; default: the last tick. ``channel``: ignored.
        """
        self.received += data
        if len(self.received) > RECEIVED_LOG_BYTES:
            del self.received[: len(self.received) // 2]
        arrives_s = self.tick * TICK_S if at_s is None else at_s
        for byte in data:
            if self.mode is BoardMode.BOOTING:
                self._receiver.boot()
            else:
                running = self.mode in _RUNNING
                for command in self._receiver.feed(byte, arrives_s, control_frames=running):
                    if isinstance(command, ControlFrame):
                        self._obey_frame(command)
                    else:
                        self._obey_letter(command)
            arrives_s += BYTE_S

    def step(self) -> bytes:
        """Advance by one tick of 10 ms; return the bytes sent in this tick."""
        self.tick += 1
        self._world.advance(self._pwm)
        if self.mode is BoardMode.BOOTING:
            self._encoders = self._world.encoders
            self._boot_ticks_left -= 1
            if self._boot_ticks_left:
                return b""
            self._pause()
        else:
            # Assumed: the output periods count from the end of the boot, and the loop also runs
            # while paused.
            self._ticks_since_boot += 1
            self._control()
        if self.mode is BoardMode.PAUSED:
            sent = self._output.text()
        else:
            sent = [imu_frame(*self._imu.read(self._world))]
            if self.mode is BoardMode.NOMINAL:
                sent += self._output.odometry_frames(self._ticks_since_boot, self._odometry)
        for data in sent:
            self.sent.append(SentFrame(self.tick, data))
        return b"".join(sent)

    def advance(self) -> list[Packet]:
        """Advance by one tick. Return one packet with the sent bytes, or no packet, as a list."""
        data = self.step()
        return [(0, data)] if data else []

    # Commands

    def _obey_letter(self, letter: StateLetter) -> None:
        self.commands.append(ReceivedCommand(self.tick, _LETTER_KINDS[letter]))
        paused = self.mode is BoardMode.PAUSED
        if letter is StateLetter.RESET:
            self.reboot()
        elif paused:
            self._run()
        elif letter is StateLetter.PAUSE:
            self._pause()

    def _obey_frame(self, frame: ControlFrame) -> None:
        # Assumed: a frame whose mode the manual does not name is consumed and ignored.
        kind = _FRAME_KINDS.get(frame.mode)
        if kind is None or (kind == "estop" and not self.settings.obeys_estop):
            return
        if kind == "estop":
            self.estopped = True
            self._motors_off()
        elif self.estopped and self.settings.estop_latches:
            return
        else:
            self.estopped = False
            self._goal = None
            if kind == "wheels":
                self._targets = targets.from_wheel_words(frame.values, self.settings)
            elif self.settings.control == "velocity":
                self._targets = targets.from_velocity_words(frame.values, self.settings)
            else:
                kind = "pose"
                self._goal = commanded_pose(frame.values, self.settings)
        self.commands.append(ReceivedCommand(self.tick, kind, frame.values))

    def _run(self) -> None:
        self.mode = BoardMode.IMU_ONLY if self.settings.imu_only else BoardMode.NOMINAL

    def _pause(self) -> None:
        self.mode = BoardMode.PAUSED
        # Assumed: the number in the text starts from zero at each pause.
        self._output.pause()
        self._motors_off()

    # Assumed for pauses and emergency stops: friction stops the wheels within 0.3 s.
    def _motors_off(self) -> None:
        self._goal = None
        self._targets = _ALL_ZERO
        gains = self.settings.wheel_gains
        self._controllers = (WheelController(gains), WheelController(gains), WheelController(gains))
        self._pwm = _ALL_ZERO

    # Control

    def _control(self) -> None:
        """Run one pass of the 100 Hz control loop (manual, Odometry equation and Wheel control)."""
        old_a, old_b, old_c = self._encoders
        self._encoders = new_a, new_b, new_c = self._world.encoders
        a, b, c = turned = new_a - old_a, new_b - old_b, new_c - old_c
        self._odometry.integrate(turned)
        if self._goal is not None:
            twist = approach(self._odometry.pose, self._goal)
            self._targets = targets.from_twist(twist, self.settings)
        if self.mode in _RUNNING and not self.estopped:
            controller_a, controller_b, controller_c = self._controllers
            target_a, target_b, target_c = self._targets
            self._pwm = (
                controller_a.update(target_a, a),
                controller_b.update(target_b, b),
                controller_c.update(target_c, c),
            )
