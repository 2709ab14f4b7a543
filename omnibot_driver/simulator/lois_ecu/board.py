# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated LOIS ECU and its robot, which advance in steps of a millisecond.

The simulation is deterministic. Three assumptions are not in the manual:

* Set-points never expire.
* Ticks wrap at 2³².
* The e-stop button zeroes set-points when it is pressed and when it is released.

This module does not know ports or real time.
"""

from collections import deque
from random import Random

from omnibot_driver.simulator.common.board import Channel, Packet
from omnibot_driver.simulator.lois_ecu import wire
from omnibot_driver.simulator.lois_ecu.commands import Commands, Obeyed, Parts
from omnibot_driver.simulator.lois_ecu.odometry import FirmwareOdometry, odometry_of
from omnibot_driver.simulator.lois_ecu.records import Recorder
from omnibot_driver.simulator.lois_ecu.sayings import Sayings
from omnibot_driver.simulator.lois_ecu.sensors import Compass, sentence
from omnibot_driver.simulator.lois_ecu.settings import LoisSettings
from omnibot_driver.simulator.lois_ecu.terminal import COMPASS, GPS, Terminal
from omnibot_driver.simulator.lois_ecu.timers import Timers
from omnibot_driver.simulator.lois_ecu.tuning import CORRECTIONS, wheels_of
from omnibot_driver.simulator.lois_ecu.uart import Uart
from omnibot_driver.simulator.lois_ecu.vehicle import Edge, TrueState, Vehicle

CHANNELS = (Channel(),)
STEP_S = 0.001
STEPS_PER_TICK = 10
BOOT_S = 2.0
GPS_SENTENCE_S = 1.0


class SimulatedLois:
    """One board with its robot.

    * ``tick``: number of ticks of 10 ms since construction.
    * ``commands``: valid lines that the board processed, newest last.
    * ``motors``: the true motors.
    * ``wheels``: the wheels as the board measures them.
    """

    channels = CHANNELS
    tick_s = STEP_S * STEPS_PER_TICK

    def __init__(self, settings: LoisSettings | None = None) -> None:
        self.settings = settings = LoisSettings() if settings is None else settings
        self.tick = 0
        self.commands: deque[Obeyed] = deque(maxlen=100_000)
        self._uart = Uart(loses=settings.quirks.deaf_while_sending)
        self.pressed = False
        self._obedience = Commands(settings.quirks)
        self._steps = 0
        self._random = Random(f"lois {settings.seed}")
        self._vehicle = Vehicle(settings, CORRECTIONS, self._random)
        self._control_period_s = 0.091 if settings.quirks.fast_control else 0.2
        self.motors = self._vehicle.motors
        self._boot()
        if settings.running:
            self._boots_until_s = self._compass_at_s = 0.0

    def reboot(self) -> None:
        """Switch the board off and on. The robot keeps its true pose."""
        self._boot()

    def _boot(self) -> None:
        settings, quirks = self.settings, self.settings.quirks
        self.wheels = wheels_of(quirks, settings.steps)
        self.odometry = odometry_of(settings)
        self._compass = Compass(
            settings.heading_noise_deg,
            over_north=quirks.headings_average_over_north,
            random=self._random,
        )
        self._sayings = Sayings(
            settings, self._vehicle, self.wheels, self.odometry, self._compass, self.now_s
        )
        self._applied_duty = (0, 0)
        self._boots_until_s = self.now_s + (BOOT_S if quirks.slow_boot else 0.0)
        self._reader = wire.LineReader(lenient=quirks.lenient_hex)
        self._uart.boot()
        self._obedience.boot()
        self._pending: dict[int, Edge] = {}
        self._clock_ms = 0
        self._timers = Timers()
        self._scan: list[int] = []
        self._control_late = False
        self._control_at_s = self._gps_at_s = self.now_s
        self._compass_at_s = self._boots_until_s
        self._terminal = Terminal(quirks)
        self._button_pressed = False
        self._button_news: bool | None = None
        self._records = Recorder(quirks, self.wheels)
        self._parts = Parts(
            self.wheels, self.odometry, self._timers, self._terminal, self._reader, self._records
        )

    @property
    def now_s(self) -> float:
        """Board time since construction, in s."""
        return self._steps * STEP_S

    @property
    def truth(self) -> TrueState:
        """True pose and motion of the robot."""
        return self._vehicle.truth

    @property
    def received(self) -> bytearray:
        """All bytes that were sent to the port."""
        return self._uart.received

    @property
    def lost_bytes(self) -> int:
        """Number of bytes that were sent to the board and that the board has lost."""
        return self._uart.lost_bytes

    @property
    def terminal_mode(self) -> int:
        """Terminal mode that the last command 0x11 set.

        In modes other than 0 and 4, the board sends no periodic messages and no records. With the
        quirk ``button_is_lost_in_terminal_mode``, it does not report the e-stop button either.
        """
        return self._terminal.mode

    @property
    def led(self) -> bool:
        """Whether the board's LED is on."""
        return self._obedience.led

    @property
    def balls(self) -> int:
        """Number of balls dropped."""
        return self._obedience.balls

    @property
    def driven(self) -> bool:
        """Whether at least one motor has power."""
        return any(self._applied_duty)

    @property
    def standing(self) -> bool:
        """Whether both wheels are truly at rest."""
        return self._vehicle.standing

    def press(self, pressed: bool) -> None:
        """Press or release the e-stop button."""
        self.pressed = pressed
        self._button_pressed = True
        if not (self._uart.deaf and self.settings.quirks.button_waits_while_sending):
            self._serve_button()

    def _serve_button(self) -> None:
        self._button_pressed = False
        self._button_news = self.pressed
        self._applied_duty = (0, 0)
        for channel in self.wheels:
            channel.release()

    def hold(self, *, left: bool = False, right: bool = False) -> None:
        """Block each wheel whose argument is true, and release the others."""
        self.motors[0].held, self.motors[1].held = left, right

    def receive(self, data: bytes, now: float | None = None, channel: int = 0) -> None:
        """Begin to receive ``data`` at 115200 baud. ``now`` and ``channel`` are ignored."""
        self._uart.receive(data)

    def advance(self) -> list[Packet]:
        """Advance by one tick. Return the bytes sent in this tick as one packet, if any."""
        data = self.step()
        return [(0, data)] if data else []

    @property
    def facts(self) -> dict[str, object]:
        """Facts that the simulator's console prints."""
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
        """Advance by one tick of 10 ms. Return the bytes sent in this tick."""
        self.tick += 1
        sent = bytearray()
        uart, vehicle, terminal = self._uart, self._vehicle, self._terminal
        for _ in range(STEPS_PER_TICK):
            self._steps += 1
            now_s = self.now_s
            for edge in vehicle.advance(self._applied_duty, now_s, STEP_S):
                self._edge(edge, edge.at_s)
            if heard := uart.listen():
                terminal.heard(heard)
            if now_s < self._boots_until_s:
                self._clock_ms += 1
                continue
            self._interrupts(now_s)
            if uart.send(sent):
                self._catch_up()
            if not uart.sending and not terminal.busy:
                self._main_loop()
        return bytes(sent)

    # Interrupts

    def _edge(self, edge: Edge, at_s: float) -> None:
        if self.now_s < self._boots_until_s:
            return
        if self._uart.deaf:
            self._pending[edge.index] = edge
            return
        if self.settings.quirks.deaf_while_counting:
            self._uart.miss()
        self.wheels[edge.index].edge(at_s, edge.is_long, edge.direction)
        if isinstance(self.odometry, FirmwareOdometry):
            self.odometry.tick(at_s, self.wheels[0].rpm, self.wheels[1].rpm)

    def _interrupts(self, now_s: float) -> None:
        deaf = self._uart.deaf
        if not (deaf and self.settings.quirks.clock_stops_while_sending):
            self._clock_ms += 1
        if now_s >= self._control_at_s + self._control_period_s:
            self._control_at_s += self._control_period_s
            self._control_late = True
        if self._control_late and not deaf:
            self._control_late = False
            for channel in self.wheels:
                channel.settle(now_s)
                channel.control()
            left, right = self.wheels
            self._applied_duty = (left.duty_percent, right.duty_percent)
            self._records.control()
        if self._steps % 5 == 0 and not isinstance(self.odometry, FirmwareOdometry):
            self.odometry.move(*(channel.turned_ticks for channel in self.wheels))
            self.odometry.measure(*(channel.exact_rpm for channel in self.wheels))
            for channel in self.wheels:
                channel.turned_ticks = 0
        if now_s >= self._compass_at_s + self.settings.compass_period_s:
            self._compass_at_s += self.settings.compass_period_s
            self._compass_reads()
        if now_s >= self._gps_at_s + GPS_SENTENCE_S:
            self._gps_at_s = now_s
            fix = self._sayings.fix(now_s)
            clock = "".join(f"{number:02d}" for number in fix.time)
            self._pass_on(self._terminal.sensor(GPS, sentence(f"GPRMC,{clock}.00,A")))
        self._pass_on(self._terminal.mixed())

    def _compass_reads(self) -> None:
        heading = self._compass.read(self.truth.yaw_rad)
        self._pass_on(self._terminal.sensor(COMPASS, sentence(f"HCHDT,{heading % 360}.0,T")))
        self._say_record(self._records.heading(heading))

    def _pass_on(self, data: bytes) -> None:
        if data:
            self._uart.say(data, deaf=False)

    def _catch_up(self) -> None:
        """Run the interrupt routines that had to wait while interrupts were off."""
        pending, self._pending = self._pending, {}
        for edge in pending.values():
            self._edge(edge, self.now_s)
        self._terminal.heard(self._uart.hear_kept())
        if self.settings.quirks.clock_stops_while_sending:
            self._clock_ms += 1
        if self._button_pressed:
            self._serve_button()

    # The main loop

    def _main_loop(self) -> None:
        """Run the main loop for 1 ms, in which it checks all timers at most twice.

        The first check may continue a check from an earlier step.
        """
        for _ in range(2):
            if not self._scan:
                if self._uart.input:
                    self._read_input()
                if self._records.number is not None:
                    self._say_record(self._records.of_wheels())
                if self._uart.sending or self._timers.any_due(self._clock_ms):
                    self._scan = list(self._timers)
                elif self._button_news is None:
                    return
            while self._scan and not self._uart.sending:
                self._periodic(self._scan.pop(0))
            if not self._scan and not self._uart.sending and self._button_news is not None:
                pressed, self._button_news = self._button_news, None
                self._say(wire.line(0x05, int(pressed)), deaf=False, button=True)

    def _read_input(self) -> None:
        while self._uart.input and not self._uart.sending:
            found = self._reader.take(self._uart.input.popleft())
            if found is not None:
                self._obey(*found)

    def _say(self, data: bytes, *, deaf: bool = True, button: bool = False) -> None:
        if self._terminal.on and not (
            button and not self.settings.quirks.button_is_lost_in_terminal_mode
        ):
            return
        deaf = deaf and (
            self.settings.quirks.deaf_while_sending
            or self.settings.quirks.clock_stops_while_sending
        )
        self._uart.say(data, deaf=deaf)

    def _periodic(self, code: int) -> None:
        if self._timers.take(code, self._clock_ms):
            self._say(self._sayings.group(code, self._clock_ms, self.now_s))

    def _say_record(self, data: bytes) -> None:
        """Send a complete record. The periods of all periodic messages then start again."""
        if data:
            self._say(data)
            self._timers.restart(self._clock_ms)

    def _obey(self, command: int, payload: int) -> None:
        self.commands.append(Obeyed(self.tick, command, payload))
        self._obedience.obey(self._parts, command, payload, self.now_s, self._clock_ms)
