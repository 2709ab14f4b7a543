# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A busy computer: four busy loops, and an adapter that delivers four bytes at a time.

The line is undamaged, so all data must arrive.
"""

import math
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from breakable_line import TICK_S
from ports import Terminal
from published import Key, imu_key, odom_key, same, sent_imu_key, sent_odom_key
from rig import Rig

LOOPS: Final = 4
PIECE: Final = 4
BYTE_S: Final = 10 / 115200
TICKS: Final = 3000
SILENCE_S: Final = 1.0
"""Shortest interruption of the data, in s, after which the driver is allowed to blame the cable."""
TRANSIT: Final = 200
"""Largest number of frames that are in transit when a comparison begins.

The board has sent these frames before the comparison, but the driver may publish them during the
comparison.
"""
REACH: Final = 200
"""Limit, in frames, of the search for the sent frame that equals a published message.

The search begins after the last frame that was found. A message without an equal frame is wrong.
"""


class PiecesTerminal(Terminal):
    """A terminal that delivers a few bytes at a time, as fast as the line carries them.

    Bytes that arrive during a delay of its thread are delivered together.

    ``silent_s``: longest time between two deliveries so far, in s.
    """

    silent_s = 0.0
    _sent_at = math.inf
    _tick_at = 0.0
    """When the newest tick began, in s of the monotonic clock."""
    _is_newest = True
    """Whether the tick that the board simulates now is the newest of the ticks that are due."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._held = b""
        """Bytes of the line that are not delivered yet."""

    def _due(self, due_s: float) -> tuple[int, float]:
        ticks, next_s = super()._due(due_s)
        self._tick_at = next_s - TICK_S
        return ticks, next_s

    def _let_pass(self, ticks: int) -> None:
        for left in reversed(range(ticks)):
            self._is_newest = not left
            super()._let_pass(1)

    def _send(self, channel: int, data: bytes) -> int:
        self._held += data
        if not self._is_newest:
            return len(data)
        lost, to_come = 0, len(data)  # all bytes of earlier ticks have arrived
        while to_come:
            time.sleep(max(0.0, self._arrival_s(len(data), to_come) - time.monotonic()))
            now = time.monotonic()
            if to_come < len(data) and now > self._tick_at + TICK_S:
                break  # the rest of this tick comes together with the next tick
            while to_come and self._arrival_s(len(data), to_come) <= now:
                to_come -= min(PIECE, to_come)
            piece = self._held[: len(self._held) - to_come]
            self._held = self._held[len(piece) :]
            lost += len(piece) - super()._send(channel, piece)
            self.silent_s = max(self.silent_s, now - self._sent_at)
            self._sent_at = now
        return len(data) - lost

    def _arrival_s(self, count: int, to_come: int) -> float:
        """Return the time at which the last byte of the next piece arrives.

        ``count``: number of bytes that the board sends in this tick. ``to_come``: how many of these
        bytes have not arrived yet.
        """
        return self._tick_at + (count - to_come + min(PIECE, to_come)) * BYTE_S


class PiecesRig(Rig):
    """A rig whose terminal delivers a few bytes at a time."""

    def _make_terminal(self) -> Terminal:
        return PiecesTerminal(self.line, self.port)  # type: ignore[arg-type]


def _known(keys: Iterable[Key | None]) -> list[Key]:
    return [key for key in keys if key is not None]


@contextmanager
def busy_loops() -> Iterator[None]:
    """Run busy loops in other processes, so that the driver gets only a part of the computing time.

    The loops end with the ``with`` block.
    """
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(LOOPS)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
        for loop in loops:
            loop.wait()


def wrong_and_missing(published: list[Key], sent: list[Key]) -> tuple[int, int]:
    """Return how many messages match no frame, and how many frames are skipped between matches.

    Each frame that equals the first message is tried as the beginning. The best result is returned.
    """
    starts = [n for n, key in enumerate(sent) if published and same(published[0], key)]
    return min((_compared(published, sent[n:]) for n in starts), default=(len(published), 0))


def _compared(published: list[Key], sent: list[Key]) -> tuple[int, int]:
    at, missing, wrong = -1, 0, 0
    for key in published:
        ahead = range(at + 1, min(len(sent), at + REACH))
        place = next((n for n in ahead if same(key, sent[n])), None)
        if place is None:
            wrong += 1
            continue
        missing, at = missing + place - at - 1, place
    return wrong, missing


def is_busy(rig: PiecesRig, ticks: int = TICKS) -> None:
    """Drive the robot on a busy computer, and compare all messages with the sent frames."""
    rig.drive()
    imu, odom, line = len(rig.imu), len(rig.odom), len(rig.driver.lines)
    begin = len(rig.line.sent)
    with busy_loops():
        rig.wait_ticks(ticks)
    due = rig.line.sent[begin:]
    rig.wait_ticks(100)
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "after the busy time")
    frames = rig.line.sent[max(0, begin - TRANSIT) :]
    for what, keys, sent_key in (
        ("Imu", map(imu_key, rig.imu[imu:]), sent_imu_key),
        ("Odometry", map(odom_key, rig.odom[odom:]), sent_odom_key),
    ):
        published, least = _known(keys), len(_known(map(sent_key, due)))
        wrong, missing = wrong_and_missing(published, _known(map(sent_key, frames)))
        rig.findings.wrong += wrong
        rig.findings.expect(not wrong, f"{wrong} {what} messages were never sent")
        rig.findings.expect(not missing, f"{missing} {what} messages are missing")
        rig.findings.expect(
            len(published) >= least, f"only {len(published)} {what} messages, {least} frames sent"
        )
    rig.findings.expect(not rig.terminal.dropped, f"the kernel lost {rig.terminal.dropped} bytes")
    # The driver may read late too, and refuses commands after a pause of 0.3 s.
    longest_s = {True: 0.15, False: SILENCE_S / 2}
    blamed = [
        text
        for text in rig.driver.lines[line:]
        if "cable" in text and rig.terminal.silent_s < longest_s["command refused" in text]
    ]
    rig.findings.expect(not blamed, f"the line is blamed: {blamed}")
