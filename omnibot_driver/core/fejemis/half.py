# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""One of the two boards (a *half*): its identity, its data streams, and its silence.

If a stream does not arrive, the driver subscribes again.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Final, Literal

from omnibot_driver.core.fejemis.decoder import DecoderStatistics, FejemisDecoder
from omnibot_driver.core.fejemis.messages import (
    BoardPose,
    Comment,
    Heartbeat,
    Message,
)
from omnibot_driver.core.fejemis.settings import LineSums
from omnibot_driver.core.fejemis.teensy_clock import EARLY_S, TeensyClock

Role = Literal["drive", "front"]
ROLES: Final[Mapping[int, Role]] = {90: "drive", 91: "front"}
"""The role of a board, by the identity in its heartbeats (manual, Meta info)."""
STREAMS: Final[Mapping[Role, Mapping[str, int]]] = {
    "drive": {
        "hbt": 400, "pose": 20, "vel": 20, "gyro": 10, "acc": 10, "imupose": 20, "mag": 100,
        "bat": 500, "tofd": 100, "sr04": 100, "confs": 200,
    },
    "front": {"hbt": 400, "fwl": 15, "ir": 100, "confs": 200},
}  # fmt: skip
"""The streams to subscribe to on each board, with their periods in ms.

The driver never sends ``confsi``, the request for ``confs``: if ``confsi`` lost its last letter,
the board would set its geometry to zero.
"""
SUBSCRIPTIONS: Final = {
    role: {key: f"sub {key} {period}" for key, period in streams.items()}
    for role, streams in STREAMS.items()
}
"""For each board and stream: the line that subscribes to it."""
NEEDED: Final[Mapping[Role, str]] = {"drive": "pose", "front": "fwl"}
"""For each board: the stream that must arrive while the robot is driven."""
TOGETHER: Final = ("gyro", "acc")
"""Streams that are subscribed in one packet, so that the board sends all of them in the same
cycle."""
AGAIN_S: Final = 0.5
SLOW: Final = 0.5
"""If fewer lines than this fraction of the expected number arrive, the driver subscribes again to
the stream that driving requires."""
ASK_AGAIN_S: Final = 0.1
"""Time in s between two requests for the heartbeat, while it is unknown whether the board has
restarted.
"""
MANY: Final = 30
"""How many damaged or unknown lines per second are tolerated. The drive board sends about 400 lines
per second, the front board about 85."""
SILENT_S: Final = 1.5
"""Time in s without a valid line, after which a board is regarded as silent."""
_UNHANDLED: Final = re.compile(r"unhandled: '(.*)'")


class Half:
    """State of one half: the drive board or the front board.

    * ``identity``: the identity in its heartbeats; None before the first heartbeat.
    * ``restarted``: whether the board has restarted. The caller resets this flag.
    * ``heard_at``: time in s of the last valid line.
    * ``clocks``: clocks from earlier connections, by identity; shared by both halves.
    """

    def __init__(self, line_sums: LineSums, clocks: dict[int, TeensyClock]) -> None:
        self.statistics = DecoderStatistics()
        self.clock = TeensyClock()
        self._clocks = clocks
        self.unknown_words: dict[str, None] = {}
        """Lines from the driver that the firmware does not know, from the oldest to the newest."""
        self.rejected = 0
        """Number of the driver's lines that the board has rejected as damaged."""
        self.identity: int | None = None
        self.role: Role | None = None
        """Role of the board; None while the identity is unknown, or is neither 90 nor 91."""
        self.begin(line_sums)

    def begin(self, line_sums: LineSums) -> None:
        """Begin a new connection. The half keeps its role until a heartbeat shows another one."""
        self.decoder = FejemisDecoder(line_sums)
        self.decoder.statistics = self.statistics
        self.clock.connect()
        if self.role is not None and self.identity is not None:
            self._clocks[self.identity] = self.clock
        self._clock_of: int | None = None
        """Identity of the board to which ``clock`` belongs; None before the first heartbeat."""
        self.unknown_words.clear()
        self.heartbeat: Heartbeat | None = None
        self.heard_at = -math.inf
        self.restarted = False
        self.ready = False
        """Whether the board sends the data stream that driving requires. A restart of the board
        resets this flag."""
        self._told: int | None = None
        self._started = False
        """Whether the board has sent its start message, but no heartbeat yet. Only the heartbeat
        shows which board has restarted."""
        self._counted_at, self._counted = -math.inf, 0
        self._left = False
        self._at: dict[str, float] = {}
        self._needed, self._needed_since, self._was_slow = 0, math.inf, False
        """``_needed``: number of lines of the required stream since the time ``_needed_since`` (in
        s; infinity before the first check). ``_was_slow``: whether the last check found too few
        lines.
        """
        self._next_at = -math.inf
        self._unsure_at: float | None = None
        self._ask_at = -math.inf

    @property
    def unsure(self) -> bool:
        """Whether the board may have restarted and lost the user's settings.

        The value becomes True when the board stops sending the data that driving requires, and
        False with a heartbeat that was sent later.
        """
        return self._unsure_at is not None

    @property
    def sums(self) -> bool:
        """Whether lines to the board carry a checksum."""
        return bool(self.decoder.sums) and not self.decoder.doubtful

    def feed(self, data: bytes, now: float) -> Iterator[Message]:
        """Yield the messages in ``data``; the caller handles each before it requests the next.

        A message that shows a restart of the board resets the clock with which the caller dates
        earlier messages.
        """
        for message in self.decoder.feed(data, now):
            if self._admit(message, now):
                yield message

    @property
    def unknown_streams(self) -> list[str]:
        """Streams that the firmware does not know."""
        if self.role is None:
            return []
        lines = SUBSCRIPTIONS[self.role]
        return [key for key, text in lines.items() if text in self.unknown_words]

    def not_understood(self, now: float) -> bool:
        """Return whether more than ``MANY`` lines were damaged or unknown in the current second.

        Call this method after each read: it also begins the next second.
        """
        if now - self._counted_at >= 1.0:
            self._counted_at, self._counted = now, self.statistics.faults
        return self.statistics.faults - self._counted > MANY

    def came_at(self, keyword: str) -> float:
        """Return when the last line with ``keyword`` arrived, in s; -infinity before the first."""
        return self._at.get(keyword, -math.inf)

    def note(self, keyword: str, now: float) -> None:
        """Record that a line with this ``keyword`` arrived."""
        self._at[keyword] = now
        if self.role is not None and keyword == NEEDED[self.role]:
            self._needed += 1

    def subscribe_again(self) -> None:
        """Subscribe to all streams again, because the board may have forgotten them."""
        self._at = {key: at for key, at in self._at.items() if key == "hbt"}
        self._needed_since, self._was_slow = math.inf, False
        self._next_at = -math.inf
        self.ready = False

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        return self._next_at if self._unsure_at is None else min(self._next_at, self._ask_at)

    def due(self, now: float) -> list[bytes]:
        """Return the lines to send now: missing subscriptions, and a request for the heartbeat."""
        texts = self._subscriptions(now)
        if self.unsure and now >= self._ask_at:
            self._ask_at = now + ASK_AGAIN_S
            texts.append(b"hbti")
        return texts

    def _subscriptions(self, now: float) -> list[bytes]:
        if now < self._next_at:
            return []
        self._next_at = now + AGAIN_S
        if self.role is None or self.heartbeat is None:
            return [b"hbti"]
        lines, unknown = SUBSCRIPTIONS[self.role], self.unknown_streams
        if not self._left:
            self._left = True  # subscriptions of another program would use up the bandwidth
            return [b"leave", *(text.encode("ascii") for text in lines.values())]
        wanted = [
            key
            for key, period in STREAMS[self.role].items()
            if now - self.came_at(key) > max(AGAIN_S, 4e-3 * period) and key not in unknown
        ]
        if any(key in wanted for key in TOGETHER):
            wanted += [key for key in TOGETHER if key not in wanted]
        needed = NEEDED[self.role]
        if needed in wanted and not self.unsure:
            self._unsure_at, self._ask_at = now, now
        if self._is_slow(now) and needed not in (*wanted, *unknown):
            wanted.append(needed)
        return [lines[key].encode("ascii") for key in wanted]

    def _is_slow(self, now: float) -> bool:
        """Return whether the data stream that driving requires is much slower than requested.

        True only if two calls in a row have found too few lines, because lines may still wait to be
        read.
        """
        assert self.role is not None
        count, since = self._needed, self._needed_since
        self._needed, self._needed_since = 0, now
        expected = (now - since) / (1e-3 * STREAMS[self.role][NEEDED[self.role]])
        was_slow, self._was_slow = self._was_slow, count < SLOW * expected
        return was_slow and self._was_slow

    def _admit(self, message: Message, now: float) -> bool:
        if isinstance(message, Comment):
            self._read_comment(message.text)
            self.heard_at = now
            return True
        if isinstance(message, Heartbeat):
            self._identify(message.identity)
        elif isinstance(message, BoardPose) and self.heartbeat is None:
            self.heard_at = now
            return False  # the time may be that of another board
        if isinstance(message, Heartbeat | BoardPose) and not self._see(message.time_s, now):
            return False
        if isinstance(message, Heartbeat):
            self.heartbeat = message
            self.note("hbt", now)
            if self._unsure_at is not None:
                sent_at = self.clock.host_s(message.time_s)
                if sent_at >= self._unsure_at - EARLY_S:  # an older heartbeat may precede a restart
                    self._unsure_at = None
        self.heard_at = now
        return True

    def _see(self, time_s: float, now: float) -> bool:
        if not self.clock.see(time_s, now):
            return False
        if self.clock.restarted:
            self._restart()
            self.restarted = True
            self.clock.see(time_s, now)
        return True

    def _identify(self, identity: int) -> None:
        """Accept the first identity at once; another identity must come twice in a row."""
        told, self._told = self._told, identity
        if self.heartbeat is None or identity == told:
            if identity != self._clock_of:
                self._clock_of = identity
                self._next_at = -math.inf
                self.unknown_words.clear()
                self.clock = self._clocks.pop(identity, TeensyClock())
            self.identity, self.role = identity, ROLES.get(identity)
        if self.heartbeat is None:
            self._next_at = -math.inf
        if self._started and self.role is not None:
            self._started = False
            self._restart()

    def _read_comment(self, text: str) -> None:
        if "Starting main loop" in text:
            if self.heartbeat is None:
                self._started = True
                self._next_at = -math.inf  # request the heartbeat at once
            else:
                self._restart()
        elif "CRC failed" in text:
            self.rejected += 1
        elif found := _UNHANDLED.search(text):
            words = found[1].strip()
            self.unknown_words.pop(words, None)
            self.unknown_words[words] = None  # at the end
            if len(self.unknown_words) > 64:
                del self.unknown_words[next(iter(self.unknown_words))]

    def _restart(self) -> None:
        self.restarted = self.heartbeat is not None or self.clock.known
        self.clock.begin()
        self.subscribe_again()
        self._unsure_at = None  # the caller configures the board again
