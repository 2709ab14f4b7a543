# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The Fejemis's part of ``make bench``: how late the drive board gets the front wheel's angle.

The driver relays the angle from the front board. Other processes keep the computer busy.
"""

import contextlib
import itertools
import multiprocessing
import os
import re
import select
import time
import tty
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing.connection import Connection
from typing import Final

from ratios import Figure

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.board import FejemisBoard
from omnibot_driver.core.fejemis.settings import FejemisSettings
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.session import Session
from omnibot_driver.core.settings import SessionSettings
from omnibot_driver.link import Link
from omnibot_driver.simulator.fejemis import SimulatedFejemis
from omnibot_driver.transports.serial_port import SerialPort
from omnibot_driver.transports.several import Several

BESIDE: Final = (0, 2, 4)
"""How many other processes keep the computer busy: one measurement for each of these values."""
SETTLES_S: Final = 3.0
TOLD: Final = re.compile(rb"fwl (-?[0-9.]+) 0x")
RELAYED: Final = re.compile(rb"fwl (-?[0-9.]+) *\n")


def boards(masters: Sequence[int], seconds: float, results: Connection) -> None:
    """Run both simulated boards in real time, then send a list of delays in s to ``results``.

    A delay lasts from the front board's report of an angle to its arrival at the drive board.
    """
    pair = SimulatedFejemis()
    drive, _ = masters
    angles = itertools.cycle([*range(-60, 60), *range(60, -60, -1)])
    pair.front._items["fwl"] = lambda: f"fwl {next(angles):.2f} 0x0 0x3c2"
    for master in masters:
        os.set_blocking(master, False)
    began = time.monotonic()
    told: deque[tuple[float, float]] = deque(maxlen=40)
    took: list[float] = []
    while (now := time.monotonic()) - began < seconds:
        while pair.tick * pair.tick_s < now - began:
            for channel, data in pair.advance():
                with contextlib.suppress(BlockingIOError):
                    os.write(masters[channel], data)
                if channel == 1:
                    told += [(time.monotonic(), float(deg)) for deg in TOLD.findall(data)]
        until = began + (pair.tick + 1) * pair.tick_s
        ready, _, _ = select.select(masters, [], [], max(0.0, until - time.monotonic()))
        for master in ready:
            data = os.read(master, 4096)
            at = time.monotonic()
            pair.receive(data, at, 0 if master == drive else 1)
            for deg in map(float, RELAYED.findall(data) if master == drive else ()):
                left = [left for left, angle_deg in told if abs(angle_deg - deg) < 0.4]
                if left and at - began > SETTLES_S:
                    took.append(at - left[-1])
    results.send(took)


def compute() -> None:
    while True:
        sum(range(1000))


def drive_for(seconds: float, ports: Sequence[str]) -> None:
    """Run the driver's link for ``seconds``, with commands at 20 Hz."""
    settings = SessionSettings(
        limits=SpeedLimits(), commands=CommandSettings(), odometry=OdometrySettings()
    )
    session = Session(FejemisBoard(FejemisSettings()), settings, run=True)
    opener: Callable[[], Several] = partial(
        Several, [(port, partial(SerialPort, port, 115200, "port")) for port in ports]
    )
    link = Link(
        session,
        opener,
        ports[0],
        guard=False,
        reconnect_interval_s=0.5,
        deliver=lambda _events: None,
        report=lambda _trouble: None,
        failed=lambda error: print("failed:", error),
    )
    link.start()
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        with contextlib.suppress(CommandRefused):
            link.call(lambda session, now: session.command_twist(BodyTwist(0.0, 0.0, 0.0), now))
        time.sleep(0.05)  # the rate of the commands
    link.close("stop")


def relayed_ms(seconds: float, busy: int) -> list[float]:
    """Return the sorted times in ms that the driver takes to relay the front wheel's angle.

    ``busy``: number of other processes that compute during the measurement. Angles of the first 3 s
    are left out.
    """
    pairs = [os.openpty() for _ in range(2)]
    for _, near in pairs:
        tty.setraw(near)
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    masters = [master for master, _ in pairs]
    others = [context.Process(target=compute, daemon=True) for _ in range(busy)]
    both = context.Process(target=boards, args=(masters, seconds, theirs), daemon=True)
    for process in (*others, both):
        process.start()
    drive_for(seconds - 1.0, [os.ttyname(near) for _, near in pairs])
    took = ours.recv()
    for process in (*others, both):
        process.kill()
    for descriptor in itertools.chain(*pairs):
        os.close(descriptor)
    return sorted(1e3 * each for each in took)


def measure(*, quick: bool) -> tuple[list[Figure], list[str]]:
    """Measure the delays. Return no figures, only the rows of a table.

    For other boards, figures compare the driver with a minimal program (the floor). There is no
    such program for the Fejemis.
    """
    rows = [
        "How long the angle of the front wheel takes from one board to the other, in ms:",
        "",
        "| beside | angles | median | 90 % | 99 % (goal 5) | longest |",
        "|---|---|---|---|---|---|",
    ]
    for busy in BESIDE:
        took_ms = relayed_ms(8.0 if quick else 60.0, busy)
        told = (took_ms[int(part * (len(took_ms) - 1))] for part in (0.5, 0.9, 0.99, 1.0))
        cells = " | ".join(f"{value:.2f}" for value in told)
        rows.append(f"| {busy} busy processes | {len(took_ms):,} | {cells} |")
    return [], rows
