# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that compare stamps with the true sampling times of simulated data, in simulated time."""

import math
import random
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from statistics import fmean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from serial_line import Board, Chunker, Read, blocks, bursts, crumbs, ftdi, late, singles

from omnibot_driver.core.imu.scale import STANDARD_GRAVITY
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.readings import DisplacementReading, ImuReading, SampleBoundary
from omnibot_driver.core.timing.device_clock import DeviceClock

SEEDS = range(2)
SKEWS = [1e-4, -1e-4]
CRYSTALS = pytest.mark.parametrize(("skew", "imu_only"), [(1e-4, False), (-1e-4, True)])
JITTER_S = 60e-6
SETTLED_S = 2.0
WHOLE = SampleBoundary(ahead=0, latest_s=0.0, earliest_s=0.0)
SAMPLE = ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
COUNTS = 16384 / STANDARD_GRAVITY


@dataclass(slots=True)
class Stamped:
    """The stamps of a stream's samples and displacements.

    Each entry has the number of the tick, the stamp in s, and the arrival time in s.
    """

    board: Board
    samples: list[tuple[int, float, float]] = field(default_factory=list)
    displacements: list[tuple[int, float, float]] = field(default_factory=list)

    def errors(self, since_s: float = SETTLED_S) -> list[float]:
        """Return the stamps minus the true sampling times, in s.

        The samples of the first ``since_s`` seconds after the board's start are left out.
        """
        return [
            stamp_s - self.board.sampled_at(tick)
            for tick, stamp_s, _ in self.samples
            if self.board.sampled_at(tick) >= self.board.begins_at + since_s
        ]

    def unevenness(self, since_s: float = SETTLED_S) -> float:
        """Return by how much the steps between stamps deviate from 10 ms (RMS), in s."""
        return math.sqrt(
            fmean(
                (after[1] - before[1] - 0.01) ** 2
                for before, after in pairwise(self.samples)
                if before[1] >= self.board.begins_at + since_s and after[0] == before[0] + 1
            )
        )


def spread(errors: list[float], part: float = 0.99) -> float:
    """Return half the width of the narrowest interval that contains ``part`` of the errors."""
    ordered = sorted(errors)
    count = math.ceil(part * len(ordered))
    ends = zip(ordered, ordered[count - 1 :], strict=False)
    return min(high - low for low, high in ends) / 2


def stamp(clock: DeviceClock, board: Board, reads: Iterable[Read]) -> Stamped:
    """Decode and stamp the reads. Check that stamps increase and are not in the future."""
    stamped = Stamped(board)
    omnibot = OmniBot(OmniBotSettings())
    last_s = -math.inf
    for now, data in reads:
        readings = omnibot.receive(data, now)
        stamps_s = clock.stamps(readings, now, omnibot.edge)
        for reading, stamp_s in zip(readings, stamps_s, strict=True):
            if isinstance(reading, ImuReading):
                assert last_s < stamp_s <= now
                last_s = stamp_s
                low, high = (round(value * COUNTS) for value in reading.specific_force[:2])
                stamped.samples.append((low + 8192 * high, stamp_s, now))
            elif isinstance(reading, DisplacementReading):
                stamped.displacements.append((4 * round(reading.dx_m * 1e4), stamp_s, now))
    return stamped


def run(
    board: Board,
    chunker: Chunker,
    seed: int,
    *,
    stalls: list[tuple[float, float]] | None = None,
    clock: DeviceClock | None = None,
) -> Stamped:
    rng = random.Random(seed)
    chunks = chunker(board.stream(rng), rng)
    reads = late(chunks, rng, jitter_s=JITTER_S, stalls=stalls)
    return stamp(clock or DeviceClock(0.01), board, reads)


@pytest.mark.slow
@CRYSTALS
@pytest.mark.parametrize(
    "chunker",
    [ftdi(restarted_by_data=True), ftdi(latency_s=0.001), bursts, singles, crumbs],
    ids=["adapter 16 ms", "adapter 1 ms", "bursts", "bytes", "crumbs"],
)
def test_stamps_are_even_and_true_to_a_constant(
    chunker: Chunker, skew: float, imu_only: bool
) -> None:
    """From 2 s on, the steps between stamps differ from 10 ms by less than 0.2 ms (RMS).

    Apart from a constant error, 99 % of the stamps are right within 0.5 ms.
    """
    stamped = run(Board(seconds=20, skew=skew, imu_only=imu_only), chunker, 0)
    assert stamped.unevenness() < 0.2e-3
    assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.slow
@CRYSTALS
def test_an_adapter_whose_timer_beats_against_the_tick_is_seen_through(
    skew: float, imu_only: bool
) -> None:
    """The stamps are right if an adapter sends every 16 ms, while the board's tick is 10 ms.

    Stamps from arrival times alone could be 0.8 ms late for seconds.
    """
    stamped = run(Board(seconds=90, skew=skew, imu_only=imu_only), ftdi(), 0)
    assert stamped.unevenness() < 0.2e-3
    assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.slow
@pytest.mark.parametrize("chunker", [bursts, singles], ids=["bursts", "bytes"])
def test_on_an_ideal_line_the_stamps_are_no_worse_than_arrival_times(chunker: Chunker) -> None:
    """On an ideal line, the stamps are at least as accurate and even as the arrival times."""
    for seed in SEEDS:
        stamped = run(Board(seconds=20, skew=1e-4), chunker, seed)
        arrivals = Stamped(stamped.board, [(tick, at, at) for tick, _, at in stamped.samples])
        assert spread(stamped.errors()) <= spread(arrivals.errors())
        assert stamped.unevenness() <= arrivals.unevenness()


@pytest.mark.slow
def test_blocks_as_large_as_the_hosts_buffer_are_spread_over_their_ticks() -> None:
    """Data arrives in blocks of 240 ticks, so all ticks of a block arrive together.

    The stamps of the ticks are nevertheless evenly spaced, from 20 s after the start.
    """
    for seed in SEEDS:
        stamped = run(Board(seconds=120, skew=1e-4, imu_only=True), blocks, seed)
        assert stamped.unevenness(since_s=20.0) < 0.2e-3
        assert spread(stamped.errors(since_s=20.0)) < 0.5e-3


@pytest.mark.slow
@pytest.mark.parametrize("chunker", [ftdi(restarted_by_data=True), bursts, crumbs])
def test_a_host_that_stalls_does_not_move_the_stamps(chunker: Chunker) -> None:
    """The host stalls ten times for 5 to 200 ms. The data that waited is stamped as usual."""
    for seed in SEEDS:
        rng = random.Random(seed)
        stalls = [(1003 + 1.5 * k, 1003 + 1.5 * k + rng.uniform(0.005, 0.2)) for k in range(10)]
        stamped = run(Board(seconds=20, skew=-1e-4), chunker, seed, stalls=stalls)
        assert max(now - at for _, at, now in stamped.samples) > 0.05
        assert stamped.unevenness() < 0.2e-3
        assert spread(stamped.errors()) < 0.5e-3


@pytest.mark.parametrize("imu_only", [False, True])
def test_a_driver_that_finds_a_backlog_does_not_take_it_for_now(imu_only: bool) -> None:
    """The first read contains frames of three seconds. They are stamped with their own times."""
    for seed in SEEDS:
        board = Board(seconds=10, skew=1e-4, imu_only=imu_only, first_tick=seed * 1234 + 3)
        rng = random.Random(seed)
        line = board.stream(rng)[rng.randrange(40) :]
        reads = late(bursts(line, rng), rng, jitter_s=JITTER_S, stalls=[(0.0, 1003.004)])
        stamped = stamp(DeviceClock(0.01), board, reads)
        assert spread(stamped.errors(since_s=5.0)) < 0.5e-3
        assert max(map(abs, stamped.errors(since_s=0.1))) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("chunker", [ftdi(restarted_by_data=True), bursts, singles])
def test_lost_frames_shift_no_later_stamps(chunker: Chunker) -> None:
    """One frame in 100 is lost. The displacements' counter shows how many frames are missing.

    So the stamps after a loss are not shifted against the true sampling times.
    """
    stamped = run(Board(seconds=40, skew=1e-4, loss=0.01), chunker, 0)
    errors = stamped.errors()
    usual_s = sorted(errors)[len(errors) // 2]
    assert sum(abs(error - usual_s) < 0.5e-3 for error in errors) > 0.98 * len(errors)


@pytest.mark.slow
def test_without_displacements_lost_samples_are_counted_by_their_arrival() -> None:
    """The board sends no displacements, so no counter shows which samples are lost.

    Each 10 ms of silence counts as one missing sample.
    """
    for seed in SEEDS:
        stamped = run(Board(seconds=40, skew=1e-4, loss=0.01, imu_only=True), bursts, seed)
        assert spread(stamped.errors()) < 0.5e-3


def test_a_stall_that_ends_with_one_sample_at_a_time_loses_none() -> None:
    """A network holds packets back and then delivers them in quick succession.

    The stamps are right.
    """
    for seed in SEEDS:
        board = Board(seconds=10, skew=1e-4)
        rng = random.Random(seed)
        reads = [
            (1005.0 + (at - 1004.9) * 1e-3 if 1004.9 < at < 1005.0 else at, data)
            for at, data in bursts(board.stream(rng), rng)
        ]
        stamped = stamp(DeviceClock(0.01), board, reads)
        errors = stamped.errors()
        assert max(errors) - min(errors) < 1e-3


@pytest.mark.parametrize("skew", [*SKEWS, 0.0])
def test_the_skew_of_the_boards_crystal_is_told_in_ppm(skew: float) -> None:
    """The skew of the board's crystal is reported in ppm.

    It is positive if the crystal is fast, which makes ticks shorter.
    """
    clock = DeviceClock(0.01)
    for tick in range(1000):
        clock.stamps([SAMPLE], tick * 0.01 / (1.0 + skew), WHOLE)
    assert clock.skew_ppm == pytest.approx(1e6 * skew, abs=1.0)


@pytest.mark.parametrize("skew", SKEWS)
def test_a_restarted_board_is_followed_within_two_seconds(skew: float) -> None:
    """After a restart of the board, the stamps increase, with the same offset as before.

    The offset is the difference between stamps and true times. After the restart, the ticks have
    another phase, and SEQ is different.
    """
    clock = DeviceClock(0.01)
    adapter = ftdi(restarted_by_data=True)
    before = run(Board(seconds=10, skew=skew), adapter, 1, clock=clock)
    clock.restart()
    board = Board(seconds=10, skew=skew, begins_at=1012.3456)
    after = run(board, adapter, 2, clock=clock)
    assert after.samples[0][1] > before.samples[-1][1]
    assert after.unevenness() < 0.2e-3
    assert spread(before.errors() + after.errors()) < 0.5e-3


@pytest.mark.parametrize("period_s", [0.01, 0.2])
def test_bytes_that_are_no_sample_do_not_begin_the_clock(period_s: float) -> None:
    """A damaged text line, a second before the first frames, does not start the clock.

    The stamps of the first frames are right, even if the host reads only five times a second.
    """
    for seed in SEEDS:
        board = Board(seconds=4)
        chunks = bursts(board.stream(random.Random(seed)), random.Random(seed))
        reads = [(board.begins_at - 1.0, b"Pausd: 7 \n")]
        for number, group in groupby(chunks, lambda chunk: math.ceil(chunk[0] / period_s)):
            reads.append((number * period_s, b"".join(data for _, data in group)))
        stamped = stamp(DeviceClock(0.01), board, reads)
        assert max(map(abs, stamped.errors(since_s=0.0))) < 0.03


def test_an_outage_that_nobody_told_of_is_found_by_arrival() -> None:
    """The arrival times show a silence of five seconds that the counter SEQ does not show.

    The fitted clock starts again, and the stamps are right.
    """
    clock = DeviceClock(0.01)
    run(Board(seconds=10), bursts, 1, clock=clock)
    after = run(Board(seconds=10, begins_at=1015.0055), bursts, 2, clock=clock)
    assert spread(after.errors()) < 0.5e-3
    assert after.unevenness() < 0.2e-3


@pytest.mark.slow
def test_a_displacement_has_the_stamp_of_its_own_tick() -> None:
    """A displacement has the same stamp as the IMU sample of its tick.

    An adapter may cut the stream between the two frames.
    """
    for chunker in (ftdi(restarted_by_data=True), bursts, singles):
        stamped = run(Board(seconds=10), chunker, 0)
        stamp_of = {tick: stamp_s for tick, stamp_s, _ in stamped.samples}
        assert len(stamped.displacements) > 200
        assert all(stamp_s == stamp_of[tick] for tick, stamp_s, _ in stamped.displacements)


def test_what_seems_to_begin_the_count_anew_tells_nothing_of_the_ticks() -> None:
    """A false displacement that looks like a restart of the board does not disturb the clock.

    The stamps of the samples stay 10 ms apart.
    """
    clock = DeviceClock(0.01)
    true = DisplacementReading(0.0, 0.0, 0.0, "earth", 0.04, 0)
    made_up = DisplacementReading(0.0, 0.0, 0.0, "earth", None, 0, restarted=True)
    after = {tick: [true] for tick in range(0, 200, 4)} | {102: [made_up]}
    stamps_s = [
        clock.stamps([SAMPLE, *after.get(tick, [])], 1000.0 + 0.01 * tick, WHOLE)[0]
        for tick in range(200)
    ]
    differences = [after - before for before, after in pairwise(stamps_s)]
    assert differences == pytest.approx([0.01] * 199, abs=1e-6)


imu_readings = st.builds(
    ImuReading, st.just((0.0, 0.0, 0.0)), st.just((0.0, 0.0, 0.0)), st.integers(0, 40)
)
displacements = st.builds(
    DisplacementReading,
    *[st.just(0.0)] * 3,
    st.just("earth"),
    st.sampled_from([None, 0.04]),
    st.integers(0, 255),
)
edges = st.none() | st.builds(
    SampleBoundary, st.integers(0, 1), st.floats(0.0, 0.0013), st.floats(0.0, 0.0012), st.booleans()
)
reads = st.tuples(st.floats(1e-3, 3.0), st.lists(imu_readings | displacements, max_size=30), edges)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(reads, max_size=60))
def test_any_reads_are_stamped_forwards_and_not_later_than_they_arrived(
    reads: list[tuple[float, list[ImuReading | DisplacementReading], SampleBoundary | None]],
) -> None:
    """Stamps never decrease, and never exceed arrival times, even if counters are wrong.

    A ``SampleBoundary``, which says where a read ends in the stream of samples, may be wrong, too.
    """
    clock = DeviceClock(0.01)
    now, last_s = 1000.0, -math.inf
    for passed_s, readings, edge in reads:
        now += passed_s
        for reading, stamp_s in zip(readings, clock.stamps(readings, now, edge), strict=True):
            assert stamp_s <= now
            assert last_s < stamp_s if isinstance(reading, ImuReading) else last_s <= stamp_s
            last_s = stamp_s


def test_displacements_alone_are_stamped_forwards() -> None:
    """The board sends no samples, only a displacement every 40 ms. The stamps are 40 ms apart."""
    clock = DeviceClock(0.01)
    reading = DisplacementReading(0.0, 0.0, 0.0, "earth", 0.04, 0)
    stamps_s = [clock.stamps([reading], 1000.0 + 0.04 * k, WHOLE)[0] for k in range(500)]
    differences = [after - before for before, after in pairwise(stamps_s)]
    assert differences == pytest.approx([0.04] * 499, abs=1e-6)


def test_stamps_increase_even_where_arrival_times_do_not() -> None:
    """A coarse clock gives all reads the same time.

    The stamps still increase, by a microsecond each.
    """
    clock = DeviceClock(0.01)
    stamps_s = [clock.stamps([SAMPLE], 5.0, WHOLE)[0] for _ in range(100)]
    assert all(before < after for before, after in pairwise(stamps_s))
    assert stamps_s[-1] == pytest.approx(5.0, abs=1e-3)
