# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What only diagnostics show, asked for one after the other, and the trigger of the sonar."""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.fejemis.half import Role
from omnibot_driver.core.fejemis.messages import Message, Status, Words

ASKED: Final[Mapping[Role, tuple[bytes, ...]]] = {
    "drive": (
        b"idi", b"veri", b"adci", b"inti", b"timei", b"ampi", b"cvdrivei", b"enci", b"magwi",
        b"tof1i",
    ),
    "front": (
        b"idi", b"veri", b"adci", b"inti", b"timei", b"curi", b"moti", b"svpi", b"svjti",
        b"cvsteeri", b"bati",
    ),
}  # fmt: skip
"""In this order, round and round."""
WITH_SUMS: Final = (b"svpi", b"svjti")
"""Without its last character each is a command, which sets the servo."""
EVERY_S: Final = 0.5
SONAR_EVERY_S: Final = 0.1


class Polls:
    """Of one board. ``told``: what it answered last, by keyword, as text."""

    def __init__(self, role: Role) -> None:
        self.told: dict[str, str] = {}
        self._role: Role = role
        self._unknown: set[bytes] = set()
        self.begin()

    def begin(self) -> None:
        """The board is new."""
        self._turn = 0
        self._next_at = self._sonar_at = -math.inf

    @property
    def wake_at(self) -> float:
        """When ``due`` has something."""
        return min(self._next_at, self._sonar_at) if self._role == "drive" else self._next_at

    def unknown(self, words: Mapping[str, None]) -> None:
        """What the firmware does not know is asked no more."""
        self._unknown = {text for text in ASKED[self._role] if text.decode("ascii") in words}

    def due(self, now: float, *, sums: bool) -> list[bytes]:
        """Lines to write now. ``sums``: whether the board sees that one is damaged."""
        texts = []
        if self._role == "drive" and now >= self._sonar_at:
            self._sonar_at = now + SONAR_EVERY_S
            texts.append(b"hcsr")
        if now >= self._next_at:
            self._next_at = now + EVERY_S
            text = ASKED[self._role][self._turn % len(ASKED[self._role])]
            self._turn += 1
            if text not in self._unknown and (sums or text not in WITH_SUMS):
                texts.append(text)
        return texts

    def hear(self, message: Message) -> None:
        """An answer."""
        if isinstance(message, Status):
            self.told[message.keyword] = " ".join(f"{number:g}" for number in message.numbers)
        elif isinstance(message, Words):
            self.told[message.keyword] = message.text
