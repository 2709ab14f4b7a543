# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Splits the bytes from one board into lines, checks the lines, and counts the damaged ones.

No input raises an error. At most ``LONGEST_LINE`` bytes are held between calls.
"""

from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.fejemis.codec import parse
from omnibot_driver.core.fejemis.forms import Forms
from omnibot_driver.core.fejemis.messages import Comment, Heartbeat, Message
from omnibot_driver.core.fejemis.settings import LineSums
from omnibot_driver.core.fejemis.sums import without_sum

LONGEST_LINE: Final = 200
"""Largest accepted length of a line in characters: the size of the boards' own buffers."""
CHANGED_AFTER: Final = 2
"""Number of contradicting heartbeats in a row after which the decoder changes ``sums``.

``sums`` says whether the board's lines have checksums. While ``sums`` is unknown, one heartbeat
decides.
"""


@dataclass(slots=True)
class DecoderStatistics:
    """Counters of one board's lines, which continue over all connections.

    ``faults``: how many lines were damaged or of an unknown kind.
    """

    faults: int = 0
    discarded_bytes: int = 0


class FejemisDecoder:
    """Decoder of the lines from one board.

    * ``sums``: whether the board's lines have checksums; None while unknown.
    * ``changed``: whether ``sums`` has changed. The caller resets this flag.
    * ``doubtful``: whether the last line except heartbeats contradicts the learnt ``sums``
      (``line_sums`` is auto).
    * ``contradicted``: whether the last line contradicts the user's setting (``line_sums`` is on or
      off).
    """

    def __init__(self, line_sums: LineSums = "auto") -> None:
        self.statistics = DecoderStatistics()
        self.changed = self.doubtful = self.contradicted = False
        self._held = b""
        self._cut = False
        """Whether the beginning of the current line was discarded because the line is too long."""
        self._forms = Forms()
        self.line_sums = line_sums

    @property
    def line_sums(self) -> LineSums:
        """The user's setting: checksums are on or off, or the heartbeats decide (auto)."""
        return self._line_sums

    @line_sums.setter
    def line_sums(self, line_sums: LineSums) -> None:
        self._line_sums: LineSums = line_sums
        self.sums = None if line_sums == "auto" else line_sums == "on"
        self._otherwise = 0

    def feed(self, data: bytes, now: float) -> list[Message]:
        """Decode ``data``, and return the messages of its complete lines, in order of arrival."""
        *lines, rest = (self._held + data).split(b"\n")
        found = []
        for line in lines:
            too_long = self._cut or len(line) > LONGEST_LINE
            self._cut = False
            message = None if too_long else self._take(line)
            if message is not None:
                found.append(message)
            elif too_long or line.strip(b"\r \0"):
                self._damaged(len(line) + 1)
        if len(rest) > LONGEST_LINE:
            self.statistics.discarded_bytes += len(rest)
            rest, self._cut = b"", True
        self._held = rest
        return found

    def flush(self, now: float) -> list[Message]:
        """Discard an incomplete line, because the port is closed; return an empty list."""
        if self._held or self._cut:
            self._damaged(len(self._held))
        self._held, self._cut = b"", False
        return []

    def _take(self, line: bytes) -> Message | None:
        line = line.rstrip(b"\r").lstrip(b"\r\0")
        text, right = without_sum(line)
        if right is False or not text.isascii():
            return None
        message = parse(text.decode("ascii"))
        if message is None:
            return None
        if isinstance(message, Heartbeat):
            self._learn(with_sum=right is not None)
        elif self.sums is not None and self.sums is not (right is not None):
            self.contradicted = self._line_sums != "auto"
            self.doubtful = not self.contradicted
            return None
        else:
            self.doubtful = self.contradicted = False
        if not isinstance(message, Comment) and not self._forms.admit(text, summed=right is True):
            return None
        return message

    def _learn(self, *, with_sum: bool) -> None:
        """Learn from a heartbeat whether the board sends checksums, or check the user's setting.

        ``with_sum``: whether this heartbeat has a checksum.
        """
        if self._line_sums != "auto":
            self.contradicted = with_sum is not self.sums
            return
        if with_sum is self.sums:
            self._otherwise = 0
            return
        self._otherwise += 1
        if self.sums is None or self._otherwise >= CHANGED_AFTER:
            self.changed = self.sums is not None
            self.sums, self._otherwise, self.doubtful = with_sum, 0, False

    def _damaged(self, length: int) -> None:
        self.statistics.faults += 1
        self.statistics.discarded_bytes += length
