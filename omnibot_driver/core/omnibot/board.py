# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The OmniBot board as a ``core.board.Board``: its bytes as readings, wishes as its bytes.

Source: the board's manual ver. 0.3. Units on the wire: deltas 0.1 mm and 0.1 mrad per 40 ms;
poses mm and mrad; velocity and wheel commands in the firmware's own unit, which
``linear_scale`` and ``angular_scale`` translate (70 and 500 are the vendor's, found by hand).
Commanded poses are taken to have the unit of those that are sent; nobody has verified it.
"""

import math
from dataclasses import dataclass, field
from typing import Final, Literal

from omnibot_driver.core.board import (
    BoardFigures,
    DisplacementReading,
    Edge,
    ImuReading,
    Mode,
    PausedReading,
    PoseReading,
    Reading,
    Vector3,
)
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.imu import ACCEL_COUNTS_PER_G, ImuScale, gravity_advice
from omnibot_driver.core.kinematics import BodyTwist, OmniKinematics
from omnibot_driver.core.limits import MAX_WORD, slow, to_nearest
from omnibot_driver.core.omnibot import frames
from omnibot_driver.core.omnibot.decoder import DecoderStatistics, FrameDecoder
from omnibot_driver.core.omnibot.frames import (
    ByteOrder,
    DeltaFrame,
    Frame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    Words,
)
from omnibot_driver.core.omnibot.modes import Happening, ModeTracker
from omnibot_driver.core.omnibot.rhythm import LENGTH, Rhythm
from omnibot_driver.core.omnibot.sequence import Sequence
from omnibot_driver.core.omnibot.suspicion import Suspicion
from omnibot_driver.core.se2 import Pose

TICK_S: Final = 0.01
RATES_HZ: Final = (100.0, 25.0, 5.0)
NOMINAL_BYTES_PER_S: Final = 1700
DELTA_LSB: Final = 1e-4
"""m, m, rad."""
POSE_LSB_M: Final = 1e-3
POSE_LSB_RAD: Final = 1e-3

STOP: Final = frames.encode(frames.STOP)
EMERGENCY_STOP: Final = frames.encode(frames.EMERGENCY_STOP)
WAKE: Final = bytes(8)
"""More than the three bytes a booting board swallows, and enough to end any half command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OmniBotSettings:
    """What cannot be known from the wire.

    ``baudrate``: at ten bits to the byte; ``linear_scale``: LSB per m/s; ``angular_scale``: LSB per
    rad/s; ``position_scale`` and ``heading_scale``: LSB per m and rad of a commanded pose;
    ``delta_frame``: whether deltas are differences of positions in the board's earth frame, motion
    along its own axes, or (older firmware) encoder counts of the wheels A, B, C.
    """

    baudrate: int = 115200
    linear_scale: float = 70.0
    angular_scale: float = 500.0
    position_scale: float = 1000.0
    heading_scale: float = 1000.0
    wheel_radius_m: float = 0.029
    base_radius_m: float = 0.143
    counts_per_revolution: int = 1560
    delta_frame: Literal["earth", "body", "wheel_counts"] = "earth"
    pose_byte_order: ByteOrder = "big"
    imu: ImuScale = field(default_factory=ImuScale)


class OmniBot:
    """One board on one line. ``settings`` may be replaced at any time."""

    def __init__(self, settings: OmniBotSettings) -> None:
        self.settings = settings
        self._sequence = Sequence()
        self._suspicion = Suspicion()
        self._statistics = DecoderStatistics()
        self._saturated = 0
        self.connect()

    @property
    def settings(self) -> OmniBotSettings:
        """What cannot be known from the wire."""
        return self._settings

    @settings.setter
    def settings(self, settings: OmniBotSettings) -> None:
        self._settings = settings
        byte_s = 10 / settings.baudrate
        self._nothing_begun = Edge(0, 0.0, (frames.IMU_LENGTH - 1) * byte_s)

    def connect(self) -> None:
        """A new line: a new decoder, and no belief but in the board's counters."""
        self._decoder = FrameDecoder(
            self._settings.pose_byte_order, ACCEL_COUNTS_PER_G[self._settings.imu.accel_range_g]
        )
        self._decoder.statistics = self._statistics
        self._modes = ModeTracker()
        self._rhythm = Rhythm()
        self._sequence.reconnect()
        self._paused_count: int | None = None
        self._imus = 0
        self._alone = self._most_alone = 0
        """IMU frames that came alone and were not told on, and how many may be."""
        self._heard_s = -math.inf

    @property
    def mode(self) -> Mode:
        """The present belief."""
        return self._modes.mode

    @property
    def tick_s(self) -> float:
        """Of the control loop, which samples the IMU."""
        return TICK_S

    @property
    def edge(self) -> Edge | None:
        """By the IMU frame in hand, whole or begun, and the bytes after it."""
        if self._decoder.at_rest:
            return self._nothing_begun
        begun = self._decoder.begun
        if begun is None:
            return None
        byte_s = 10 / self._settings.baudrate
        ahead, after = 0, len(begun)
        if begun[:2] == frames.IMU_HEADER:
            ahead, after = 1, len(begun) - frames.IMU_LENGTH
            if after < 0:
                return Edge(1, -after * byte_s, (-after - 1) * byte_s, cut=True)
        elif not self._decoder.fresh:
            return None
        return Edge(ahead, 0.0, (frames.IMU_LENGTH - 1 - after) * byte_s)

    @property
    def figures(self) -> BoardFigures:
        """Over all connections."""
        return BoardFigures(
            rates_hz=RATES_HZ,
            faults=self._statistics.faults,
            discarded_bytes=self._statistics.discarded_bytes,
            saturated=self._saturated,
        )

    def gravity_advice(self, gravity_mps2: float) -> str:
        """By the accelerometer's range."""
        return gravity_advice(gravity_mps2, self._settings.imu.accel_range_g)

    @property
    def advice(self) -> str | None:
        """Which parameter is set wrong, by what the board sends."""
        return self._suspicion.advice

    def receive(self, data: bytes, now: float) -> list[Reading]:
        """The readings that these bytes complete, in the order of the line."""
        if self._alone < self._most_alone and (frame := self._decoder.take_lone(data, now)):
            self._alone += 1
            self._heard_s = now
            return [self._imu_reading(frame)]
        return self._read_all(self._decoder.feed(data, now), now)

    def flush(self, now: float) -> list[Reading]:
        """The line is closed: what was held is all there will be."""
        return self._read_all(self._decoder.flush(now), now)

    def silence(self) -> None:
        """Nothing was understood for so long that the mode is unknown again."""
        self._apply(Happening.HEARD_NOTHING)

    def wake(self) -> bytes:
        """Eight zero bytes and Stop."""
        return WAKE + STOP

    def start(self) -> bytes:
        """S."""
        self._apply(Happening.SENT_START)
        return frames.FORCE_START

    def pause(self) -> bytes:
        """Stop, then P: a toggle, so refused unless the board is known to run."""
        self._apply(Happening.SENT_PAUSE)
        return STOP + frames.TOGGLE_PAUSE

    def force_pause(self) -> bytes:
        """Stop, S, P: S makes it run in any case, so that the toggle has one outcome."""
        return STOP + frames.FORCE_START + frames.TOGGLE_PAUSE

    def reset(self) -> bytes:
        """Stop, then R; zeros first where the board may not be listening yet."""
        wake = b"" if self.mode.running else WAKE
        self._apply(Happening.SENT_RESET)
        return wake + STOP + frames.RESET

    def stop(self) -> bytes:
        """The manual's Stop, which stands still whatever the board's control switch says."""
        return STOP

    def emergency_stop(self) -> bytes:
        """The manual's E-stop."""
        return EMERGENCY_STOP

    def velocity(self, twist: BodyTwist) -> bytes:
        """Base vector control; Stop when it rounds to nothing."""
        settings = self._settings
        linear, angular = settings.linear_scale, settings.angular_scale
        counts = (twist.vx_mps * linear, twist.vy_mps * linear, twist.yaw_rate_radps * angular)
        return self._drive(frames.VELOCITY_MODE, counts)

    def wheels(self, rates_radps: Vector3) -> bytes:
        """Independent wheel drive in rad/s: the unit on the wire is that of a rim speed."""
        unit = self._settings.linear_scale * self._settings.wheel_radius_m
        a, b, c = rates_radps
        return self._drive(frames.WHEEL_MODE, (a * unit, b * unit, c * unit))

    def drive_to(self, pose: Pose) -> bytes:
        """Base vector control with the switch on position; the origin is a pose like any other."""
        position, heading = self._settings.position_scale, self._settings.heading_scale
        counts = (pose.x_m * position, pose.y_m * position, pose.yaw_rad * heading)
        if not all(abs(count) < MAX_WORD + 0.5 for count in counts):
            raise CommandRefused(
                f"cmd_pose refused: in the board's own frame it is x {pose.x_m:.2f} m,"
                f" y {pose.y_m:.2f} m, yaw {pose.yaw_rad:.2f} rad, and no more than"
                f" {MAX_WORD / position:.2f} m and {MAX_WORD / heading:.2f} rad can be said:"
                " ~/reset begins a new frame where the robot stands"
            )
        x, y, yaw = map(to_nearest, counts)
        return frames.command(frames.VELOCITY_MODE, x, y, yaw)

    def _drive(self, mode: int, counts: Vector3) -> bytes:
        a, b, c = counts
        if abs(a) > MAX_WORD or abs(b) > MAX_WORD or abs(c) > MAX_WORD:
            self._saturated += 1
            a, b, c = slow(counts, MAX_WORD)
        x, y, z = to_nearest(a), to_nearest(b), to_nearest(c)
        return frames.command(mode, x, y, z) if x or y or z else STOP

    def _read_all(self, found: list[Frame], now: float) -> list[Reading]:
        """What a read brings at once did not come at once: each frame has a time of its own."""
        self._catch_up()
        skipped, before_s, self._heard_s = self._decoder.skipped, self._heard_s, now
        lengths = [LENGTH.get(type(frame), 0) for frame in found]
        left = sum(skipped) + sum(lengths)
        readings = []
        for frame, length, before in zip(found, lengths, skipped, strict=True):
            left -= before + length
            came_s = max(before_s, now - left / NOMINAL_BYTES_PER_S)
            readings.append(self._read(frame, came_s, before))
        usual = self._paused_count is None and not any(skipped)
        self._most_alone = self._modes.imus_to_come - 1 if usual else 0
        return readings

    def _catch_up(self) -> None:
        """Modes and rhythm are told of the frames that came alone."""
        alone, self._alone = self._alone, 0
        if alone:
            self._modes.hear_imus(alone)
            self._rhythm.hear_imus(alone)
            self._imus += alone

    def _apply(self, happening: Happening) -> None:
        self._catch_up()
        self._modes.apply(happening)

    def _imu_reading(self, frame: ImuFrame, lost: int = 0) -> ImuReading:
        scale = self._settings.imu
        return ImuReading(
            scale.specific_force(frame.accel), scale.angular_velocity(frame.gyro), lost
        )

    def _read(self, frame: Frame, now: float, skipped: int = 0) -> Reading:
        self._modes.hear(frame)
        paused_count, self._paused_count = self._paused_count, None
        match frame:
            case ImuFrame():
                self._imus += 1
                return self._imu_reading(frame, self._rhythm.hear(ImuFrame, skipped))
            case DeltaFrame():
                self._rhythm.hear(DeltaFrame, skipped)
                return self._displacement(frame, now)
            case PoseFrame(x, y, theta, seq):
                self._rhythm.hear(PoseFrame, skipped)
                step = self._sequence.pose(seq, now)
                pose = PoseReading(
                    x * POSE_LSB_M,
                    y * POSE_LSB_M,
                    theta * POSE_LSB_RAD,
                    lost=step.lost,
                    restarted=step.restarted,
                )
                self._suspicion.posed(frame, pose, self._settings.pose_byte_order)
                return pose
            case PausedFrame(count):
                self._paused_count = count
                self._sequence.pause()
                self._rhythm = Rhythm()
                continues = paused_count is not None and count == (paused_count + 1) % 256
                return PausedReading(continues)

    def _displacement(self, frame: DeltaFrame, now: float) -> DisplacementReading:
        step = self._sequence.delta(frame.seq, now, imus=self._imus)
        self._imus = 0
        dx, dy, dyaw = frame.dx * DELTA_LSB, frame.dy * DELTA_LSB, frame.dtheta * DELTA_LSB
        if self._settings.delta_frame == "wheel_counts":
            dx, dy, dyaw = self._rolled((frame.dx, frame.dy, frame.dtheta))
        displacement = DisplacementReading(
            dx,
            dy,
            dyaw,
            frame="earth" if self._settings.delta_frame == "earth" else "body",
            duration_s=step.duration_s,
            lost=step.lost,
            restarted=step.restarted,
        )
        self._suspicion.displaced(displacement)
        return displacement

    def _rolled(self, counts: Words) -> Vector3:
        """The body's displacement from the wheels' counts (manual, "Odometry equation")."""
        settings = self._settings
        a, b, c = (count * math.tau / settings.counts_per_revolution for count in counts)
        wheels = OmniKinematics(settings.wheel_radius_m, settings.base_radius_m)
        rolled = wheels.body_twist((a, b, c))
        return rolled.vx_mps, rolled.vy_mps, rolled.yaw_rate_radps
