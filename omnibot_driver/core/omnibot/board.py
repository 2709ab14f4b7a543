# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The OmniBot board as a ``core.board.Board``: its bytes as readings, wishes as its bytes.

Source: the board's manual ver. 0.3. Velocity and wheel commands are in the firmware's own unit,
which ``linear_scale`` and ``angular_scale`` translate (70 and 500 are the vendor's, found by hand).
Commanded poses are taken to have the unit of those that are sent, mm and mrad; nobody has verified
it. What the board says is told in ``translation``.
"""

from collections.abc import Sequence
from typing import Final

from omnibot_driver.core.board import BoardFigures, Mode, Reading, SampleBoundary, Vector3
from omnibot_driver.core.commands.limits import MAX_WORD, slow, to_nearest
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.omni import OmniKinematics
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.scale import ACCEL_COUNTS_PER_G, gravity_advice
from omnibot_driver.core.omnibot import frames
from omnibot_driver.core.omnibot.decoder import DecoderStatistics, FrameDecoder
from omnibot_driver.core.omnibot.modes import Happening
from omnibot_driver.core.omnibot.outbound import (
    begins_with_a_letter,
    harmless,
    motion,
    transmission,
)
from omnibot_driver.core.omnibot.schedule import TICK_S, Schedule
from omnibot_driver.core.omnibot.settings import OmniBotSettings
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits

_STOP: Final = frames.encode(frames.STOP)
STOP: Final = transmission(_STOP)
EMERGENCY_STOP: Final = transmission(frames.encode(frames.EMERGENCY_STOP))
TRAITS: Final = Traits(
    imu=True,
    authorities=frozenset(Authority),
    requests=frozenset(Request),
    wheels=("A", "B", "C"),
    unheard_s=0.3,  # it may be restarting
    silence_s=1.5,  # it says something at least once a second
)


class OmniBot:
    """One board on one line. ``settings`` may be replaced at any time, but not the delta period."""

    traits = TRAITS

    def __init__(self, settings: OmniBotSettings) -> None:
        self._schedule = Schedule(settings.delta_period_s)
        self._translation = Translation(settings)
        self._statistics = DecoderStatistics()
        self._saturated = 0
        self.settings = settings
        self.connect()

    @property
    def settings(self) -> OmniBotSettings:
        """What cannot be known from the wire."""
        return self._settings

    @settings.setter
    def settings(self, settings: OmniBotSettings) -> None:
        self._settings = self._translation.settings = settings
        byte_s = 10 / settings.baudrate
        self._nothing_begun = SampleBoundary(0, 0.0, (frames.IMU_LENGTH - 1) * byte_s)

    def connect(self) -> None:
        """A new line: a new decoder, and no belief but in the board's counters."""
        self._decoder = FrameDecoder(
            self._settings.pose_byte_order,
            ACCEL_COUNTS_PER_G[self._settings.imu.accel_range_g],
            10 / self._settings.baudrate,
            self._schedule,
        )
        self._decoder.statistics = self._statistics
        self._translation.connect()
        self._modes = self._translation.modes

    @property
    def mode(self) -> Mode:
        """The present belief."""
        return self._modes.mode

    @property
    def tick_s(self) -> float:
        """Of the control loop, which samples the IMU."""
        return TICK_S

    @property
    def edge(self) -> SampleBoundary | None:
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
                return SampleBoundary(1, -after * byte_s, (-after - 1) * byte_s, cut=True)
        elif not self._decoder.fresh:
            return None
        return SampleBoundary(ahead, 0.0, (frames.IMU_LENGTH - 1 - after) * byte_s)

    @property
    def figures(self) -> BoardFigures:
        """Over all connections."""
        return BoardFigures(
            rates_hz=self._schedule.rates_hz,
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
        return self._translation.suspicion.advice

    def receive(self, data: bytes, now: float) -> list[Reading]:
        """The readings that these bytes complete, in the order of the line."""
        if self._translation.lone_to_come and (frame := self._decoder.take_single(data, now)):
            return [self._translation.lone(frame, now)]
        found = self._decoder.feed(data, now)
        return self._translation.readings(found, self._decoder.skipped, now)

    def flush(self, now: float) -> list[Reading]:
        """The line is closed: what was held is all there will be."""
        found = self._decoder.flush(now)
        return self._translation.readings(found, self._decoder.skipped, now)

    def silence(self) -> None:
        """Nothing was understood for so long that the mode is unknown again."""
        self._translation.apply(Happening.HEARD_NOTHING)

    def wake(self) -> bytes:
        """Stop; the zeros before it wake the board."""
        return STOP

    def start(self) -> bytes:
        """S."""
        self._translation.apply(Happening.SENT_START)
        return transmission(frames.FORCE_START)

    def pause(self) -> bytes:
        """Stop, then P: a toggle, so refused unless the board is known to run."""
        self._translation.apply(Happening.SENT_PAUSE)
        return transmission(_STOP, frames.TOGGLE_PAUSE)

    def force_pause(self) -> bytes:
        """Stop, S, P: S makes it run in any case, so that the toggle has one outcome."""
        return transmission(_STOP, frames.FORCE_START, frames.TOGGLE_PAUSE)

    def reset(self) -> bytes:
        """Stop, then R."""
        self._translation.apply(Happening.SENT_RESET)
        return transmission(_STOP, frames.RESET)

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

    def wheels(self, rates_radps: Sequence[float]) -> bytes:
        """Independent wheel drive in rad/s: the unit on the wire is that of a rim speed."""
        unit = self._settings.linear_scale * self._settings.wheel_radius_m
        a, b, c = rates_radps
        return self._drive(frames.WHEEL_MODE, (a * unit, b * unit, c * unit))

    def meaning(self, data: bytes) -> BodyTwist:
        """By the mode and the words of the last command frame."""
        settings = self._settings
        mode, a, b, c = frames.last_command(data)
        linear = settings.linear_scale
        if mode == frames.VELOCITY_MODE:
            return BodyTwist(a / linear, b / linear, c / settings.angular_scale)
        if mode == frames.WHEEL_MODE:
            rims = OmniKinematics(wheel_radius_m=1.0, base_radius_m=settings.base_radius_m)
            return rims.body_twist((a / linear, b / linear, c / linear))
        return BodyTwist(0.0, 0.0, 0.0)

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
        if any(begins_with_a_letter(to_nearest(count)) for count in counts):
            raise CommandRefused(
                f"cmd_pose refused: in the board's own frame it is x {pose.x_m:.2f} m,"
                f" y {pose.y_m:.2f} m, yaw {pose.yaw_rad:.2f} rad, and a damaged line could turn"
                " one of these numbers into a command to start, pause or reset the board: choose"
                " another goal, or call ~/reset, which begins a new frame where the robot stands"
            )
        return motion(frames.command(frames.VELOCITY_MODE, *harmless(counts)))

    def _drive(self, mode: int, counts: Vector3) -> bytes:
        a, b, c = counts
        if abs(a) > MAX_WORD or abs(b) > MAX_WORD or abs(c) > MAX_WORD:
            self._saturated += 1
            a, b, c = slow(counts, MAX_WORD)
        words = harmless((a, b, c))
        return motion(frames.command(mode, *words)) if any(words) else STOP
