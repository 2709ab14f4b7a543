# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the clock's shortcut for ticks that arrive on time. The shortcut changes no stamp."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from interpreted import interpreted_only
from serial_line import Board, Chunker, bursts, crumbs, ftdi, late, singles

from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.readings import (
    DisplacementReading,
    ImuReading,
    PoseReading,
    Reading,
    SampleBoundary,
)
from omnibot_driver.core.timing import device_clock
from omnibot_driver.core.timing.device_clock import DeviceClock

pytestmark = interpreted_only

WHOLE = SampleBoundary(0, 0.0, 13 * 10 / 115200)
SAMPLE = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
SETTLING = 40
"""Number of ticks after which the clock can use its shortcut, if all of them arrive on time."""
Read = tuple[list[Reading], float, SampleBoundary | None]


def stamped(reads: list[Read], *, quick: bool) -> tuple[list[list[float]], str]:
    """Return the stamps of each read and the final state of the clock.

    ``quick``: whether the clock may use its shortcut.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not quick:
            patch.setattr(device_clock, "CALM", -1.0)
        clock = DeviceClock(0.01)
        stamps_s = [clock.stamps(*read) for read in reads]
        return stamps_s, str(
            {**vars(clock), "_calm": None, "_calm_s": None, "_line": vars(clock._line)}
        )


def heard(board: Board, chunker: Chunker, seed: int) -> list[Read]:
    rng, omnibot = random.Random(seed), OmniBot(OmniBotSettings())
    chunks = late(chunker(board.stream(rng), rng), rng, jitter_s=1e-4, stalls=[(1004.0, 1004.3)])
    return [(omnibot.receive(data, now), now, omnibot.edge) for now, data in chunks]


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.01])
@pytest.mark.parametrize("chunker", [ftdi(latency_s=0.001), bursts, singles, crumbs])
def test_lines_are_stamped_alike(chunker: Chunker, loss: float) -> None:
    """The stamps are equal with and without the shortcut, even if frames are lost."""
    reads = heard(Board(seconds=7, skew=1e-4, loss=loss), chunker, 1)
    assert stamped(reads, quick=True) == stamped(reads, quick=False)


def displaced(lost: int, duration_s: float | None = 0.04) -> DisplacementReading:
    return DisplacementReading(0.0, 0.0, 0.0, "earth", duration_s, lost, restarted=not duration_s)


imus = st.builds(
    ImuReading, st.just((0.0, 0.0, 0.0)), st.just((0.0, 0.0, 0.0)), st.sampled_from([0, 0, 0, 1, 9])
)
others = st.builds(displaced, st.sampled_from([0, 0, 1, 5]), st.sampled_from([0.04, 0.04, None]))
poses = st.builds(PoseReading, st.just(0.0), st.just(0.0), st.just(0.0), st.sampled_from([0, 1]))
edges = st.sampled_from([WHOLE, WHOLE, WHOLE, None]) | st.builds(
    SampleBoundary, st.integers(0, 1), st.floats(0.0, 1e-3), st.floats(0.0, 1e-3), st.booleans()
)
surprises = st.tuples(
    st.lists(imus, max_size=2) | st.lists(imus | others | poses, max_size=4),
    st.sampled_from([1, 1, 2, 30]),
    st.sampled_from([0.0, 0.003, 0.0045, 0.006, 0.008, 0.012, -0.003, -0.006, -0.009]),
    edges,
    st.sampled_from([0, 1, 14]),
)
"""Unusual reads, each followed by normal reads.

Each element: the readings of the unusual read, the ticks since the previous read, the delay in s, a
``SampleBoundary`` or None, and the number of normal reads.
"""


@pytest.mark.slow
@settings(max_examples=60)
@given(st.lists(surprises, max_size=30), st.floats(0.0, 0.004))
def test_surprises_are_stamped_alike(
    given: list[tuple[list[Reading], int, float, SampleBoundary | None, int]], later_s: float
) -> None:
    """Unusual reads follow a normal start. With and without the shortcut, the stamps are equal."""
    tick, last_s = SETTLING, 0.0
    reads: list[Read] = [([SAMPLE], n * 0.01, WHOLE) for n in range(SETTLING)]
    for readings, ticks, late_s, edge, calm in given:
        tick += ticks
        last_s = max(last_s, tick * 0.01 + late_s)
        reads.append((readings, last_s, edge))
        for _ in range(calm):
            tick += 1
            last_s = max(last_s, tick * 0.01 + later_s)
            with_it = [displaced(0)] if tick % 4 == 0 else []
            reads.append(([SAMPLE, *with_it], last_s, WHOLE))
    assert stamped(reads, quick=True) == stamped(reads, quick=False)


def test_calm_lines_take_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """If ticks arrive on time, the clock uses its shortcut for more than 90 % of the reads.

    Otherwise, the comparisons of stamps with and without the shortcut would prove nothing.
    """
    compared = 0
    compare = DeviceClock._compare

    def count(*arguments: object, **named: object) -> object:
        nonlocal compared
        compared += 1
        return compare(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(DeviceClock, "_compare", count)
    reads = heard(Board(seconds=12), bursts, 1)
    stamped(reads, quick=True)
    assert compared < 0.1 * len(reads)
