# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""For the same input, the compiled core has exactly the same output as the interpreted core."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from interpreted import compiled_only
from session_bench import Bench
from streams import life

from omnibot_driver.selfcheck import core_kind
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

ROOT = Path(__file__).parents[2]
PIECES = (1, 8, 14, 64)
LOST = (0.0, 0.001, 0.01)


def told(piece: int, lost: float) -> str:
    """Return a digest of all events and bytes of a session through all modes of the board.

    ``piece``: number of bytes in each read. ``lost``: probability that a byte is lost.
    """
    random, bench = Random(piece), Bench()
    session, now = bench.session, 1000.0
    session.opened(now)
    said = hashlib.sha256()
    for tick in life(SimulatedBoard(BoardSettings(seed=5))):
        now += 0.01
        data = bytes(byte for byte in tick if random.random() >= lost)
        for at in range(0, len(data), piece):
            part = data[at : at + piece]
            now_s = now + (at + len(part)) * 10 / 115200 + random.expovariate(5000)
            session.inbound.receive(part, now_s)
            if now_s >= session.wake_at:
                session.tick(now_s)
            said.update(repr((session.take_output(now_s), session.take_events())).encode())
    said.update(repr((session.state, session.refused, session.figures(now + 1.0))).encode())
    return said.hexdigest()


@compiled_only
@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("piece", PIECES)
def test_both_cores_say_the_same(piece: int, lost: float) -> None:
    """The compiled and the interpreted core give the same digest of a session's events and bytes.

    The compiled core runs in this process, the interpreted core in another one.
    """
    path = os.pathsep.join(str(ROOT / part) for part in (".", "test", "test/core"))
    script = f"import test_compiled as t; print(t.core_kind(), t.told({piece}, {lost}))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert core_kind() == "compiled"
    assert done.stdout.split() == ["interpreted", told(piece, lost)]
