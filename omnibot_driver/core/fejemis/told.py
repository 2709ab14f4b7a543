# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Notices for the user of a Fejemis. Each text is shown at most once in 10 s (``TELL_EVERY_S``).

A notice that makes the driver stop the robot is never left out. Its text is empty if the user has
seen the text in the last 10 s.
"""

import math
from typing import Final

from omnibot_driver.core.readings import NoticeReading

TELL_EVERY_S: Final = 10.0
"""Shortest time in s between two notices with the same text."""


class Told:
    """Collects notices.

    ``notices``: the notices that the caller has not taken yet.
    """

    def __init__(self) -> None:
        self.notices: list[NoticeReading] = []
        self._told_at: dict[str, float] = {}

    def halt(self, text: str, now: float) -> None:
        """Add a notice that makes the driver stop the robot; ``text`` gives the reason."""
        self.notices.append(NoticeReading(self._news(text, now), halt=True))

    def tell(self, text: str, now: float) -> None:
        """Add a notice with this text, unless the same text was shown in the last 10 s.

        The notice does not make the driver stop the robot.
        """
        if text := self._news(text, now):
            self.notices.append(NoticeReading(text, halt=False))

    def remark(self, text: str) -> None:
        """Add a notice that is shown only once."""
        if text not in self._told_at:
            self._told_at[text] = math.inf
            self.notices.append(NoticeReading(f"{text} (reported once)", halt=False))

    def _news(self, text: str, now: float) -> str:
        if now - self._told_at.get(text, -math.inf) < TELL_EVERY_S:
            return ""
        self._told_at[text] = now
        return text
