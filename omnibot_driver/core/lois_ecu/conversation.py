# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Conversation with a LOIS ECU: decodes received lines, and encodes orders as lines.

The caller must call ``wrote`` for all sent bytes, because the odometry depends on the commands.
"""

from collections.abc import Sequence

from omnibot_driver.core.board import BoardFigures, Mode
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.decoder import DecoderStatistics, LoisDecoder
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.late_reads import LateReads
from omnibot_driver.core.lois_ecu.messages import (
    PERIOD_ONCE,
    BoardOdometry,
    Command,
    DistributeBall,
    GpsDate,
    RecordKind,
    Report,
    Reset,
    Stream,
    TerminalLine,
    Ticks,
)
from omnibot_driver.core.lois_ecu.misconfiguration import (
    NO_TICKS_ADVICE,
    OWN_GAINS,
    TOO_FAST,
    TOO_FAST_ADVICE,
    Suspicion,
    own_gains,
)
from omnibot_driver.core.lois_ecu.readings import (
    LoisReading,
    TerminalLeft,
)
from omnibot_driver.core.lois_ecu.set_points import SetPoints
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.stall import StallWatch
from omnibot_driver.core.lois_ecu.traits import STANDS_AFTER_S, TRAITS
from omnibot_driver.core.lois_ecu.translation import Translation
from omnibot_driver.core.lois_ecu.upkeep import Upkeep


class LoisConversation:
    """A conversation with one LOIS ECU on one port. ``settings`` may be replaced at any time."""

    traits = TRAITS

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self._translation = Translation(settings)
        self._suspicion = Suspicion()
        self._statistics = DecoderStatistics()
        self._points = SetPoints(settings)
        self._upkeep = Upkeep(settings, self._points)
        self.mode = Mode.UNKNOWN
        self._forget_line()

    def _forget_line(self) -> None:
        per_turn = self._settings.ticks_per_revolution
        self._decoder = LoisDecoder(
            sum_required=self._settings.with_sum, ticks_per_revolution=per_turn
        )
        self._decoder.statistics = self._statistics
        self._late_reads = LateReads(per_turn)
        self._points.connect()
        self._stall = StallWatch(self._settings)

    @property
    def settings(self) -> LoisEcuSettings:
        """Settings that the user gives, because the board does not report them."""
        return self._settings

    @settings.setter
    def settings(self, settings: LoisEcuSettings) -> None:
        self._settings = self._translation.settings = self._points.settings = settings
        self._stall.settings = settings
        self._upkeep.configure(settings)
        self._decoder.sum_required = settings.with_sum
        self._decoder.ticks_gate.ticks_per_revolution = settings.ticks_per_revolution
        self._late_reads.ticks_per_revolution = settings.ticks_per_revolution

    # Inbound

    def connect(self) -> None:
        """Begin a new connection. The settings are then written to the board again."""
        self.mode = Mode.UNKNOWN
        self._upkeep.connect()
        self._suspicion.connect()
        self._forget_line()
        self._translation.connect()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[LoisReading]:
        """Return the readings that ``data`` completes.

        At the time ``held_until``, the caller must call this method with b"" to get held-back
        reports.
        """
        self._suspicion.look(data)
        return self._understood(self._decoder.feed(data, now), now)

    def flush(self, now: float) -> list[LoisReading]:
        """Return the readings of lines that were held back. Called when the port closes."""
        return self._understood(self._decoder.flush(now), now)

    def _understood(self, reports: list[Report], now: float) -> list[LoisReading]:
        translation, upkeep = self._translation, self._upkeep
        restarts = translation.counts.restarts
        if reports:
            own = not all(isinstance(report, TerminalLine) for report in reports)
            if own and self.mode is Mode.UNKNOWN and upkeep.opened:
                upkeep.writer.begin(now)  # the board may have booted, and lost its settings
            self.mode = Mode.NOMINAL
            upkeep.heard_at_s = now
            self._suspicion.understood()
            self._suspicion.heard(reports, now)
            if own:
                upkeep.change.protocol_heard(now)
                self._decoder.terminal = upkeep.change.terminal
        unit = self._decoder.clock_unit
        times = self._late_reads.times(reports, self._decoder.times, unit)
        for at, report in zip(times, reports, strict=True):
            if isinstance(report, Ticks):
                upkeep.writer.ticks_came(at)
            elif isinstance(report, GpsDate):
                upkeep.writer.date_came()
            if isinstance(report, Ticks | BoardOdometry):
                self._stall.heard(report, at, translation.odometry.resting)
        stalled = self._stall.stalled(now)
        if any(stalled):
            upkeep.writer.repeat(now)
            if translation.odometry.appends:
                rolls_left, rolls_right = self._stall.may_roll
                translation.odometry.stalled(
                    (stalled[0] and not rolls_left, stalled[1] and not rolls_right)
                )
                self._points.clear_again()
        found = translation.readings(reports, times, unit, now)
        if translation.needs_date:
            upkeep.writer.ask_date(now)
        restarted = translation.counts.restarts != restarts
        if restarted:
            upkeep.writer.begin(now)
        if upkeep.change.left:
            upkeep.change.left = False
            upkeep.writer.begin(now)
            found.append(TerminalLeft())
        if self._decoder.in_record:  # valid lines, not yet a complete report
            upkeep.heard_at_s = now
            self._suspicion.understood()
        return upkeep.request.look(
            found,
            self._decoder,
            "the board has restarted; call again" if restarted else upkeep.change.reason,
            self._settings.ticks_per_revolution,
        )

    def silence(self) -> None:
        """Set ``mode`` to unknown, because the board has been silent for too long."""
        self.mode = Mode.UNKNOWN

    @property
    def translation(self) -> Translation:
        """Translator of reports to readings. It also estimates the robot's motion."""
        return self._translation

    @property
    def held_until(self) -> float:
        """Time at which the caller must call ``receive`` with b"" to get the reports held back.

        Infinity if there are none.
        """
        return self._decoder.resolves_at

    def predicted(self, now: float) -> FusedOdometry | None:
        """Return the odometry predicted for ``now``; None before the first ticks."""
        return self._translation.odometry.predict(now)

    def reset_odometry(self) -> None:
        """Move the origin of the odometry frame to the robot's present pose."""
        odometry = self._translation.odometry
        self._translation.headings.begin_frame(odometry.yaw_rad)
        odometry.reset()

    def stands(self, now: float) -> bool | None:
        """Return whether the robot is at rest after a Stop; None if tick reports do not show this.

        None: the reports are old, or the board does not count ticks. The public firmware does not
        count after RPM 0/0 or a backward command.
        """
        points, translation = self._points, self._translation
        if points.stood:
            return True
        if now - translation.counts.came_at_s > STANDS_AFTER_S:
            return None
        still_since_s = max(translation.counts.changed_at_s, points.stopped_at_s)
        if points.driving or now - still_since_s < STANDS_AFTER_S:
            return False
        points.stood = translation.odometry.counting
        return points.stood or None

    @property
    def figures(self) -> BoardFigures:
        """Counters and rates for diagnostics. The counters continue after a reconnection.

        The expected odometry rate follows from the period of the tick reports that the user has
        set, or else from the measured period.
        """
        ticks_ms = self._settings.periods_ms.get(
            Stream.TICKS, 1e3 * self._upkeep.writer.ticks_period_s
        )
        gains = own_gains(self._settings)
        return BoardFigures(
            rates_hz={"Odometry": round(1e3 / ticks_ms, 1)} if 0 < ticks_ms < PERIOD_ONCE else {},
            faults=self._statistics.faults + self._decoder.group_statistics.damaged_groups,
            discarded_bytes=self._statistics.discarded_bytes,
            saturated=self._points.saturated,
            odom_hz=self._settings.odom_rate_hz,
            own={"Gains": f"{gains}: the board's own" if gains else "as set"},
        )

    @property
    def advice(self) -> str | None:
        """Advice on settings that are missing or contradict the received data, or None."""
        if self._decoder.ticks_gate.too_fast >= TOO_FAST:
            return TOO_FAST_ADVICE
        if self.mode is Mode.NOMINAL:
            if self._suspicion.no_ticks and Stream.TICKS not in self._settings.periods_ms:
                return NO_TICKS_ADVICE
            if gains := own_gains(self._settings):
                return OWN_GAINS.format(gains)
        return self._suspicion.advice

    # Outbound

    def due(self, now: float, *, proved: bool = True) -> bytes:
        """Return the lines to write now. Called at the time ``wake_at``.

        ``proved``: whether displacements have proved a standstill. A change of mode waits for the
        proof, but for at most 2 s.
        """
        data = self._upkeep.due(now, stands=bool(self.stands(now)) and proved)
        self._decoder.terminal = self._upkeep.change.terminal
        return data

    @property
    def wake_at(self) -> float:
        """Time at which both ``due`` and ``receive`` with b"" must be called next."""
        return min(self._upkeep.wake_at, self._decoder.resolves_at)

    @property
    def driving(self) -> bool:
        """Whether the last set-point moves the robot."""
        return self._points.driving

    def wrote(self, data: bytes, now: float) -> None:
        """Record that ``data`` was sent to the board."""
        said = self._points.wrote(data, now)
        if said:
            self._stall.wrote(said[-1], now)
        for command in said:
            self._translation.odometry.wrote(command, now)

    def stop(self) -> bytes:
        """Return the Stop command, which is duty 0/0."""
        return self._lines(outbound.STOP)

    def emergency_stop(self) -> bytes:
        """Return the set-points RPM 0/0; in a terminal mode, return no bytes.

        In this mode, the set-points would delay Stop: the public firmware reads only 480 characters
        a second.
        """
        return b"" if self._upkeep.change.terminal else self._lines(outbound.EMERGENCY_STOP)

    def velocity(self, twist: BodyTwist) -> bytes:
        """Return the lines that command a velocity, as RPM or duty; Stop if it rounds to zero.

        Raises CommandRefused for a motion in a terminal mode or during a change of mode.
        """
        return self.wheels(self._points.kinematics.wheel_rates(twist))

    def wheels(self, rates_radps: Sequence[float]) -> bytes:
        """Return the lines that command the rates of both wheels, in rad/s.

        The result is Stop if both rates round to zero.

        Raises CommandRefused for a motion in a terminal mode or during a change of mode.
        """
        if self._upkeep.change.reason and any(rates_radps):
            raise CommandRefused(f"motion command refused: {self._upkeep.change.reason}")
        return self._lines(*self._points.wheels(rates_radps))

    def meaning(self, data: bytes) -> BodyTwist:
        """Return the body velocity that is commanded by the last set-point in ``data``."""
        return self._points.meaning(data)

    # Other requests

    @property
    def reset_refusal(self) -> str:
        """Reason why a reset is refused in a terminal mode. Empty if a reset is allowed."""
        change = self._upkeep.change
        return change.reason if change.terminal or change.sensor_wanted else ""

    def reset(self) -> bytes:
        """Return the lines for Stop and a reset. The reset sets the board's counters to zero."""
        self._decoder.forget_counters()
        self._translation.reset()
        return self._lines(outbound.STOP, Reset())

    def write_settings(self, now: float) -> None:
        """Write all settings again, because a reset may have changed them.

        According to the manual, a reset affects controllers and interfaces.
        """
        self._upkeep.writer.begin(now)

    def say(self, command: Command, now: float) -> None:
        """Queue ``command``. It is sent several times, because lines may be lost.

        The command must be one that does no harm if the board receives it several times.
        """
        self._upkeep.writer.write(command, now)

    def distribute_ball(self) -> bytes:
        """Return the command to drop a ball. It must be sent only once."""
        return self._lines(DistributeBall())

    def record(self, kind: RecordKind, samples: int) -> None:
        """Request a record. Raises RequestRefused if the board cannot complete the record.

        Also raises RequestRefused if a terminal mode or a change of mode does not permit records.
        """
        if self._upkeep.change.reason:
            raise RequestRefused(f"record refused: {self._upkeep.change.reason}")
        self._upkeep.request.begin(kind, samples, self._decoder)

    def _lines(self, *commands: Command) -> bytes:
        return outbound.lines(*commands, with_sum=self._settings.with_sum)
