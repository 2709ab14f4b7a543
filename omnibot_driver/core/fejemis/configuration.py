# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reads the configuration that is stored on a board, and writes the user's values to the board.

Only two equal reports confirm a value: 1 in 99 damaged lines has a correct checksum.
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
    "drive": (b"confi", b"gyrooi", b"accoi", b"magoi", b"cpdrivei"),
    "front": (b"fwoi", b"cpsteeri", b"iri"),
}
"""Lines that request the configuration of each board. The line ``confs`` (steering geometry) is not
requested, because the board sends it regularly."""
ON: Final[Mapping[Role, tuple[Written, ...]]] = {
    "drive": (Written.WHEELS, Written.STEERING, Written.MAGNETOMETER, Written.ACCELEROMETER),
    "front": (Written.STEERING, Written.FRONT_WHEEL, Written.INFRARED, Written.STEERING_GAINS),
}
EVERY_S: Final = 0.25
TRIES: Final = 12
NEAR: Final = 2e-3
DIGIT: Final = 6e-4
"""``NEAR`` (relative), ``DIGIT`` (absolute): tolerances for a number that the board reports back.
The larger one applies, because the board prints few digits.
"""
HALF: Final = 0.51
"""Largest rounding error of a number that the board reports back, in units of its last digit.

The value is 0.5 for rounding plus 0.01 for single precision. Larger deviations are rejected if the
digits are known.
"""


class Configuration:
    """Configuration of one board.

    ``told``: numbers that the board has reported twice in a row, by the keyword of their line, such
    as ``conf``.
    """

    def __init__(self, role: Role, written: Mapping[Written, tuple[float, ...]]) -> None:
        self.role: Role = role
        self.told: dict[str, tuple[float, ...]] = {}
        self._once: dict[str, tuple[float, ...]] = {}
        """Numbers that the board reported last, by the keyword of their line. If the next report
        has the same numbers, they are confirmed, and ``told`` gets them.
        """
        self._digits: dict[str, tuple[float, ...]] = {}
        """Unit of the last printed digit of each number, such as 0.001 for ``0.420``, by the
        keyword of the line.
        """
        self.turned = False
        """Whether the board's ``confs`` line (steering geometry) has the track as its first number.
        The board's help text says that the track is the last number."""
        self.written = written
        self.begin()

    def begin(self) -> None:
        """Read the whole configuration of the board again, and write all settings again.

        The board may have lost the settings.
        """
        self.told.clear()
        self._once.clear()
        self._next_at = -math.inf
        self._tries = 0
        self._new = True
        # Boards report rounded numbers, so a small difference may be hidden. Each new board gets
        # all values.
        self._unsent = set(self.written)

    def configure(self, written: Mapping[Written, tuple[float, ...]]) -> None:
        """Replace the settings that are written to the board."""
        if written != self.written:
            changed = {one for one in written if written[one] != self.written.get(one)}
            self.written, self._unsent = written, self._unsent | changed
            self._next_at, self._tries = -math.inf, 0

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        return self._next_at

    @property
    def failed(self) -> list[Written]:
        """Settings that the driver could not write to the board; empty while it still tries."""
        return self._unwritten() if self._next_at == math.inf else []

    @property
    def pending(self) -> bool:
        """Whether motion is forbidden, because a new board may still lack the user's settings."""
        if self._new and (self._next_at == math.inf or not self._unwritten()):
            self._new = False
        return self._new

    def due(self, now: float, *, stands: bool) -> list[bytes]:
        """Return the lines to send now; settings are written only if the robot ``stands`` still."""
        if now < self._next_at:
            return []
        missing, unwritten = self._missing(), self._unwritten()
        if not (missing or unwritten) or self._tries >= TRIES:
            self._next_at = math.inf
            return []
        self._next_at = now + EVERY_S
        if unwritten and not stands:
            return list(missing)
        self._tries += 1
        for setting in self._unsent:
            self.told.pop(_REPORT[setting], None)
            self._once.pop(_REPORT[setting], None)
        self._unsent.clear()
        texts = [
            text_of(setting, self.written[setting])
            for setting in unwritten
            if not self._agrees(setting, self._once)
        ]
        keys = {_KEY[text] for text in missing} | {_REPORT[setting] for setting in unwritten}
        return [*texts, *(text for text in ASKED[self.role] if _KEY[text] in keys)]

    def hear(self, message: Message) -> None:
        """Receive a message. If it reports values of the configuration, store its numbers."""
        match message:
            case WheelConfiguration():
                key, numbers = "conf", message.numbers
                self._digits[key] = message.digits
            case SteeringConfiguration():
                key, numbers = "confs", (message.first_m, message.second_m)
                self._digits[key] = message.digits
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
        if "conf" in self.told and "confs" in self.told:  # conf reports the track too
            track_m, told = self.told["conf"][4], self.told["confs"]
            self.turned = abs(told[0] - track_m) < DIGIT < abs(told[1] - track_m)

    @property
    def geometry(self) -> Geometry | None:
        """Track B and wheelbase F in m, as the board uses them; None if they are unknown.

        The user's values apply until the board reports values that differ by more than rounding.
        """
        told, wanted = self.told.get("confs"), self.written.get(Written.STEERING)
        if wanted and (told is None or _near(told, wanted) or _near(told[::-1], wanted)):
            return Geometry(*wanted)
        if told is None:
            return None
        front_m, track_m = told[:: -1 if self.turned else 1]
        return Geometry(track_m, front_m)

    def _missing(self) -> list[bytes]:
        return [text for text in ASKED[self.role] if _KEY[text] not in self.told]

    def _unwritten(self) -> list[Written]:
        return [
            setting
            for setting in ON[self.role]
            if setting in self.written
            and (setting in self._unsent or not self._agrees(setting, self.told))
        ]

    def _agrees(self, setting: Written, readings: Mapping[str, tuple[float, ...]]) -> bool:
        told = readings.get(_REPORT[setting])
        digits = self._digits.get(_REPORT[setting], ())
        wanted = self.written[setting]
        if told is None:
            return False
        if setting is Written.STEERING and not self.turned:
            told, digits = told[::-1], digits[::-1]
        if setting is Written.ACCELEROMETER:
            wanted = wanted[:3]
        return _near(told, wanted, digits)


def text_of(setting: Written, numbers: tuple[float, ...]) -> bytes:
    """Return the line that writes ``numbers`` to the board as the values of ``setting``."""
    words = " ".join(f"{number:.6g}" for number in numbers)
    return f"{setting.value} {words}".encode("ascii")


def _near(
    told: tuple[float, ...], wanted: tuple[float, ...], digits: tuple[float, ...] = ()
) -> bool:
    """Return whether the board's numbers equal the wanted ones, except for rounding.

    ``digits``: for each number, the value of its last decimal place (0.01 for 1.23); empty if
    unknown.
    """
    exact = digits or (math.inf,) * len(wanted)
    return len(told) >= len(wanted) and all(
        abs(one - other) <= min(HALF * digit, max(DIGIT, NEAR * abs(other)))
        for one, other, digit in zip(told, wanted, exact, strict=False)
    )


_KEY: Final[Mapping[bytes, str]] = {
    text: text.decode("ascii")[:-1] for texts in ASKED.values() for text in texts
}
"""The keyword of the board's answer, by the line that requests a part of the configuration."""
_REPORT: Final[Mapping[Written, str]] = {
    Written.WHEELS: "conf",
    Written.STEERING: "confs",
    Written.FRONT_WHEEL: "fwo",
    Written.INFRARED: "ir",
    Written.MAGNETOMETER: "mago",
    Written.ACCELEROMETER: "acco",
    Written.STEERING_GAINS: "cpsteer",
}
"""For each setting: the keyword of the line that reports it."""
_SHOWN: Final = frozenset(_KEY.values())
