# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The common part of both Teensys: lines, clock, subscriptions, identity, configuration memory.

A control cycle is a millisecond of the Teensy's clock. This module must not know sensors or motors.
"""

import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Generic, TypeVar

from omnibot_driver.simulator.common.casts import to_int32
from omnibot_driver.simulator.common.faults import FaultyLine, LineFaults
from omnibot_driver.simulator.fejemis import wire
from omnibot_driver.simulator.fejemis.config import DriveConfig, FrontConfig
from omnibot_driver.simulator.fejemis.settings import FejemisSettings

C = TypeVar("C", DriveConfig, FrontConfig)

STEP_S = 0.001
HEARTBEAT_MS = 400
LONGEST_NAME = 31
WITHOUT_NUMBERS = frozenset(
    {
        "acccal2", "eer", "eew", "enc0", "gyroc", "hcsr", "help", "leave", "leds", "on", "pds",
        "start", "stop",
    }
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Obeyed:
    """A command that a Teensy executed ``at_s`` seconds after construction."""

    at_s: float
    text: str


class Teensy(Generic[C]):
    """The common part of the drive and the front Teensy.

    * ``commands``: executed lines, newest last.
    * ``received``: all bytes that have reached the Teensy.

    States that the caller may change at any time:

    * ``sums``: lines carry checksums.
    * ``silent``: the Teensy obeys, but sends nothing.
    * ``hung``: the Teensy neither obeys nor sends; the motors keep their last speeds.
    * ``unplugged``: the cable is unplugged.
    * ``powered``: the Teensy has power.
    """

    version = 0
    help_text = ""

    def __init__(self, settings: FejemisSettings, place: int, config: C) -> None:
        self.settings, self.firmware = settings, settings.firmware
        self.sums = self.firmware.sums
        self.silent = self.hung = self.unplugged = False
        self.powered = True
        self.commands: deque[Obeyed] = deque(maxlen=100_000)
        self.received = bytearray()
        self.unhandled = 0
        """How many lines the Teensy did not recognise."""
        self.inbound = FaultyLine(
            LineFaults(lose=settings.lose_inbound), f"fejemis inbound {settings.seed} {place}"
        )
        self._rate = 1.0 + settings.clock_ppm[place] * 1e-6
        self._factory: C = config
        self.saved: C = config
        """Contents of the configuration memory."""
        self._reader = wire.LineReader()
        self._arrived: list[str] = []
        self._out = bytearray()
        self._told_s = 0.0
        self._commands = dict(sorted(self.commands_table().items(), key=lambda row: -len(row[0])))
        self._items = self.items()
        self.config: C = config
        self._restart(settings.uptime_s)

    # What each kind of Teensy extends

    def items(self) -> dict[str, Callable[[], str]]:
        """Return, for each line that the host can request, the function that writes the line.

        The keys are the lines' names, as in the command ``sub``.
        """
        return {
            "ver": lambda: f"ver {self.version} Fejemis {self.config.name} {self.version / 100}",
            "id": lambda: f"id {self.config.name} {self.config.number}",
        }

    def commands_table(self) -> dict[str, Callable[[str], None]]:
        """Return the functions that execute the commands, by the first word of a line.

        Each function receives the rest of the line.
        """
        return {
            "sub": self._subscribe,
            "leave": lambda _: self._leave(),
            "help": lambda _: self._help(),
            "setid": self._set_id,
            "setname": self._set_name,
            "eew": lambda _: self._save(),
            "eer": lambda _: self._load(),
        }

    def boot(self) -> None:
        """Reset the state, as after switching on."""

    def started(self) -> None:
        """Set the state that this Teensy has at the end of each boot."""

    def cycle(self) -> None:
        """Run one control cycle."""

    # Time

    @property
    def clock_s(self) -> float:
        """Time since the boot in s, by the Teensy's own clock."""
        return self._clock_s

    def clock_text(self, digits: int) -> str:
        """Return the time of the Teensy's clock as text, with ``digits`` decimals."""
        time_s = self._clock_s
        if self.firmware.single_precision:
            (time_s,) = struct.unpack("f", struct.pack("f", time_s))
        return f"{time_s:.{digits}f}"

    def reboot(self) -> None:
        """Switch the Teensy off and on again. Configuration that was not saved is lost."""
        self._restart(0.0)

    def _restart(self, uptime_s: float) -> None:
        self.config = self.saved
        self._reader.clear()
        self._arrived.clear()
        self._clock_s = uptime_s
        self._cycles = round(uptime_s / STEP_S)
        self._periods_ms: dict[str, int] = {"hbt": HEARTBEAT_MS}
        self._due_ms: dict[str, float] = {"hbt": self._cycles + HEARTBEAT_MS}
        self._next_ms = self._due_ms["hbt"]
        self._booted = uptime_s > self.settings.boot_s
        self.boot()

    # Bytes

    def receive(self, data: bytes) -> None:
        """Receive bytes from the cable."""
        if self.unplugged or not self.powered:
            return
        data = self.inbound.carry(data)
        self.received += data
        if not self.hung and self._booted:
            self._arrived += self._reader.feed(data)

    def step(self, now_s: float) -> bytes:
        """Advance by one millisecond, which ends at ``now_s``; return the bytes that are sent."""
        if not self.powered:
            return b""
        self._told_s = now_s
        self._clock_s += STEP_S * self._rate
        while self._clock_s >= (self._cycles + 1) * STEP_S:  # true 0 to 2 times
            self._cycles += 1
            self._next_cycle()
        if not self._out:
            return b""
        data = bytes(self._out)
        self._out.clear()
        return b"" if self.unplugged or self.silent or self.hung else data

    def say(self, text: str) -> None:
        """Send a line of text."""
        self._out += wire.line(text, sums=self.sums, carriage_return=self.firmware.carriage_return)

    def _next_cycle(self) -> None:
        if not self._booted:
            if self._clock_s < self.settings.boot_s:
                return
            self._booted = True
            self.started()
            if self.firmware.says_start:
                self.say("# Starting main loop")
        if self._arrived and not self.hung:
            arrived, self._arrived = self._arrived, []
            for text in arrived:
                self._take(text)
        self.cycle()
        if self._cycles >= self._next_ms:
            self._service_subscriptions()

    def _service_subscriptions(self) -> None:
        for key, due_ms in list(self._due_ms.items()):
            if self._cycles >= due_ms:
                self.say(self._items[key]())
                self._due_ms[key] = due_ms + self._periods_ms[key]
        self._next_ms = min(self._due_ms.values(), default=inf)

    # Lines

    def _take(self, text: str) -> None:
        body = text
        if self.sums:
            check, body, should = wire.checked(text)
            if check is wire.Check.WRONG:
                self.say(f"# CRC failed ({should:02d} != {text[1:3]})")
                return
            if check is wire.Check.ABSENT:
                self.say("# processing under protest - no CRC")
        if self.firmware.confirms and body.startswith("!"):
            self.say(f"confirm {body}")
            body = body[1:]
        self._execute(body)

    def _execute(self, body: str) -> None:
        word = body.split(" ", 1)[0]
        if word.endswith("i") and word[:-1] in self._items:
            self.commands.append(Obeyed(self._told_s, body))
            self.say(self._items[word[:-1]]())
            return
        for name, execute in self._commands.items():  # longest name first
            if body.startswith(name) and not (self._is_exact(name) and body != name):
                self.commands.append(Obeyed(self._told_s, body))
                execute(body[len(name) :])
                return
        if not body.startswith("#"):
            self.unhandled += 1
            self.say(f"# {self.clock_text(4)} unhandled: '{body}'")

    def _is_exact(self, name: str) -> bool:
        return self.firmware.exact_words and name in WITHOUT_NUMBERS

    def _subscribe(self, rest: str) -> None:
        words = rest.split()
        key = words[0] if words else ""
        if key not in self._items:
            self.unhandled += 1
            self.say(f"# {self.clock_text(4)} unhandled: 'sub{rest}'")
            return
        period_ms = to_int32(next(iter(wire.numbers(rest.partition(key)[2])), 0.0))
        self._due_ms.pop(key, None)
        if period_ms > 0:
            self._periods_ms[key] = period_ms
            self._due_ms[key] = self._cycles + period_ms
        self._next_ms = min(self._due_ms.values(), default=inf)

    @property
    def subscriptions(self) -> dict[str, int]:
        """Period of each subscription in ms, by the name of its line."""
        return {key: self._periods_ms[key] for key in self._due_ms}

    def _leave(self) -> None:
        self._due_ms.clear()
        self._next_ms = inf

    def _help(self) -> None:
        for text in self.help_text.splitlines():
            self.say(text)

    # Configuration

    def _set_id(self, rest: str) -> None:
        number = to_int32(next(iter(wire.numbers(rest)), 0.0))
        if number == 0:
            self.config = self.saved = replace(self._factory, number=0)
        else:
            self.config = replace(self.config, number=number)

    def _set_name(self, rest: str) -> None:
        self.config = replace(self.config, name=rest.strip()[:LONGEST_NAME])

    def _save(self) -> None:
        if self.config.number > 0:
            self.saved = self.config

    def _load(self) -> None:
        self.config = self.saved
