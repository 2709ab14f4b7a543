# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of pairs of a gyro line and an acceleration line.

Both lines of a pair must belong to one IMU sample.
"""

import itertools
import math
import random
from collections.abc import Iterable
from dataclasses import dataclass

import pytest
from fejemis_bench import DRIVE, nominal
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.fejemis.imu_pairs import ImuPairs, Pair
from omnibot_driver.core.fejemis.messages import Acceleration, Attitude, Gyro

LENGTHS = {"gyro": 29, "acc": 30, "pose": 33, "vel": 19, "imupose": 33}
KNOWN_S = 0.5
"""Time in s after which the driver knows whether the gyro line or the acceleration line is first.

Valid for reads at most 100 ms apart.
"""


@dataclass(frozen=True)
class Line:
    """A line that the board sends at ``sent_s``.

    ``number``: number of the IMU sample that the board takes in the cycle in which it sends the
    line.
    """

    sent_s: float
    kind: str
    number: int


@dataclass(frozen=True)
class Layout:
    """The order of the lines in a cycle of the board.

    ``order``: first letters of the lines' keywords.

    ``apart_s``: time between the gyro line and the acceleration line, in s.

    ``odd``: whether the samples with all lines have odd numbers (True) or even numbers (False). The
    other samples have only the gyro line and the acceleration line.
    """

    order: str
    apart_s: float = 0.0
    odd: bool = False

    def lines(self, seconds: float) -> list[Line]:
        kinds = {kind[0]: kind for kind in LENGTHS}
        lines = []
        for number in range(round(seconds * 100)):
            at_s, second = number * 0.01, False
            for letter in self.order:
                if letter in "ga":
                    at_s += self.apart_s if second else 0.0
                    second = True
                if letter in "ga" or number % 2 == self.odd:
                    lines.append(Line(at_s, kinds[letter], number))
        return lines


LAYOUTS = [
    Layout("pvgai"),
    Layout("gaipv"),
    Layout("agipv"),
    Layout("pvagi", odd=True),
    Layout("gaipv", apart_s=0.002),
    Layout("pvgai", apart_s=0.001, odd=True),
    Layout("piga", apart_s=0.003),
    Layout("pga"),
]
layouts = st.sampled_from(LAYOUTS)
chances = st.integers(0, 10_000).map(random.Random)
Read = tuple[float, list[Line]]


def damaged(lines: list[Line], chance: random.Random, lost: float, twice: float) -> list[Line]:
    """Return the lines that arrive.

    Each line is lost with probability ``lost``, and arrives twice with probability ``twice``.
    """
    kept = [line for line in lines if chance.random() >= lost]
    return [line for line in kept for _ in range(1 + (chance.random() < twice))]


def reads_every(lines: Iterable[Line], period_s: float, phase_s: float = 0.0) -> list[Read]:
    """Divide the lines into the reads of a host that reads every ``period_s``."""

    def read(line: Line) -> int:
        return math.floor((line.sent_s - phase_s) / period_s) + 1

    return [(n * period_s + phase_s, list(some)) for n, some in itertools.groupby(lines, read)]


def reads_of_pieces(lines: list[Line], chance: random.Random, pauses_s: list[float]) -> list[Read]:
    """Divide the lines into the reads of a slow connection.

    Each read has 1 to 60 bytes. A pause from ``pauses_s`` comes before each read.
    """
    reads: list[Read] = []
    now, due, sent = 0.0, 0, 0
    for line in lines:
        due += LENGTHS[line.kind]
        if now < line.sent_s:
            now = line.sent_s
        while sent < due:
            sent += chance.randint(1, 60)
            now += chance.choice(pauses_s)
        if reads and reads[-1][0] == now:
            reads[-1][1].append(line)
        else:
            reads.append((now, [line]))
    return reads


def reads_with_stalls(lines: list[Line], chance: random.Random, stalls: float) -> list[Read]:
    """Divide the lines into the reads of a fast host that is busy at times, for up to 0.15 s.

    ``stalls``: probability that it is busy before a line.
    """
    reads: list[Read] = []
    free_at = 0.0
    for _, some in itertools.groupby(lines, lambda line: line.sent_s):
        for line in some:
            now = max(free_at, line.sent_s + chance.uniform(0.0002, 0.001))
            if chance.random() < stalls:
                now += chance.uniform(0.0, 0.15)
            free_at = now
            if reads and reads[-1][0] == now:
                reads[-1][1].append(line)
            else:
                reads.append((now, [line]))
    return reads


@dataclass(frozen=True)
class Outcome:
    """The pairs that were found. Each pair is given as the sample numbers of its two lines.

    ``given``: all pairs. ``false``: pairs whose two lines belong to different samples.
    """

    given: list[tuple[int, int]]
    false: list[tuple[int, int]]
    excused: list[tuple[int, int]]
    """The false pairs of gyro and acceleration that nothing in the stream shows to be false."""


def outcome(reads: list[Read]) -> Outcome:
    """Pass the lines of the reads to the driver's ``ImuPairs``, and return the pairs it finds."""
    pairs, given = ImuPairs(), []
    for now, lines in reads:
        for line in lines:
            match line.kind:
                case "gyro":
                    pairs.gyro(Gyro(float(line.number), 0.0, 0.0), now)
                case "acc":
                    pairs.acceleration(Acceleration(float(line.number), 0.0, 9.8), now)
                case "pose":
                    pairs.pose(round(7.0 + line.sent_s, 5))
                    given += pairs.take()
                case "imupose":
                    pairs.attitude(Attitude(0.0, 0.0, 0.0), now)
                case _:
                    pairs.other(line.kind)
        given += pairs.take()
    numbers = [
        (int(pair.gyro.x), int(pair.acceleration.x)) for pair in given if isinstance(pair, Pair)
    ]
    false = [pair for pair in numbers if pair[0] != pair[1]]
    return Outcome(numbers, false, [pair for pair in false if not decidable(pair, reads)])


def decidable(pair: tuple[int, int], reads: list[Read]) -> bool:
    """Return whether a program that sees only the stream can recognize that ``pair`` is false.

    ``pair``: the sample numbers of its gyro line and its acceleration line. The numbers differ.
    """
    wanted = {("gyro", pair[0]), ("acc", pair[1])}
    found = [(now, line) for now, lines in reads for line in lines]
    both = [
        (at, now, line)
        for at, (now, line) in enumerate(found)
        if (line.kind, line.number) in wanted
    ]
    _, one_at, first = both[0]
    at, other_at, _ = next(one for one in both if one[2].kind != first.kind)
    posed = any(now == other_at and line.kind == "pose" for now, line in found[at:])
    late = one_at - first.sent_s >= 0.004
    return not late or other_at - one_at >= 0.005 or posed


def assert_nothing_is_missing(result: Outcome, lines: list[Line], reads: list[Read]) -> None:
    """Check that no pair of lines is false, and that each sample was found once.

    The samples of the first 0.5 s and the last samples may be missing.
    """
    assert result.false == []
    known = next(line.number for now, some in reads if now > KNOWN_S for line in some)
    wanted = range(known + 1, lines[-1].number - 3)
    numbers = [gyro for gyro, _ in result.given]
    assert numbers == sorted(set(numbers))
    assert set(wanted) <= set(numbers)


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
@pytest.mark.parametrize("period_s", [0.001, 0.004, 0.0075, 0.02, 0.033, 0.1])
def test_every_sample_is_given_if_no_line_is_lost(layout: Layout, period_s: float) -> None:
    """All lines arrive. The interval between reads is shorter or longer than the sampling period.

    Every sample is found.
    """
    lines = layout.lines(2.0)
    for phase_s in (0.0, 0.0003, 0.0031):
        reads = reads_every(lines, period_s, phase_s)
        assert_nothing_is_missing(outcome(reads), lines, reads)


pauses = st.sampled_from([[0.001], [0.006], [0.001, 0.006], [0.0]])


@pytest.mark.slow
@given(layouts, chances, pauses)
@settings(max_examples=30, deadline=None)
def test_every_sample_is_given_in_pieces(
    layout: Layout, chance: random.Random, pauses_s: list[float]
) -> None:
    """No line is lost, but the bytes arrive in small pieces, perhaps over a slow connection.

    Every sample is found.
    """
    lines = layout.lines(3.0)
    reads = reads_of_pieces(lines, chance, pauses_s)
    assert_nothing_is_missing(outcome(reads), lines, reads)


@pytest.mark.slow
@given(layouts, chances, st.floats(0.0, 0.1))
@settings(max_examples=30, deadline=None)
def test_every_sample_is_given_by_a_reader_that_stalls(
    layout: Layout, chance: random.Random, stalls: float
) -> None:
    """The host stalls at times, perhaps between the two lines of a sample.

    Every sample is found.
    """
    lines = layout.lines(3.0)
    reads = reads_with_stalls(lines, chance, stalls)
    assert_nothing_is_missing(outcome(reads), lines, reads)


@pytest.mark.slow
@given(
    layouts,
    chances,
    st.floats(0.0, 0.1),
    st.floats(0.0, 0.1),
    st.one_of(
        st.floats(0.001, 0.15).filter(lambda period_s: abs(period_s - 0.01) > 5e-4), st.none()
    ),
    st.floats(0.0, 0.1),
)
@settings(max_examples=50, deadline=None)
def test_no_pair_has_lines_of_two_samples(
    layout: Layout,
    chance: random.Random,
    lost: float,
    twice: float,
    period_s: float | None,
    stalls: float,
) -> None:
    """Lines are lost, repeated or late.

    Each pair has lines of one sample, unless nothing in the stream shows the error.

    ``period_s``: period of the reads in s; None: each line is read at once, apart from stalls.
    """
    lines = damaged(layout.lines(3.0), chance, lost, twice)
    reads = reads_with_stalls(lines, chance, stalls)
    if period_s is not None:
        reads = reads_every(lines, period_s, chance.uniform(0.0, period_s))
    result = outcome(reads)
    assert result.false == result.excused


@pytest.mark.slow
@pytest.mark.parametrize("silence_s", [0.3, 2.0])
def test_no_sample_after_a_silence_is_stamped_with_the_time_before_it(silence_s: float) -> None:
    """No sample after a silence of the drive board gets a stamp from before the silence.

    After the silence, sampling times are unknown until the first pose. Until then, no sample is
    published.
    """
    bench = nominal()
    for phase_s in (0.0, 0.005, 0.01, 0.015):
        bench.run(0.5)
        bench.speaks.discard(DRIVE)
        bench.run(silence_s + phase_s)
        bench.speaks.add(DRIVE)
        bench.events.clear()
        again_at = bench.now
        bench.run(0.5)
        assert len(bench.imu) > 45
        assert all(estimate.stamp_s > again_at - 0.02 for estimate in bench.imu)


@pytest.mark.slow
def test_samples_that_waited_for_the_host_are_not_left_out() -> None:
    """The driver reads only every 0.2 s.

    The first samples of a read are published, too, after the next pose has shown that no samples
    are missing.
    """
    bench = nominal()
    bench.run(3.0)
    bench.read_s = 0.2
    bench.run(1.0)
    bench.events.clear()
    bench.run(2.0)
    assert 180 < len(bench.imu) <= 220
