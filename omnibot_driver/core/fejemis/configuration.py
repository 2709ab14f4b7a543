# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What the boards keep: read from them, and written only where the user has set it.

What was written is read back; it is written again until it is there, and after each restart. A
number is believed that was read twice alike, one reading after the other: one in 99 damaged answers
passes its sum, and the geometry is computed with what is read. Knows which line asks for what, and
which numbers answer.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.fejemis.half import Role
from omnibot_driver.core.fejemis.messages import (
    FrontWheelOffset,
    Infrared,
    Message,
    Status,
    SteeringConfiguration,
    WheelConfiguration,
)
from omnibot_driver.core.fejemis.settings import Written
from omnibot_driver.core.fejemis.steering import Geometry

ASKED: Final[Mapping[Role, tuple[bytes, ...]]] = {
    "drive": (b"confsi", b"confi", b"gyrooi", b"accoi", b"magoi", b"cpdrivei"),
    "front": (b"confsi", b"fwoi", b"cpsteeri", b"iri"),
}
"""What asks for the configuration."""
ON: Final[Mapping[Role, tuple[Written, ...]]] = {
    "drive": (Written.WHEELS, Written.STEERING, Written.MAGNETOMETER, Written.ACCELEROMETER),
    "front": (Written.STEERING, Written.FRONT_WHEEL, Written.INFRARED, Written.STEERING_GAINS),
}
EVERY_S: Final = 0.25
TRIES: Final = 12
NEAR: Final = 2e-3
"""Part of a number by which it may be read back otherwise, as it is printed with few digits."""
DIGIT: Final = 6e-4


class Configuration:
    """Of one board. ``told``: its numbers as they were read twice, by what they are."""

    def __init__(self, role: Role, written: Mapping[Written, tuple[float, ...]]) -> None:
        self.role: Role = role
        self.told: dict[str, tuple[float, ...]] = {}
        self._once: dict[str, tuple[float, ...]] = {}
        """The last reading of each."""
        self.turned = False
        """``confs`` is sent in the order in which it is written, not in that of the help text."""
        self.written = written
        self.begin()

    def begin(self) -> None:
        """The board is new, or has loaded another configuration: read all, write what is set."""
        self.told.clear()
        self._once.clear()
        self._next_at = -math.inf
        self._tries = 0
        self._new = True
        self.failed: list[Written] = []
        """What could not be read back."""

    def configure(self, written: Mapping[Written, tuple[float, ...]]) -> None:
        """Other values, from now on."""
        if written != self.written:
            self.written, self._new = written, False
            self._next_at, self._tries, self.failed = -math.inf, 0, []

    @property
    def wake_at(self) -> float:
        """When ``due`` has something."""
        return self._next_at

    @property
    def known(self) -> bool:
        """Whether all was read, and what was written is there."""
        return not self._missing() and not self._unwritten()

    @property
    def pending(self) -> bool:
        """Whether a new board may still lack what the user has set: it is not to be driven."""
        if self._new and (self._next_at == math.inf or not self._unwritten()):
            self._new = False
        return self._new

    def due(self, now: float, *, stands: bool) -> list[bytes]:
        """Lines to write now: while the robot moves, nothing is written."""
        if now < self._next_at:
            return []
        missing, unwritten = self._missing(), self._unwritten()
        if not (missing or unwritten) or self._tries >= TRIES:
            self.failed = unwritten
            self._next_at = math.inf
            return []
        self._next_at = now + EVERY_S
        if unwritten and not stands:
            return list(missing)
        self._tries += 1
        texts = [
            text_of(setting, self.written[setting])
            for setting in unwritten
            if not self._agrees(setting, self._once)
        ]
        asked = [_ASKS[setting] for setting in unwritten]
        return [*texts, *dict.fromkeys([*missing, *asked])]

    def hear(self, message: Message) -> None:
        """What the board tells of it."""
        match message:
            case WheelConfiguration():
                key, numbers = "conf", message.numbers
            case SteeringConfiguration():
                key, numbers = "confs", (message.first_m, message.second_m)
            case FrontWheelOffset():
                key, numbers = "fwo", (message.offset_deg, float(message.inverted))
            case Infrared():
                key, numbers = "ir", message.calibration
            case Status() if message.keyword in _SHOWN:
                key, numbers = message.keyword, message.numbers
            case _:
                return
        before, self._once[key] = self._once.get(key), numbers
        if numbers != before:
            return
        self.told[key] = numbers
        if "conf" in self.told and "confs" in self.told:  # which also tells the track
            track_m, told = self.told["conf"][4], self.told["confs"]
            self.turned = abs(told[0] - track_m) < DIGIT < abs(told[1] - track_m)

    @property
    def geometry(self) -> Geometry | None:
        """B and F as the board computes with them; None where it has not told."""
        if Written.STEERING in self.written:
            return Geometry(*self.written[Written.STEERING])
        if "confs" not in self.told:
            return None
        front_m, track_m = self.told["confs"][:: -1 if self.turned else 1]
        return Geometry(track_m, front_m)

    def _missing(self) -> list[bytes]:
        return [text for text in ASKED[self.role] if _KEY[text] not in self.told]

    def _unwritten(self) -> list[Written]:
        return [
            setting
            for setting in ON[self.role]
            if setting in self.written and not self._agrees(setting, self.told)
        ]

    def _agrees(self, setting: Written, readings: Mapping[str, tuple[float, ...]]) -> bool:
        told = readings.get(_KEY[_ASKS[setting]])
        wanted = self.written[setting]
        if told is None:
            return False
        if setting is Written.STEERING and not self.turned:
            told = told[::-1]
        if setting is Written.ACCELEROMETER:
            wanted = wanted[:3]
        return len(told) >= len(wanted) and all(
            abs(one - other) <= max(DIGIT, NEAR * abs(other))
            for one, other in zip(told, wanted, strict=False)
        )


def text_of(setting: Written, numbers: tuple[float, ...]) -> bytes:
    """The line that writes it."""
    words = " ".join(f"{number:.6g}" for number in numbers)
    return f"{setting.command} {words}".encode("ascii")


_KEY: Final[Mapping[bytes, str]] = {
    text: text.decode("ascii")[:-1] for texts in ASKED.values() for text in texts
}
"""By the line that asks: the keyword of its answer."""
_ASKS: Final[Mapping[Written, bytes]] = {
    Written.WHEELS: b"confi",
    Written.STEERING: b"confsi",
    Written.FRONT_WHEEL: b"fwoi",
    Written.INFRARED: b"iri",
    Written.MAGNETOMETER: b"magoi",
    Written.ACCELEROMETER: b"accoi",
    Written.STEERING_GAINS: b"cpsteeri",
}
_SHOWN: Final = frozenset(_KEY.values())
