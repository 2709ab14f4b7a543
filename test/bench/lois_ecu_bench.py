# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU's part of ``make bench``: processor time of its stream, and latency of commands.

The driver and the floor (the smallest equivalent program) get the same bytes of a robot at rest.
"""

import bisect
import os
import select
import threading
import time
import tty
from collections.abc import Sequence
from contextlib import ExitStack
from statistics import median
from typing import Final, Self

from hand import LSB_PER_MPS
from lois_ecu_floor import rpm_line
from processes import HERE, Program
from ratios import Figure

from omnibot_driver.simulator.lois_ecu import LoisSettings, SimulatedLois

TICK_S: Final = 0.01
RECORDED_S: Final = 120.0
WINDOW_S: Final = 8.0
"""Length of a measurement window, in s."""
SETTLING_S: Final = 10.0
"""Time in s for which the programs run before the measurement.

No event reports that they are ready.
"""


class Stage:
    """Boards on pseudo-terminals, which all send the same recorded stream.

    ``paths``: names of the terminals. ``heard``: for each board, the commands as (time in s,
    bytes).
    """

    def __init__(self, boards: int) -> None:
        board = SimulatedLois(LoisSettings(running=True))
        self._stream = [board.step() for _ in range(round(RECORDED_S / TICK_S))]
        self.heard: list[list[tuple[float, bytes]]] = [[] for _ in range(boards)]
        self._ends = [os.openpty() for _ in range(boards)]
        for _, far in self._ends:
            tty.setraw(far)
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
        tick, at = 0, time.monotonic()
        while not self._ending.wait(max(0.0, at - time.monotonic())):
            data = self._stream[tick % len(self._stream)]
            for near, _ in self._ends:
                if data and select.select([], [near], [], 0.0)[1]:
                    os.write(near, data)
            tick, at = tick + 1, at + TICK_S

    def _hear(self) -> None:
        poll = select.poll()
        boards = {near: board for board, (near, _) in enumerate(self._ends)}
        for near in boards:
            poll.register(near, select.POLLIN)
        while not self._ending.is_set():
            for near, _ in poll.poll(100):
                self.heard[boards[near]].append((time.monotonic(), os.read(near, 4096)))


def measure(*, quick: bool) -> tuple[list[Figure], list[str]]:
    """Return figures that compare the driver with a minimal program (the floor), and an empty list.

    The list is for additional rows in the report, which only some boards have.
    """
    windows = 2 if quick else 12
    with Stage(2) as stage, ExitStack() as stack:
        parameters = {"board": "lois_ecu", "port": stage.paths[0], "motion_monitor": "false"}
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        arguments = ["-m", "omnibot_driver.driver", "--ros-args", "-r", "__ns:=/ours", *given]
        programs = [
            stack.enter_context(Program(*arguments)),
            stack.enter_context(Program(str(HERE / "lois_ecu_floor.py"), stage.paths[1], "floor")),
        ]
        time.sleep(SETTLING_S)
        marks, busy = [time.monotonic()], [[program.busy_s for program in programs]]
        for _ in range(windows):
            time.sleep(WINDOW_S)
            marks.append(time.monotonic())
            busy.append([program.busy_s for program in programs])
        seconds = str(windows * WINDOW_S / 2)
        hand = stack.enter_context(Program(str(HERE / "hand.py"), seconds, "ours", "floor"))
        sent = hand.result()
    spent = [
        [1e3 * (after - before) / (end - start) for before, after in zip(*pair, strict=True)]
        for *pair, start, end in zip(busy, busy[1:], marks, marks[1:], strict=False)
    ]
    late = [_latencies(*each) for each in zip(sent, stage.heard, strict=True)]
    size = min(map(len, late)) // windows
    parts = [[median(each[n * size : (n + 1) * size]) for n in range(windows)] for each in late]
    return [
        Figure("processor time per second of stream", "ms", *zip(*spent, strict=True)),
        Figure("cmd_vel to the board's side, median", "µs", *parts),
    ], []


def _latencies(
    sent: Sequence[tuple[float, int]], heard: Sequence[tuple[float, bytes]]
) -> list[float]:
    """Return the time from each command to the first read that contains the command, in µs."""
    found = []
    times = [at for at, _ in heard]
    for at, speed in sent:
        line = rpm_line(speed / LSB_PER_MPS)
        for arrived, data in heard[bisect.bisect_left(times, at) :][:10]:
            if line in data:
                found.append(1e6 * (arrived - at))
                break
    return found
