# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU: its lines as readings, orders as its lines.

``wrote`` must be called with whatever goes out: the odometry rests on it, since the board tells
little of where its wheels turn. What the board says is told in ``translation``, how settings reach
it in ``opening``, why set-points look as they do in ``outbound``.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final

from omnibot_driver.core.board import BoardFigures, Mode
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.geometry.differential import DifferentialKinematics
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import outbound
from omnibot_driver.core.lois_ecu.decoder import DecoderStatistics, LoisDecoder
from omnibot_driver.core.lois_ecu.messages import (
    PERIOD_ONCE,
    BoardOdometry,
    Command,
    DistributeBall,
    GpsDate,
    Record,
    RecordKind,
    Report,
    Reset,
    SetDuty,
    SetLed,
    SetRpm,
    SetTerminalMode,
    Stream,
    TerminalLine,
    TerminalMode,
    Ticks,
)
from omnibot_driver.core.lois_ecu.misconfiguration import Suspicion
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.opening import RECOVER_AFTER_S, SettingsWriter
from omnibot_driver.core.lois_ecu.plausibility import ClockUnit
from omnibot_driver.core.lois_ecu.readings import (
    LoisReading,
    RecordComes,
    RecordFailed,
    RecordReading,
    TerminalLeft,
)
from omnibot_driver.core.lois_ecu.record_request import RecordRequest
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.core.lois_ecu.stall import StallWatch
from omnibot_driver.core.lois_ecu.terminal import ModeChange
from omnibot_driver.core.lois_ecu.translation import Translation
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.requests import Request
from omnibot_driver.core.traits import Traits

STANDS_AFTER_S: Final = 0.6
"""Without a tick. The slowest wheel that turns, at 2 RPM, ticks each half second."""
TRAITS: Final = Traits(
    imu_period_s=None,
    authorities=frozenset({Authority.BASE, Authority.WHEELS}),
    requests=frozenset({Request.RESET}),
    wheels=("left", "right"),
    unheard_s=1.0,  # groups come each 0.2 s, and may be lost
    silence_s=1.5,
    own_odometry=True,
    stands_after_s=STANDS_AFTER_S,
    unproved_s=2.0,
    slack_mps=0.15,  # a tick in 0.2 s is 0.07 m/s
    slack_radps=1.2,  # with its gains the wheels do not speed up alike
    advice={
        Fault.WRONG_WAY: "check `inverted`, and the wiring of motors and encoders",
        Fault.WRONG_TURN: "check `inverted`, and the wiring of motors and encoders",
        Fault.TOO_FAST: (
            "check `wheel_radius` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.TURNS_TOO_FAST: (
            "check `track`, `wheel_radius` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.BEYOND_LIMITS: (
            "check `wheel_radius`, `track` and `ticks_per_revolution`; in duty mode, `duty_scale`"
        ),
        Fault.BLOCKED: (
            "check motor power, whether the wheels are blocked, the gains that were set, and"
            " `low_pass`; in duty mode, `duty_scale`"
        ),
        Fault.HELD_BY_ESTOP: (
            "check whether the e-stop button is held, and motor power; the board tells a press"
            " and a release once"
        ),
    },
)
CLEAR_AFTER_S: Final = 2.0
"""After a Stop; then RPM 0/0 ends the counting."""
CLEAR_AGAIN_S: Final = 0.15
RECORD_COUNT_S: Final[Mapping[ClockUnit, float]] = {"ms": 1e-4, "ns": 1e-7}
"""Of an RPM record, by the unit of 0x12's time: the public firmware departs in both."""


class LoisEcu:
    """One board on one line. ``settings`` may be replaced at any time."""

    traits = TRAITS

    def __init__(self, settings: LoisEcuSettings) -> None:
        self._settings = settings
        self._translation = Translation(settings)
        self._writer = SettingsWriter(settings)
        self._suspicion = Suspicion()
        self._statistics = DecoderStatistics()
        self._saturated = 0
        self._opened = False
        self._change = ModeChange()
        self._change.want(settings.terminal_mode)
        self.mode = Mode.UNKNOWN
        self._forget_line()

    def _forget_line(self) -> None:
        self._decoder = LoisDecoder(sum_required=self._settings.with_sum)
        self._decoder.statistics = self._statistics
        self._heard_at_s = -math.inf
        self._recovered_at_s = -math.inf
        self._said: SetRpm | SetDuty | None = None
        self._stopped_at_s = math.inf
        self._stood = False
        self._stall = StallWatch(self._settings.track_m)
        self._request = RecordRequest()
        self._damaged = 0
        self._clears_left = outbound.CLEARED_TIMES

    @property
    def settings(self) -> LoisEcuSettings:
        """What the wire does not tell."""
        return self._settings

    @settings.setter
    def settings(self, settings: LoisEcuSettings) -> None:
        changed = (
            settings.low_pass,
            settings.written,
            settings.periods_ms,
            settings.with_sum,
        ) != (
            self._settings.low_pass,
            self._settings.written,
            self._settings.periods_ms,
            self._settings.with_sum,
        )
        if settings.drive_mode != self._settings.drive_mode:
            self._change.stop_first(f"drive_mode becomes {settings.drive_mode}")
        if settings.terminal_mode is not self._settings.terminal_mode:
            self._change.want(settings.terminal_mode)
        self._settings = self._translation.settings = self._writer.settings = settings
        self._decoder.sum_required = settings.with_sum
        if changed:
            self._opened = False

    # Inbound

    def connect(self) -> None:
        """The line is new; the settings are written again."""
        self.mode = Mode.UNKNOWN
        self._opened = False
        self._change.connect()
        self._forget_line()
        self._translation.connect()

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[LoisReading]:
        """The readings that these bytes complete. Call it without bytes when none came."""
        self._suspicion.look(data)
        return self._understood(self._decoder.feed(data, now), now)

    def flush(self, now: float) -> list[LoisReading]:
        """The line is closed: what was held is all there will be."""
        return self._understood(self._decoder.flush(now), now)

    def _understood(self, reports: list[Report], now: float) -> list[LoisReading]:
        restarts = self._translation.restarts
        if reports:
            own = not all(isinstance(report, TerminalLine) for report in reports)
            if own and self.mode is Mode.UNKNOWN and self._opened:
                self._writer.begin(now)  # it may have booted, and forgotten what it was told
            self.mode = Mode.NOMINAL
            self._heard_at_s = now
            self._suspicion.understood()
            if own:
                self._change.protocol_heard(now)
                self._decoder.terminal = self._change.terminal
        times = self._decoder.times
        for at, report in zip(times, reports, strict=True):
            if isinstance(report, Ticks):
                self._writer.ticks_came(at)
            elif isinstance(report, GpsDate):
                self._writer.date_came()
            if isinstance(report, Ticks | BoardOdometry):
                self._stall.heard(report, at)
        if self._translation.odometry.appends and self._stall.looks_stalled(now):
            self._clears_left = outbound.CLEARED_TIMES
        found = self._translation.readings(reports, times, self._decoder.clock_unit, now)
        if self._translation.restarts != restarts:
            self._writer.begin(now)
        if self._change.left:
            self._change.left = False
            self._writer.begin(now)
            found.append(TerminalLeft())
        return self._recorded(found, now, restarted=self._translation.restarts != restarts)

    def silence(self) -> None:
        """Nothing was understood for so long that the mode is unknown again."""
        self.mode = Mode.UNKNOWN

    @property
    def translation(self) -> Translation:
        """What is known of the robot."""
        return self._translation

    @property
    def held_until(self) -> float:
        """When ``receive`` without bytes tells what was held; infinity while nothing is."""
        return self._decoder.resolves_at

    def predicted(self, now: float) -> FusedOdometry | None:
        """Where the robot should be now; None before the first ticks."""
        return self._translation.odometry.predict(now)

    def reset_odometry(self) -> None:
        """The odometry frame begins where the robot stands."""
        self._translation.odometry.reset()

    def stands(self, now: float) -> bool | None:
        """Whether the robot is seen to stand since it was stopped; None where that is unknown.

        The public firmware counts no ticks of a wheel that was commanded backward, or by RPM 0/0.
        """
        if self._stood:
            return True
        translation = self._translation
        if now - translation.last_ticks_at_s > STANDS_AFTER_S:
            return None
        stopped_at_s = self._stopped_at_s
        if self.driving or now - max(translation.ticked_at_s, stopped_at_s) < STANDS_AFTER_S:
            return False
        self._stood = translation.odometry.counting
        return self._stood or None

    @property
    def figures(self) -> BoardFigures:
        """Over all connections."""
        ticks_ms = self._settings.periods_ms.get(Stream.TICKS, PERIOD_ONCE)
        return BoardFigures(
            rates_hz={"Odometry": 1e3 / ticks_ms} if ticks_ms < PERIOD_ONCE else {},
            faults=self._statistics.faults + self._decoder.group_statistics.damaged_groups,
            discarded_bytes=self._statistics.discarded_bytes,
            saturated=self._saturated,
            odom_hz=self._settings.odom_rate_hz,
        )

    @property
    def advice(self) -> str | None:
        """What a user should set otherwise, by what comes; None while all is well."""
        return self._suspicion.advice

    @property
    def configured(self) -> bool:
        """Whether the settings have gone out; by RPM the wheels do not turn before."""
        return self._opened and self._writer.done

    @property
    def confirmed(self) -> bool:
        """Whether the board has answered, and shown that it took the period of its ticks."""
        return self._writer.confirmed

    # Outbound

    def due(self, now: float) -> bytes:
        """Settings and what clears up after a Stop; call it at ``wake_at``."""
        if not self._opened:
            self._opened = True
            self._writer.begin(now)
            self._recovered_at_s = now
        data = self._writer.due(now, driving=self.driving)
        data += self._change_mode(now)
        if (record := self._request.due(now)) is not None:
            data += self._lines(record)
        if self._clear_due(now):
            self._stopped_at_s = now - CLEAR_AFTER_S + CLEAR_AGAIN_S
            data += self._lines(outbound.EMERGENCY_STOP)
        if now >= self._recover_at:
            self._recovered_at_s = now
            data += self._writer.recovery()
            self._writer.begin(now)
        return data

    def _change_mode(self, now: float) -> bytes:
        """Stop, or the terminal mode, while either of them is to be said."""
        change = self._change
        if change.stops(now, stands=bool(self.stands(now))):
            return self._lines(outbound.STOP)
        mode = change.due(now, settled=self._writer.done)
        self._decoder.terminal = change.terminal
        if mode is None:
            return b""
        if mode is TerminalMode.HOST:
            return self._writer.recovery()
        self._writer.overwritten = True
        return self._lines(outbound.STOP, *[SetTerminalMode(mode)] * 3)

    @property
    def wake_at(self) -> float:
        """When ``due`` has to be asked again."""
        if not self._opened:
            return -math.inf
        clear_at = self._stopped_at_s + CLEAR_AFTER_S if self._clears_left else math.inf
        held = self._decoder.resolves_at
        others_at = min(self._change.wake_at, self._request.wake_at)
        return min(self._writer.wake_at, clear_at, self._recover_at, held, others_at)

    @property
    def _recover_at(self) -> float:
        if self._change.sensor_wanted or self._change.terminal:
            return math.inf
        if self.driving:
            return math.inf
        silent_since_s = self._recovered_at_s if self._writer.ignored else self._heard_at_s
        return max(silent_since_s, self._recovered_at_s) + RECOVER_AFTER_S

    @property
    def driving(self) -> bool:
        """Whether the last set-point moves the robot."""
        return self._said is not None and _moves(self._said)

    def _clear_due(self, now: float) -> bool:
        return self._clears_left > 0 and now >= self._stopped_at_s + CLEAR_AFTER_S

    def wrote(self, data: bytes, now: float) -> None:
        """These bytes went to the board."""
        said = outbound.set_points(data, with_sum=self._settings.with_sum)
        if said:
            self._stall.wrote(said[-1], now)
        for command in said:
            self._translation.odometry.wrote(command, now)
            if _moves(command):
                self._stopped_at_s, self._stood = math.inf, False
                if isinstance(command, SetDuty):
                    self._clears_left = outbound.CLEARED_TIMES
            else:
                if self._stopped_at_s == math.inf:
                    self._stopped_at_s = now
                if isinstance(command, SetRpm):
                    self._clears_left = max(self._clears_left - 1, 0)
                elif self.driving:
                    self._clears_left = outbound.CLEARED_TIMES
            self._said = command

    def stop(self) -> bytes:
        """Duty 0/0."""
        return self._lines(outbound.STOP)

    def emergency_stop(self) -> bytes:
        """RPM 0/0, which alternates with Stop; the board has no latch of its own."""
        return self._lines(outbound.EMERGENCY_STOP)

    def velocity(self, twist: BodyTwist) -> bytes:
        """By the drive mode; Stop when it rounds to nothing."""
        rates = self._kinematics.wheel_rates(twist)
        return self.wheels(rates)

    def wheels(self, rates_radps: Sequence[float]) -> bytes:
        """Left and right in rad/s; Stop when both round to nothing."""
        settings = self._settings
        left, right = rates_radps
        if self._change.reason and any(rates_radps):
            raise CommandRefused(f"motion command refused: {self._change.reason}")
        if settings.drive_mode == "duty":
            percent = settings.wheel_radius_m * settings.duty_scale
            return self.duty((left * percent, right * percent))
        rpm = 60 / math.tau
        pair, was_saturated = outbound.saturated((left * rpm, right * rpm), outbound.MOST_RPM)
        self._saturated += was_saturated
        if not any(pair):
            return self.stop()
        command = SetRpm(*self._board_order(pair))
        if self._clears_left:
            return self._lines(outbound.EMERGENCY_STOP, command)
        return self._lines(command)

    def duty(self, percents: Sequence[float]) -> bytes:
        """Left and right in percent, open loop. Refused in RPM mode."""
        if self._settings.drive_mode != "duty":
            raise CommandRefused(
                "duty_cmd refused: drive_mode is rpm; set it to duty to drive without the"
                " speed controller"
            )
        left, right = percents
        most = min(self._settings.max_duty, outbound.MOST_PERCENT)
        pair, was_saturated = outbound.saturated((left, right), most)
        self._saturated += was_saturated
        return self._lines(SetDuty(*self._board_order(pair)))

    def meaning(self, data: bytes) -> BodyTwist:
        """The body velocity that the last set-point in these bytes commands."""
        found = outbound.set_points(data, with_sum=self._settings.with_sum)
        if not found:
            return BodyTwist(0.0, 0.0, 0.0)
        command = found[-1]
        settings = self._settings
        if isinstance(command, SetRpm):
            pair = (command.left_rpm, command.right_rpm)
            unit = math.tau / 60
        else:
            pair = (command.left_percent, command.right_percent)
            unit = 1 / (settings.duty_scale * settings.wheel_radius_m)
        left, right = self._board_order(pair)
        return self._kinematics.body_twist((left * unit, right * unit))

    # Other requests

    def reset(self) -> bytes:
        """Stop, then the board's reset; the counters begin anew."""
        self._decoder.forget_counters()
        self._translation.connect()
        return self._lines(outbound.STOP, Reset())

    def write_settings(self, now: float) -> None:
        """All of them again: by the manual a reset is one of controllers and interfaces too."""
        self._writer.begin(now)

    def say(self, command: Command, now: float) -> None:
        """Something that may be repeated, until it has surely arrived."""
        self._writer.write(command, now)

    def led(self, on: bool) -> bytes:
        """The board's LED."""
        return self._lines(SetLed(on))

    def distribute_ball(self) -> bytes:
        """Once; do not repeat it."""
        return self._lines(DistributeBall())

    def record(self, kind: RecordKind, samples: int) -> None:
        """Begin to record. Raises RequestRefused where it could not complete."""
        if self._change.reason:
            raise RequestRefused(f"record refused: {self._change.reason}")
        self._request.begin(kind, samples)
        self._decoder.expect_record(kind, samples, 0 if kind is RecordKind.HEADING else samples)
        self._damaged = self._decoder.group_statistics.damaged_records

    def _recorded(
        self, found: list[LoisReading], now: float, *, restarted: bool
    ) -> list[LoisReading]:
        """With the record that was awaited, or why it is not going to come."""
        request = self._request
        if request.kind is None:
            return found
        if self._decoder.in_record:
            request.arrives()
            self._heard_at_s = now
        for place, reading in enumerate(found):
            if isinstance(reading, Record):
                request.end()
                unit = self._decoder.clock_unit
                found[place] = RecordReading(
                    reading,
                    None if unit is None else RECORD_COUNT_S[unit],
                    self._settings.ticks_per_revolution,
                )
                return found
        failed = ""
        if restarted:
            failed = "the board has restarted; call again"
        elif self._change.reason:
            failed = self._change.reason
        elif self._decoder.group_statistics.damaged_records != self._damaged:
            failed = "a line of it was lost on its way; call again"
        if not failed:
            return found or ([RecordComes()] if self._decoder.in_record else [])
        request.end()
        return [*found, RecordFailed(failed)]

    def _lines(self, *commands: Command) -> bytes:
        return outbound.lines(*commands, with_sum=self._settings.with_sum)

    def _board_order(self, pair: tuple[int, int]) -> tuple[int, int]:
        """The board's left and right, or back."""
        return (pair[1], pair[0]) if self._settings.inverted else pair

    @property
    def _kinematics(self) -> DifferentialKinematics:
        settings = self._settings
        return DifferentialKinematics(
            wheel_radius_m=settings.wheel_radius_m, track_m=settings.track_m
        )


def _moves(command: SetRpm | SetDuty) -> bool:
    match command:
        case SetRpm(left, right) | SetDuty(left, right):
            return bool(left or right)
