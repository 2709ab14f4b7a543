# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Boards that say the nominal stream on pseudo-terminals, each at a moment of its own in the tick.

They take turns within the 10 ms, so their readers are measured in alternation. Every IMU frame
carries a number in its first word; nothing else of a board is simulated.
"""

import os
import select
import struct
import threading
import time
import tty
from contextlib import suppress
from random import Random
from typing import Self

TICK_S = 0.01
TURN = 4000
"""The number goes up and down between 0 and this."""
NOISE = 997
"""Readings of noise, used over and over."""


def number_of(tick: int) -> int:
    """The number in the IMU frame of this tick."""
    return TURN - abs(TURN - tick % (2 * TURN))


class Stage:
    """``said[n]``: for board n, when each tick was written; ``heard[n]``: reads of what came back.

    ``paths``: the terminals. Times are of the steady clock, in s.
    """

    def __init__(self, boards: int) -> None:
        self.said: list[list[float]] = [[] for _ in range(boards)]
        self.heard: list[list[tuple[float, bytes]]] = [[] for _ in range(boards)]
        self._ends = [os.openpty() for _ in range(boards)]
        for near, far in self._ends:
            tty.setraw(far)
            os.set_blocking(near, False)
        self.paths = [os.ttyname(far) for _, far in self._ends]
        self._ending = threading.Event()
        self._threads = [threading.Thread(target=work) for work in (self._say, self._hear)]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        for thread in self._threads:
            thread.join()
        for ends in self._ends:
            for end in ends:
                os.close(end)

    def _say(self) -> None:
        random = Random(1)
        noise = [[round(random.gauss(0, 6.5)) for _ in range(5)] for _ in range(NOISE)]
        imu, delta, pose = (struct.Struct(form) for form in (">BB6h", ">BB3hB", ">BB3fB"))
        boards = len(self._ends)
        tick, at = 0, time.monotonic()
        while not self._ending.is_set():
            u, v, w, x, y = noise[tick % NOISE]
            data = imu.pack(0xFF, 0xFA, number_of(tick), 30 * x, 16384 + 8 * y, u, v, w)
            if tick % 4 == 3:
                data += delta.pack(0xFF, 0xFB, 0, 0, 0, tick // 4 % 256)
            if tick % 20 == 19:
                data += pose.pack(0xFF, 0xFC, 0.0, 0.0, 0.0, tick // 20 % 256)
            for board, (near, _) in enumerate(self._ends):
                time.sleep(max(0.0, at + board * TICK_S / boards - time.monotonic()))
                self.said[board].append(time.monotonic())
                with suppress(BlockingIOError):  # it is not read yet
                    os.write(near, data)
            tick, at = tick + 1, at + TICK_S

    def _hear(self) -> None:
        poll = select.poll()
        for near, _ in self._ends:
            poll.register(near, select.POLLIN)
        boards = {near: board for board, (near, _) in enumerate(self._ends)}
        while not self._ending.is_set():
            for near, _ in poll.poll(100):
                self.heard[boards[near]].append((time.monotonic(), os.read(near, 4096)))
