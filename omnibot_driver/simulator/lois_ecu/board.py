# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU and its robot: what it obeys, measures and sends, a millisecond at a time.

Pure: bytes in, ticks of ``tick_s``, bytes out; the same settings and input give the same output.
Knows the manual's table and, by ``Quirks``, the public firmware. Must not know ports or real time.

Where the manual is silent: no set-point ends by itself; ticks are signed and wrap at 2³²; the
button is told on press and on release, and both set the set-points to zero.
"""

from collections import deque
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from random import Random

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.lois_ecu import wire
from omnibot_driver.simulator.lois_ecu.channel import RECORD_DEPTH, WheelChannel
from omnibot_driver.simulator.lois_ecu.motors import Encoder, Gains, Motor
from omnibot_driver.simulator.lois_ecu.odometry import DocumentedOdometry, FirmwareOdometry
from omnibot_driver.simulator.lois_ecu.sensors import Compass, Fix, fix_at, sentence
from omnibot_driver.simulator.lois_ecu.settings import LoisSettings

CHANNELS = (Channel(),)
STEP_S = 0.001
STEPS_PER_TICK = 10
BYTES_PER_STEP = 11.52
INPUT_DEPTH = 600
BOOT_S = 2.0
PERIODS_MS = {0x0D: 1200, 0x0E: 1000, 0x0F: 0xFFFF, 0x10: 400, 0x12: 400, 0x20: 400}
ONCE, NEVER = 0xFFFE, 0xFFFF
GPS_SENTENCE_S = 1.0

LEFT_GAINS = Gains(kp=0.4412, tn=0.2865, td=0.6495)
RIGHT_GAINS = Gains(kp=0.7316, tn=0.1383, td=0.6495)
CORRECTIONS = ((1.0761719, 0.9338983), (1.0954246, 0.9198685))
GAIN_NAMES = {0x06: "kp", 0x07: "tn", 0x08: "td", 0x09: "kp", 0x0A: "tn", 0x0B: "td"}


@dataclass(frozen=True, slots=True)
class TrueState:
    """Where the robot truly is and how it moves: m, rad (unwrapped), m/s, rad/s."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class Obeyed:
    """A line that the board obeyed in tick number ``tick``."""

    tick: int
    command: int
    payload: int


@dataclass(slots=True)
class _Timer:
    period_ms: int
    since_ms: int = 0


class SimulatedLois:
    """One board with its robot. ``tick``: of 10 ms, since construction.

    commands: what it obeyed, newest last. received: all that reached its port. lost_bytes: of
    those, what it did not hear. led, balls, pressed: what can be seen of it.
    """

    channels = CHANNELS
    tick_s = STEP_S * STEPS_PER_TICK

    def __init__(self, settings: LoisSettings | None = None) -> None:
        self.settings = settings = LoisSettings() if settings is None else settings
        self.tick = 0
        self.commands: deque[Obeyed] = deque(maxlen=100_000)
        self.received = bytearray()
        self.lost_bytes = 0
        self.led = self.pressed = False
        self.balls = 0
        self.truth = TrueState(0.0, 0.0, 0.0, 0.0, 0.0)
        self._steps = 0
        self._random = Random(f"lois {settings.seed}")
        self.motors = tuple(
            Motor(motor, settings.load_percent, self._random) for motor in settings.motors
        )
        # A disc whose levels the corrections that the board has from the beginning make equal.
        self._encoders = tuple(
            Encoder(
                settings.steps,
                long / (short + long),
                noise=settings.mark_noise,
                random=Random(f"marks {settings.seed} {long}"),
            )
            for short, long in CORRECTIONS
        )
        self._inbound: deque[int] = deque()
        self._in_credit = 0.0
        self._boot()
        if settings.running:
            self._boots_until_s = 0.0

    def reboot(self) -> None:
        """A power cycle; the robot stays where it is."""
        self._boot()

    def _boot(self) -> None:
        settings, quirks = self.settings, self.settings.quirks
        low_pass = 0.0 if quirks.low_pass_starts_at_zero else 1.0
        self.wheels = tuple(
            WheelChannel(
                quirks,
                settings.steps,
                corrections,
                Gains(gains.kp, gains.tn, gains.td, low_pass=low_pass),
            )
            for corrections, gains in zip(CORRECTIONS, (LEFT_GAINS, RIGHT_GAINS), strict=True)
        )
        geometry = settings.steps, settings.wheel_radius_m, settings.track_m
        self._firmware_odometry = (
            quirks.odometry_stands_at_equal_speeds
            or quirks.velocity_may_be_nan
            or quirks.keeps_speed_of_stalled_wheel
        )
        self.odometry: DocumentedOdometry = (
            FirmwareOdometry(
                *geometry,
                stands=quirks.odometry_stands_at_equal_speeds,
                divides=quirks.velocity_may_be_nan,
            )
            if self._firmware_odometry
            else DocumentedOdometry(*geometry)
        )
        self._compass = Compass(
            settings.heading_noise_deg,
            over_north=quirks.headings_average_over_north,
            random=self._random,
        )
        self._applied_duty = (0, 0)
        self._boots_until_s = self.now_s + (BOOT_S if quirks.slow_boot else 0.0)
        self._reader = wire.LineReader(lenient=quirks.lenient_hex)
        self._input: deque[int] = deque()
        self._sending: deque[tuple[bytearray, bool]] = deque()
        self._out_credit = 0.0
        self._kept_byte: int | None = None
        self._pending: dict[int, tuple[bool, int]] = {}
        self._clock_ms = 0
        self._timers = {code: _Timer(period) for code, period in PERIODS_MS.items()}
        self._scan: list[int] = []
        self._control_late = False
        self._control_at_s = self._compass_at_s = self._gps_at_s = self.now_s
        self.terminal_mode = 0
        self._button_news: bool | None = None
        self._recording: str | None = None
        self._headings: list[int] = []
        self._headings_wanted = 0

    @property
    def now_s(self) -> float:
        """Since construction."""
        return self._steps * STEP_S

    @property
    def driven(self) -> bool:
        """Whether the motors have power."""
        return any(self._applied_duty)

    @property
    def standing(self) -> bool:
        """Whether both wheels truly stand."""
        return all(motor.rpm == 0.0 for motor in self.motors)

    def press(self, pressed: bool) -> None:
        """The emergency stop button."""
        self.pressed = pressed
        self._button_news = pressed
        self._applied_duty = (0, 0)
        for channel in self.wheels:
            channel.release()

    def hold(self, *, left: bool = False, right: bool = False) -> None:
        """Somebody holds these wheels."""
        self.motors[0].held, self.motors[1].held = left, right

    def receive(self, data: bytes, now: float | None = None, channel: int = 0) -> None:
        """Take bytes off the line; they arrive one after the other from now on."""
        self.received += data
        self._inbound.extend(data)

    def advance(self) -> list[Packet]:
        """Let one tick pass; what left the board in it."""
        data = self.step()
        return [(0, data)] if data else []

    @property
    def facts(self) -> dict[str, object]:
        """Of the robot and its board."""
        truth, (left, right) = self.truth, self.wheels
        return {
            "x_m": truth.x_m,
            "y_m": truth.y_m,
            "yaw_rad": truth.yaw_rad,
            "speed_mps": truth.speed_mps,
            "yaw_rate_radps": truth.yaw_rate_radps,
            "rpm": [motor.rpm for motor in self.motors],
            "ticks": [left.ticks, right.ticks],
            "led": self.led,
            "balls": self.balls,
            "pressed": self.pressed,
            "obeyed": len(self.commands),
            "lost_bytes": self.lost_bytes,
        }

    def step(self) -> bytes:
        """Let one tick pass; the bytes that left the board in it."""
        self.tick += 1
        sent = bytearray()
        for _ in range(STEPS_PER_TICK):
            self._steps += 1
            self._drive()
            self._listen()
            if self.now_s < self._boots_until_s:
                self._clock_ms += 1
                continue
            self._interrupts()
            self._send(sent)
            if not self._sending:
                self._main_loop()
        return bytes(sent)

    # The robot

    def _drive(self) -> None:
        settings, state = self.settings, self.truth
        ways, edges = [], []
        for index, (motor, encoder) in enumerate(zip(self.motors, self._encoders, strict=True)):
            turns = motor.advance(self._applied_duty[index], STEP_S)
            if turns:
                edge = encoder.turn(turns)
                if edge is not None:
                    edges.append((edge[0], index, *edge[1:]))
            radius_m = settings.wheel_radius_m * settings.wheel_radius_scale[index]
            way_m = turns * 2 * pi * radius_m
            if settings.slip and way_m:
                way_m += self._random.gauss(0.0, settings.slip) * abs(way_m) ** 0.5
            ways.append(way_m)
        for part, index, is_long, direction in sorted(edges):
            self._edge(index, self.now_s - STEP_S * (1 - part), is_long, direction)
        left_m, right_m = ways
        if not (left_m or right_m):
            if state.speed_mps or state.yaw_rate_radps:
                self.truth = TrueState(state.x_m, state.y_m, state.yaw_rad, 0.0, 0.0)
            return
        way_m = (left_m + right_m) / 2
        turn_rad = (right_m - left_m) / (settings.track_m * settings.track_scale)
        middle_rad = state.yaw_rad + turn_rad / 2
        self.truth = TrueState(
            state.x_m + way_m * cos(middle_rad),
            state.y_m + way_m * sin(middle_rad),
            state.yaw_rad + turn_rad,
            way_m / STEP_S,
            turn_rad / STEP_S,
        )

    # Interrupts

    @property
    def _deaf(self) -> bool:
        return bool(self._sending) and self._sending[0][1]

    def _edge(self, index: int, at_s: float, is_long: bool, direction: int) -> None:
        if self.now_s < self._boots_until_s:
            return
        if self._deaf:
            self._pending[index] = (is_long, direction)
            return
        self.wheels[index].edge(at_s, is_long, direction)
        if isinstance(self.odometry, FirmwareOdometry):
            self.odometry.tick(at_s, self.wheels[0].rpm, self.wheels[1].rpm)

    def _interrupts(self) -> None:
        quirks = self.settings.quirks
        if not (self._deaf and quirks.clock_stops_while_sending):
            self._clock_ms += 1
        period_s = 0.091 if quirks.fast_control else 0.2
        if self.now_s >= self._control_at_s + period_s:
            self._control_at_s += period_s
            self._control_late = True
        if self._control_late and not self._deaf:
            self._control_late = False
            for channel in self.wheels:
                channel.settle(self.now_s)
                channel.control(period_s)
            left, right = self.wheels
            self._applied_duty = (left.duty_percent, right.duty_percent)
            if self._recording == "torque":
                for channel in self.wheels:
                    channel.torque()
        if not self._firmware_odometry and self._steps % 5 == 0:
            self.odometry.move(*(channel.turned_ticks for channel in self.wheels))
            self.odometry.measure(*(channel.exact_rpm for channel in self.wheels))
            for channel in self.wheels:
                channel.turned_ticks = 0
        if self.now_s >= self._compass_at_s + self.settings.compass_period_s:
            self._compass_at_s += self.settings.compass_period_s
            self._compass_reads()
        if self.terminal_mode == 1 and self.now_s >= self._gps_at_s + GPS_SENTENCE_S:
            self._gps_at_s = self.now_s
            fix = self._fix()
            clock = "".join(f"{number:02d}" for number in fix.time)
            self._sending.append((bytearray(sentence(f"GPRMC,{clock}.00,A")), False))

    def _compass_reads(self) -> None:
        heading = self._compass.read(self.truth.yaw_rad)
        if self.terminal_mode == 2:
            self._sending.append((bytearray(sentence(f"HEHDT,{heading % 360}.0,T")), False))
        if self._recording == "heading" and self._headings_wanted:
            full = len(self._headings) >= min(self._headings_wanted, 2 * RECORD_DEPTH)
            if not full:
                self._headings.append(heading)
                full = len(self._headings) >= self._headings_wanted
                if self.settings.quirks.record_waits_for_one_more:
                    return
            if full:
                self._send_headings()

    def _listen(self) -> None:
        self._in_credit = min(self._in_credit + BYTES_PER_STEP, 2 * BYTES_PER_STEP)
        while self._inbound and self._in_credit >= 1.0:
            self._in_credit -= 1.0
            byte = self._inbound.popleft()
            if self._deaf and self.settings.quirks.deaf_while_sending:
                if self._kept_byte is None:
                    self._kept_byte = byte
                else:
                    self.lost_bytes += 1
            else:
                self._hear(byte)

    def _hear(self, byte: int) -> None:
        if len(self._input) < INPUT_DEPTH:
            self._input.append(byte)
        else:
            self.lost_bytes += 1

    def _send(self, sent: bytearray) -> None:
        self._out_credit = min(self._out_credit + BYTES_PER_STEP, 2 * BYTES_PER_STEP)
        while self._sending and self._out_credit >= 1.0:
            burst, _ = self._sending[0]
            count = min(int(self._out_credit), len(burst))
            sent += burst[:count]
            del burst[:count]
            self._out_credit -= count
            if not burst:
                deaf = self._deaf
                self._sending.popleft()
                if deaf:
                    self._catch_up()
                    return

    def _catch_up(self) -> None:
        """What waited while interrupts were off."""
        pending, self._pending = self._pending, {}
        for index, (is_long, direction) in pending.items():
            self._edge(index, self.now_s, is_long, direction)
        if self._kept_byte is not None:
            self._hear(self._kept_byte)
            self._kept_byte = None

    # The main loop

    def _main_loop(self) -> None:
        if not self._scan:
            while self._input and not self._sending:
                found = self._reader.take(self._input.popleft())
                if found is not None:
                    self._obey(*found)
            self._send_record()
            self._scan = list(self._timers)
        while self._scan and not self._sending:
            self._periodic(self._scan.pop(0))
        if not self._scan and not self._sending and self._button_news is not None:
            pressed, self._button_news = self._button_news, None
            self._say(wire.line(0x05, int(pressed)), deaf=False, button=True)

    def _say(self, data: bytes, *, deaf: bool = True, button: bool = False) -> None:
        if self.terminal_mode in (1, 2, 3) and not (
            button and not self.settings.quirks.button_is_lost_in_terminal_mode
        ):
            return
        deaf = deaf and (
            self.settings.quirks.deaf_while_sending
            or self.settings.quirks.clock_stops_while_sending
        )
        self._sending.append((bytearray(data), deaf))

    def _periodic(self, code: int) -> None:
        timer = self._timers[code]
        if timer.period_ms == NEVER:
            return
        if timer.period_ms == ONCE:
            timer.period_ms = NEVER
        elif self._clock_ms - timer.since_ms > timer.period_ms:
            timer.since_ms = self._clock_ms
        else:
            return
        self._say(self._group(code))

    def _group(self, code: int) -> bytes:
        quirks = self.settings.quirks
        if code == 0x10:
            return wire.words(code, 0, self._compass.last)
        if code in (0x0D, 0x0E, 0x0F):
            fix = self._fix()
            if code == 0x0D:
                place = (fix.latitude_deg, fix.longitude_deg)
                return wire.sequence(code, [wire.bits_of(number) for number in place])
            first, second, third = fix.time if code == 0x0E else fix.date
            return wire.line(code, first << 16 | second << 8 | third)
        numbers = [wire.bits_of(n) for n in (*self.odometry.pose, *self.odometry.velocity)]
        if code == 0x20:
            return wire.sequence(code, numbers)
        clock = self._clock_ms if quirks.clock_in_ms else round(self.now_s * 1e9)
        ticks = [channel.ticks & 0xFFFFFFFF for channel in self.wheels]
        group = wire.sequence(code, [clock & 0xFFFFFFFF, *ticks])
        return group + wire.sequence(code, numbers) if quirks.appends_odometry else group

    def _fix(self) -> Fix:
        settings = self.settings
        if settings.quirks.gps_is_ignored:
            return Fix(0.0, 0.0, (0, 0, 0), (0, 0, 0))
        start = settings.start_latitude_deg, settings.start_longitude_deg
        return fix_at(start, self.truth.x_m, self.truth.y_m, settings.utc_s + self.now_s)

    # Records

    def _send_record(self) -> None:
        if self._recording not in ("rpm", "torque"):
            return
        left, right = self.wheels
        if left.record_left or right.record_left:
            return
        under_rpm = self._recording == "rpm" or self.settings.quirks.torque_comes_as_rpm
        code = 0x04 if under_rpm else 0x17
        pairs = max(len(left.record), len(right.record))
        lefts = left.record + [10] * (pairs - len(left.record))
        rights = right.record + [10] * (pairs - len(right.record))
        lines = [wire.words(code, a, b) for a, b in zip(lefts, rights, strict=True)]
        self._say(b"".join([*lines, wire.line(code, 0)]))
        self._end_record()

    def _send_headings(self) -> None:
        padded = self._headings + [0x016A] * (len(self._headings) % 2)
        lines = [wire.words(0x0C, a, b) for a, b in zip(padded[::2], padded[1::2], strict=True)]
        self._say(b"".join([*lines, wire.line(0x0C, 0x016A016A)]))
        self._end_record()

    def _end_record(self) -> None:
        self._recording = None
        for timer in self._timers.values():
            timer.since_ms = self._clock_ms

    # Commands

    def _obey(self, command: int, payload: int) -> None:
        quirks = self.settings.quirks
        self.commands.append(Obeyed(self.tick, command, payload))
        left, right = self.wheels
        high, low = payload >> 16, payload & 0xFFFF
        signed = [word - 0x10000 if word & 0x8000 else word for word in (high, low)]
        if command == 0x01:
            left.command_duty(signed[0])
            right.command_duty(signed[1])
        elif command == 0x02:
            left.command_rpm(signed[0])
            right.command_rpm(signed[1])
        elif command == 0x03:
            self.led = low != 0
        elif command in (0x04, 0x17):
            self._recording = "rpm" if command == 0x04 else "torque"
            left.start_record(high)
            right.start_record(low)
        elif command == 0x0C:
            self._recording, self._headings, self._headings_wanted = "heading", [], payload
        elif command in GAIN_NAMES:
            channel = left if command <= 0x08 else right
            channel.controller.change(**{GAIN_NAMES[command]: wire.number_of(payload)})
        elif command in self._timers:
            if command != 0x20 or not quirks.odometry_period_is_fixed:
                self._timers[command] = _Timer(low, self._clock_ms)
        elif command == 0x11:
            self.terminal_mode = low & 0xFF
            self._reader.checks = self.terminal_mode != 4
            if quirks.terminal_mode_zeroes_correction:
                left.short_correction = wire.number_of(payload)
        elif command in (0x13, 0x14, 0x15, 0x16):
            self._correct(command, wire.number_of(payload))
        elif command == 0x18:
            left.reset()
            right.reset()
            if not quirks.reset_clears_ticks_only:
                self.odometry.clear()
        elif command == 0x19:
            self.balls += 1
        elif command in (0x21, 0x22, 0x23) and quirks.extra_settings:
            number = wire.number_of(payload)
            if command == 0x23:
                left.controller.change(low_pass=number)
                right.controller.change(low_pass=number)
            else:
                channel = left if command == 0x21 else right
                channel.controller.change(feed_forward=number)

    def _correct(self, command: int, factor: float) -> None:
        channel = self.wheels[0 if command <= 0x14 else 1]
        if command in (0x13, 0x15):
            channel.short_correction = factor
        else:
            channel.long_correction = factor


def way_between(one: TrueState, other: TrueState) -> float:
    """Distance in m."""
    return hypot(one.x_m - other.x_m, one.y_m - other.y_m)
