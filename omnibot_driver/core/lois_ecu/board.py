# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Adapter that makes a LOIS ECU a ``Board`` of the driver; ``LoisConversation`` does the work.

Between two tick reports of the board, the adapter predicts the odometry.
"""

import math

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.orders import Drive, EmergencyStop, GoTo, Order, TurnWheels
from omnibot_driver.core.commands.set_point_stream import SetpointStream
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.messages import (
    EStopButton,
    RecordKind,
    SetLed,
    TerminalLine,
)
from omnibot_driver.core.lois_ecu.readings import LoisReading
from omnibot_driver.core.lois_ecu.repeated_reset import RESETS, RepeatedReset
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.traits import TRAITS
from omnibot_driver.core.packets import NO_PACKETS, Packets, joined, packed
from omnibot_driver.core.readings import (
    NOTHING_MEASURED,
    DisplacementReading,
    EStopButtonReading,
    ExtraReading,
    OdometryReading,
    Reading,
)


class LoisEcuBoard(Board):
    """A robot's LOIS ECU. ``settings`` may be replaced at any time."""

    traits = TRAITS

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._ecu = LoisConversation(settings)
        self._reset = RepeatedReset(self._ecu)
        self._proof = StopProof(TRAITS.stands_after_s)
        self._once: Packets = NO_PACKETS
        self._rolled = Pose()
        self._leaving = False
        self._odometry_at = -math.inf
        self._sensor_speaks = False  # lines instead of ticks, in a terminal mode

    @property
    def settings(self) -> LoisEcuSettings:
        """Settings of the board and the robot, which the board does not report."""
        return self._ecu.settings

    @settings.setter
    def settings(self, settings: LoisEcuSettings) -> None:
        if settings != self._ecu.settings:
            self._ecu.settings = settings
            self._reset.configure(settings.ticks_per_revolution)

    @property
    def mode(self) -> Mode:
        """The mode: nominal while reports arrive, unknown otherwise."""
        return self._ecu.mode

    @property
    def figures(self) -> BoardFigures:
        """Counters and rates for diagnostics. The counters continue after a reconnection."""
        return self._ecu.figures

    @property
    def advice(self) -> str | None:
        """Advice on settings that are missing or contradict the received data, or None."""
        return self._ecu.advice

    @property
    def reset_refusal(self) -> str:
        """Reason why a reset is refused; empty if a reset is allowed.

        In a terminal mode, the board passes on the data of a device and sends no ticks, so a reset
        could not be confirmed.
        """
        return self._ecu.reset_refusal

    @property
    def shows_standstill(self) -> bool:
        """Whether unchanged ticks would show that both wheels are at rest.

        The public firmware counts ticks of a wheel only while its RPM target is positive.
        """
        return self._ecu.translation.odometry.counting

    # Inbound

    def connect(self) -> None:
        """Begin a new connection. The settings are then written to the board again."""
        self._ecu.connect()
        self._once = NO_PACKETS
        self._odometry_at, self._sensor_speaks = -math.inf, False
        self._reset.connect()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Decode ``data``, and return the readings that its bytes complete.

        If ``mode`` changes and no reading is complete, return the placeholder ``NOTHING_MEASURED``.
        """
        before = self.mode
        readings = self._read(self._ecu.receive(data, now))
        if not readings and self.mode is not before:
            return [NOTHING_MEASURED]
        return readings

    def flush(self, now: float) -> list[Reading]:
        """Return the readings that were held back until now. Called when the port closes."""
        return self._read(self._ecu.flush(now))

    def silence(self) -> None:
        """Set ``mode`` to unknown, because the board has been silent for too long."""
        self._ecu.silence()

    def elapse(self, now: float) -> list[Reading]:
        """Return readings that have been held back long enough, and odometry if it is due."""
        readings: list[Reading] = []
        if now >= self._ecu.held_until:
            readings += self.receive(b"", now)
        if now >= self._odometry_due_at:
            period_s = 1.0 / self.settings.odom_rate_hz
            next_at = self._odometry_at + period_s
            self._odometry_at = next_at if next_at > now else now + period_s
            if (fused := self._ecu.predicted(now)) is not None:
                readings.append(self._told(fused))
        return readings

    @property
    def _odometry_due_at(self) -> float:
        """Time when the next odometry is due.

        It is infinity while the board does not report motion.
        """
        silent = self._sensor_speaks or self.mode is not Mode.NOMINAL
        return math.inf if silent else self._odometry_at

    def reset_odometry(self) -> None:
        """Move the origin of the odometry frame to the robot's present pose."""
        self._ecu.reset_odometry()

    def _read(self, found: list[LoisReading]) -> list[Reading]:
        readings: list[Reading] = []
        for reading in found:
            match reading:
                case DisplacementReading():
                    readings.append(reading)
                case FusedOdometry():
                    self._sensor_speaks = False
                    self._rolled = self._rolled + self._tangent(reading)
                case EStopButton(pressed):
                    readings.append(EStopButtonReading(pressed))
                case _:
                    self._sensor_speaks |= isinstance(reading, TerminalLine)
                    readings.append(ExtraReading(reading))
        return readings + self._reset.readings()

    def _tangent(self, fused: FusedOdometry) -> Pose:
        """Return how far the robot moved forward (m) and turned (rad) since the last estimate."""
        left_m, right_m = fused.wheel_ways_m
        sign = -1.0 if self.settings.inverted else 1.0
        return Pose((left_m + right_m) / 2, 0.0, sign * (right_m - left_m) / self.settings.track_m)

    def _told(self, fused: FusedOdometry) -> OdometryReading:
        return OdometryReading(
            fused.stamp_s,
            fused.pose,
            fused.twist,
            fused.covariance,
            fused.twist_covariance,
            self._rolled + self._tangent(fused),
            None if fused.blind else fused.twist,
        )

    # Outbound

    @property
    def wake_at(self) -> float:
        """Time in s at which the caller must call ``due`` and ``elapse`` again."""
        if self._leaving:
            return self._odometry_due_at
        once_at = -math.inf if self._once else math.inf
        return min(self._ecu.wake_at, self._odometry_due_at, once_at, self._reset.again_at_s)

    def leave(self) -> None:
        """Make ``due`` return nothing from now on. So no line follows the driver's last Stop."""
        self._leaving = True

    def due(self, now: float) -> Packets:
        """Return the lines to write now.

        They write settings or modes, make requests, repeat a reset, or command RPM 0/0 after a
        Stop.
        """
        if self._leaving:
            return NO_PACKETS
        once, self._once = self._once, NO_PACKETS
        data = self._ecu.due(now, proved=self._proof.proved)
        if now >= self._reset.again_at_s:
            data += self._reset.again(now)
        if data:
            self._ecu.wrote(data, now)
        return packed(data) + once

    def actuator(self, proof: StopProof) -> SetpointStream:
        """Return the object that sends set-points to the board, as RPM or as motor duty."""
        self._proof = proof
        return SetpointStream(self, proof, heard=self._heard)

    def _heard(self, packets: Packets, now: float) -> None:
        self._ecu.wrote(joined(packets), now)
        if self._ecu.driving:
            self._reset.give_up()
        elif self._reset.left == RESETS:
            self._reset.plan(now)

    def encode(self, order: Order) -> Packets:
        """Return the lines that command ``order``.

        Raises CommandRefused for a goal pose, and for any motion in a terminal mode or during a
        change of mode.
        """
        match order:
            case Drive(twist):
                return packed(self._ecu.velocity(twist))
            case TurnWheels(rates_radps):
                return packed(self._ecu.wheels(rates_radps))
            case EmergencyStop():
                return self.emergency_stop()
            case GoTo():
                raise CommandRefused("cmd_pose rejected: this board has no positional control")
        return self.stop()

    def meaning(self, packets: Packets) -> BodyTwist:
        """Return the body velocity that is commanded by the last set-point in ``packets``."""
        return self._ecu.meaning(joined(packets))

    def wake(self) -> Packets:
        """Return Stop. Its first character ``:`` makes the board discard an incomplete line."""
        return self.stop()

    def stop(self) -> Packets:
        """Return the Stop line, which commands duty 0/0."""
        return packed(self._ecu.stop())

    def emergency_stop(self) -> Packets:
        """Return the set-points RPM 0/0, which replace an emergency stop command.

        The board has no such command. In a terminal mode, return nothing.
        """
        return packed(self._ecu.emergency_stop())

    def reset(self) -> Packets:
        """Return Stop and the reset command; return nothing while ``due`` repeats an earlier reset.

        The lines are sent at most ``RESETS`` times, until the reset is proved or given up.
        """
        if self._reset.pending and not self._leaving:
            return NO_PACKETS
        return packed(self._reset.begin())

    def reset_given_up(self) -> None:
        """Record that the driver has given up the reset, so ``due`` must not repeat it."""
        self._reset.give_up()

    # Functions that only this board has

    def set_led(self, on: bool, now: float) -> None:
        """Switch the board's LED on or off.

        The line is sent several times, because lines may be lost.
        """
        self._ecu.say(SetLed(on), now)

    def record(self, kind: RecordKind, samples: int) -> None:
        """Request a record of ``samples`` samples, for example of times between ticks.

        A later reading contains the record, or the reason why there is none. Raises RequestRefused,
        for example for too many samples, or in a terminal mode.
        """
        self._ecu.record(kind, samples)

    def distribute_ball(self) -> None:
        """Make the next ``due`` return the command to drop a ball.

        The command is not repeated, because each repetition would drop another ball.
        """
        self._once += packed(self._ecu.distribute_ball())
