# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Requests the values that are only shown in diagnostics, one after the other.

The module also requests the measurements of the sonar, one request for each measurement.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.fejemis.half import Role
from omnibot_driver.core.fejemis.messages import Battery, Message, Status, Words

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
"""Requests for each board. They are sent in this order, again and again."""
WITH_SUMS: Final = (b"svpi", b"svjti")
"""Requests that are sent only with a checksum. Without a checksum, the loss of the last letter
would turn such a request into a command to the servo."""
EVERY_S: Final = 0.5
SONAR_EVERY_S: Final = 0.1


class Polls:
    """The requests to one board.

    ``told``: the board's last answers as text. The keys are the keywords of the answers.
    """

    def __init__(self, role: Role) -> None:
        self.told: dict[str, str] = {}
        self._role: Role = role
        self.begin()

    def begin(self) -> None:
        """Forget all answers, and begin with the first request: the board is new or restarted."""
        self.told.clear()
        self._turn = 0
        self._next_at = self._sonar_at = -math.inf

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        return min(self._next_at, self._sonar_at) if self._role == "drive" else self._next_at

    def due(self, now: float, *, sums: bool, unknown: Mapping[str, None]) -> list[bytes]:
        """Return the lines to send now.

        * ``sums``: whether lines to the board carry a checksum.
        * ``unknown``: lines that the firmware does not know. They are not sent.
        """
        texts = []
        if self._role == "drive" and now >= self._sonar_at:
            self._sonar_at = now + SONAR_EVERY_S
            texts.append(b"hcsr")
        if now >= self._next_at:
            self._next_at = now + EVERY_S
            text = ASKED[self._role][self._turn % len(ASKED[self._role])]
            self._turn += 1
            if text.decode("ascii") not in unknown and (sums or text not in WITH_SUMS):
                texts.append(text)
        return texts

    def hear(self, message: Message) -> None:
        """Store the answer to a request as text; ignore other messages."""
        if isinstance(message, Status):
            self.told[message.keyword] = " ".join(f"{number:g}" for number in message.numbers)
        elif isinstance(message, Words):
            self.told[message.keyword] = message.text
        elif isinstance(message, Battery):
            self.told["bat"] = f"{message.volts:g} {message.amps:g} {message.cells}"
