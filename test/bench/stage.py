# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Simulated boards on pseudo-terminals. They send a stream as in nominal mode, and store commands.

The boards send one after the other in each tick. The first word of an IMU frame is its number.
"""

import heapq
import os
import select
import struct
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import count
from operator import itemgetter
from random import Random
from typing import Self

from adapters import Adapter, Handed, pieces

TICK_S = 0.01
IMU_BYTES = 14
DELTA_BYTES = 9
POSE_BYTES = 15
TURN = 4000
"""Largest frame number in the IMU frames of the simulated boards.

The frame number counts from 0 to ``TURN`` and back, again and again.
"""
NOISE = 997
"""Number of ticks after which the random noise of the gyro and of the acceleration repeats."""


_IMU, _DELTA, _POSE = (struct.Struct(form) for form in (">BB6h", ">BB3hB", ">BB3fB"))


def number_of(tick: int) -> int:
    """Return the frame number in this tick's IMU frame."""
    return TURN - abs(TURN - tick % (2 * TURN))


def tick_bytes(tick: int, noise: list[list[int]]) -> bytes:
    """Return what a board sends in this tick.

    It is an IMU frame, followed by a delta in every fourth tick and a pose in every twentieth.
    """
    u, v, w, x, y = noise[tick % NOISE]
    data = _IMU.pack(0xFF, 0xFA, number_of(tick), 30 * x, 16384 + 8 * y, u, v, w)
    if tick % 4 == 3:
        data += _DELTA.pack(0xFF, 0xFB, 0, 0, 0, tick // 4 % 256)
    if tick % 20 == 19:
        data += _POSE.pack(0xFF, 0xFC, 0.0, 0.0, 0.0, tick // 20 % 256)
    return data


def imu_ends() -> Iterator[int]:
    """Yield, for each tick, the end of its IMU frame, in bytes from the beginning of the stream."""
    begun = 0
    for tick in count():
        yield begun + IMU_BYTES
        begun += IMU_BYTES + DELTA_BYTES * (tick % 4 == 3) + POSE_BYTES * (tick % 20 == 19)


class Stage:
    """Boards on pseudo-terminals. All times are of the steady clock, in s.

    ``paths``: the names of the terminals, one for each board.

    ``said[n]``: for each tick, the time at which board n delivered the last byte of the IMU frame.

    ``heard[n]``: the commands that board n has read, as (time, bytes).
    """

    def __init__(self, boards: int, adapter: Adapter = pieces) -> None:
        self._adapter = adapter
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
        begun, boards = time.monotonic(), len(self._ends)

        def ticks(board: int) -> Iterator[Handed]:
            for tick in count():
                yield begun + (tick + board / boards) * TICK_S, tick_bytes(tick, noise)

        lines = (
            map(partial(_of_board, board), self._adapter(ticks(board), Random(board)))
            for board in range(boards)
        )
        ends = [imu_ends() for _ in range(boards)]
        end, sent = [next(each) for each in ends], [0] * boards
        for at, board, data in heapq.merge(*lines, key=itemgetter(0)):
            if self._ending.is_set():
                return
            time.sleep(max(0.0, at - time.monotonic()))  # a line has a given rate
            now = time.monotonic()
            sent[board] += len(data)
            while end[board] <= sent[board]:
                self.said[board].append(now)
                end[board] = next(ends[board])
            with suppress(BlockingIOError):  # the reader is late
                os.write(self._ends[board][0], data)

    def _hear(self) -> None:
        poll = select.poll()
        for near, _ in self._ends:
            poll.register(near, select.POLLIN)
        boards = {near: board for board, (near, _) in enumerate(self._ends)}
        while not self._ending.is_set():
            for near, _ in poll.poll(100):
                self.heard[boards[near]].append((time.monotonic(), os.read(near, 4096)))


def _of_board(board: int, handed: Handed) -> tuple[float, int, bytes]:
    at, data = handed
    return at, board, data
