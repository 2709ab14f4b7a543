# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART's part of ``make bench``: the latency of commands, and the cost of the queries.

The driver and the floor (the smallest equivalent program) each have a simulated controller on UDP.
In the driver, a new speed waits for the reply to a query, but a stop does not.
"""

import time
from contextlib import ExitStack
from itertools import pairwise
from statistics import median
from typing import Any, Final

from processes import HERE, Program
from ratios import Figure

from omnibot_driver.simulator.common.serving import ServedBoard
from omnibot_driver.simulator.mart import MartSettings, SimulatedMart

WINDOW_S: Final = 20.0
"""Length of a measurement window, in s."""
SETTLING_S: Final = 8.0
"""Time in s for which the programs run before the measurement.

No event reports that they are ready.
"""
LATEST_S: Final = 0.9
"""Longest latency in s that is expected. If a datagram comes later, it belongs to the next
command."""
LARGE: Final = 3
"""Smallest change of a motor's speed, in MART's units, that shows a new command.

The driver makes smaller changes by itself, to hold the heading.
"""


class Heard(SimulatedMart):
    """A simulated controller that records what it receives on its command port.

    ``heard``: the datagrams except the regular queries, each with its time in s.
    """

    def __init__(self) -> None:
        super().__init__(MartSettings())
        self.heard: list[tuple[float, bytes]] = []

    def receive(self, data: bytes, now: float, channel: int = 0) -> None:
        if not data.startswith((b"ENC", b"RMRA")):
            self.heard.append((time.monotonic(), data))
        super().receive(data, now, channel)


def measure(*, quick: bool) -> tuple[list[Figure], list[str]]:
    """Return figures that compare the driver with a minimal program (the floor), and an empty list.

    The list is for additional rows of the report, which only some boards have.
    """
    windows = 2 if quick else 12
    with ExitStack() as stack:
        boards: list[Any] = [Heard(), Heard()]
        served = [stack.enter_context(ServedBoard(board)) for board in boards]
        ours, floors = (each.addresses[0] for each in served)
        host, _, port = floors.removeprefix("udp://").rpartition(":")
        parameters = {"board": "mart", "port": ours, "motion_monitor": "false"}
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        arguments = ["-m", "omnibot_driver.driver", "--ros-args", "-r", "__ns:=/ours", *given]
        programs = [
            stack.enter_context(Program(*arguments)),
            stack.enter_context(Program(str(HERE / "mart_floor.py"), host, port, "floor")),
        ]
        time.sleep(SETTLING_S)
        hand = stack.enter_context(
            Program(str(HERE / "mart_hand.py"), str(windows * WINDOW_S), "ours", "floor")
        )
        marks, busy = [time.monotonic()], [[program.busy_s for program in programs]]
        for _ in range(windows):
            time.sleep(WINDOW_S)
            marks.append(time.monotonic())
            busy.append([program.busy_s for program in programs])
        sent = hand.result()
    spent = [
        [1e3 * (after - before) / (end - start) for before, after in zip(*pair, strict=True)]
        for *pair, start, end in zip(busy, busy[1:], marks, marks[1:], strict=False)
    ]
    changes = [_latencies(*each, stops=False) for each in zip(sent, _heard(boards), strict=True)]
    stops = [_latencies(*each, stops=True) for each in zip(sent, _heard(boards), strict=True)]
    return [
        Figure("processor time per second of driving", "ms", *zip(*spent, strict=True)),
        Figure("new speed to the RMCS at the board, median", "µs", *_medians(changes, windows)),
        Figure("zero to the stop at the board, median", "µs", *_medians(stops, windows)),
    ], []


def _heard(boards: list[Any]) -> list[list[tuple[float, bytes]]]:
    return [board.heard for board in boards]


def _medians(late: list[list[float]], windows: int) -> list[list[float]]:
    parts = max(1, min(windows, *(len(each) // 3 for each in late)))
    return [
        [median(each[n * len(each) // parts : (n + 1) * len(each) // parts]) for n in range(parts)]
        for each in late
    ]


def _latencies(
    sent: list[tuple[float, float]], heard: list[tuple[float, bytes]], *, stops: bool
) -> list[float]:
    """Return the latencies of commands to a moving robot, from publication to controller, in µs.

    ``stops``: whether stops are measured, instead of changes of speed.
    """
    found = []
    for (_, before), (at, speed) in pairwise(sent):
        if not before or (speed == 0.0) is not stops:
            continue
        for came, data in heard:
            if at < came < at + LATEST_S and _says(data, stops=stops):
                found.append(1e6 * (came - at))
                break
    return found


def _says(data: bytes, *, stops: bool) -> bool:
    word, *numbers = data.split()
    if stops:
        return word == b"SRM" or data.startswith(b"RMCS -")
    return word == b"RMCS" and min(abs(int(number)) for number in numbers) >= LARGE
