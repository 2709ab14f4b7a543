# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of three shortcuts of the decoder: none of them changes the result."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise, product
from math import inf
from random import Random
from typing import Any

import pytest
from carriage import CHUNKERS, FAULTS, receive
from hypothesis import given, settings
from hypothesis import strategies as st
from interpreted import interpreted_only
from truth import SCENARIOS, generate

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.omnibot import (
    FrameDecoder,
    ImuFrame,
    OmniBot,
    OmniBotSettings,
    board,
    decoder,
    encode,
    trellis,
)
from omnibot_driver.core.omnibot.cost_model import NOTHING_KNOWN, Expectation
from omnibot_driver.core.omnibot.decoder import DecoderStatistics
from omnibot_driver.core.omnibot.fast_path import Walk, take_run
from omnibot_driver.core.omnibot.frames import Frame, decode_measured, measure
from omnibot_driver.core.omnibot.gaps import BYTE_S, InterFrameGaps
from omnibot_driver.core.omnibot.lower_bound import least_costs
from omnibot_driver.core.omnibot.single_imu import take_single
from omnibot_driver.core.omnibot.translation import Translation

pytestmark = interpreted_only

SECONDS = 2.0
Outcome = list[tuple[list[Frame], list[int], DecoderStatistics, bytes | None]]
Chunks = list[tuple[bytes, float]]

TRUTHS = {name: generate(scenario, 25, SECONDS) for name, scenario in SCENARIOS.items()}


def outcome(chunks: Chunks, *, quick: bool) -> Outcome:
    """Return the decoder's result for each chunk: frames, counts, and the bytes not yet decoded.

    ``quick``: whether the decoder may use its shortcuts.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not quick:
            patch.setattr(decoder, "take_run", lambda _held, at, context, *_: (at, context))
            patch.setattr(trellis, "least_costs", lambda data: [0.0] * (2 * len(data) + 3))
            patch.setattr(trellis, "STEP", inf)
        tested, translation = FrameDecoder(), Translation(OmniBotSettings())
        found: Outcome = []
        for data, now in chunks:
            translation.singles_to_come = 1
            if quick and take_single(data, now, tested, translation):
                frames, skipped = [tested.context.imu], [0]
            else:
                frames, skipped = tested.feed(data, now), tested.skipped
            found.append((frames, skipped, replace(tested.statistics), tested.begun))
        found.append((tested.flush(now + 1.0), tested.skipped, tested.statistics, None))
    return found


def chunks_of(scenario: str, fault: str, chunker: str, seed: int) -> Chunks:
    """Return a damaged stream in the chunks in which it arrives."""
    random = Random(f"{scenario} {fault} {chunker} {seed}")
    received = receive(TRUTHS[scenario], FAULTS[fault], random)
    chunks, start = [], 0
    for end, now in CHUNKERS[chunker](received, random):
        chunks.append((received.data[start:end], now))
        start = end
    return chunks


def one_in(number: int, *choices: Iterable[str]) -> list[Any]:
    """Return about one in ``number`` of the combinations of ``choices``.

    A combination has one choice from each list. With three or more lists of at least ``number``
    choices each, every pair of choices from two different lists occurs.
    """
    combined = product(*(enumerate(names) for names in choices))
    return [
        pytest.param(*(name for _, name in each))
        for each in combined
        if sum(place for place, _ in each) % number == 0
    ]


@pytest.mark.parametrize(("scenario", "fault", "chunker"), one_in(5, SCENARIOS, FAULTS, CHUNKERS))
def test_streams_come_out_alike(scenario: str, fault: str, chunker: str) -> None:
    """A stream is damaged or undamaged.

    Each call of the decoder returns the same frames and counts, with shortcuts and without.
    """
    chunks = chunks_of(scenario, fault, chunker, 1)
    assert outcome(chunks, quick=True) == outcome(chunks, quick=False)


pieces = st.sampled_from(
    [bytes(TRUTHS["at rest, noisy gyro"].data[at : at + 42]) for at in range(0, 1700, 13)]
) | st.binary(max_size=20)


@settings(max_examples=100)
@given(st.lists(st.tuples(pieces, st.sampled_from([0.0, 0.001, 0.01, 0.2])), min_size=1))
def test_pieces_of_streams_and_noise_come_out_alike(arrivals: list[tuple[bytes, float]]) -> None:
    """Pieces of streams and noise arrive in any order, up to 0.2 s apart.

    The shortcuts of the decoder change no result.
    """
    now, chunks = 0.0, []
    for data, pause_s in arrivals:
        now += pause_s
        chunks.append((data, now))
    ways = [repr(outcome(chunks, quick=quick)) for quick in (True, False)]  # NaN != NaN
    assert ways[0] == ways[1]


@pytest.mark.parametrize(
    ("scenario", "fault", "chunker"),
    one_in(
        2,
        SCENARIOS,
        ["none, starting anywhere", "1 byte in 100 lost"],
        ["whole bursts", "1-8 bytes", "single bytes", "FTDI"],
    ),
)
def test_readings_come_out_alike(
    scenario: str, fault: str, chunker: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The board's code gets requests, such as a pause, while a stream arrives.

    The decoder's shortcuts change neither the board's readings nor its mode.
    """
    chunks = chunks_of(scenario, fault, chunker, 2)

    def told() -> list[object]:
        tested = OmniBot(OmniBotSettings())
        found: list[object] = []
        for number, (data, now) in enumerate(chunks):
            if number % 97 == 13:
                tested.start()
            if number % 89 == 17:
                tested.discard()
                tested.silence()
            if number % 31 == 5:
                with suppress(RequestRefused):
                    tested.pause()
            found.append((tested.receive(data, now), tested.edge, tested.mode, tested.figures))
        return found

    quick = told()
    monkeypatch.setattr(board, "take_single", lambda *_: None)
    monkeypatch.setattr(board, "is_begun", lambda *_: False)
    assert quick == told()


def test_an_imu_frame_that_comes_alone_is_not_fed(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than half of the reads of a stream use the decoder's shortcut for single IMU frames.

    With only a few such reads, the other tests of this file would not check this shortcut.
    """
    fed = []
    feed = FrameDecoder.feed

    def count(self: FrameDecoder, data: bytes, now: float) -> list[Frame]:
        fed.append(data)
        return feed(self, data, now)

    monkeypatch.setattr(FrameDecoder, "feed", count)
    chunks = chunks_of("driving", "none, starting anywhere", "whole bursts", 1)
    tested = OmniBot(OmniBotSettings())
    for data, now in chunks:
        tested.receive(data, now)
    assert len(fed) < 0.5 * len(chunks)


def test_calm_streams_take_the_quick_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stream of a driving robot is undamaged.

    The quick loop of the decoder handles more than 90 % of its IMU frames.
    """
    weighed = []
    weigh = decoder.Expectation.weigh

    def count(self: decoder.Expectation, frame: Frame, before: decoder.Context) -> object:
        weighed.append(type(frame))
        return weigh(self, frame, before)

    monkeypatch.setattr(decoder.Expectation, "weigh", count)
    chunks = chunks_of("driving", "none, starting anywhere", "whole bursts", 1)
    found = outcome(chunks, quick=True)
    imus = sum(type(frame) is ImuFrame for frames, *_ in found for frame in frames)
    assert weighed.count(ImuFrame) < 0.1 * imus


def test_a_shock_within_a_block_takes_the_quick_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """The readings jump, stay at the new values for a moment, and jump back.

    The quick loop of the decoder handles all these frames.
    """
    rest = ImuFrame((120, -80, -16384), (1, 2, 3))
    shock = [ImuFrame((9000, -80, -16384), (1, 2, 3)), ImuFrame((120, 7000, -16384), (1, 9000, 3))]
    sent = [rest, *shock, rest, rest, rest]
    tested = FrameDecoder()
    tested.feed(encode(rest) * 20, 0.0)

    def weigh(*_: object) -> None:
        pytest.fail("weighed")

    monkeypatch.setattr(decoder.Expectation, "weigh", weigh)
    assert tested.feed(b"".join(map(encode, sent)), 0.0) == sent


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_what_was_known_is_what_weighing_every_frame_says(scenario: str) -> None:
    """``known_after`` returns the same context as an evaluation of all frames from the first one.

    ``known_after`` evaluates at most 6 frames again.
    """
    data, expectation = bytes(TRUTHS[scenario].data), Expectation(16384.0)
    at, context, walk = 0, NOTHING_KNOWN, Walk(NOTHING_KNOWN)
    expected = [context]
    while at < len(data):
        at, context = take_run(data, at, context, expectation, "big", walk)
        if at < len(data):
            end = at + measure(data, at)
            frame = decode_measured(data[at:end])
            walk.add(end, frame, context)
            _, context = expectation.weigh(frame, context)
            at = end
    for frame in walk.frames:
        expected.append(expectation.weigh(frame, expected[-1])[1])
    assert [walk.known_after(n, expectation) for n in range(len(expected))] == expected
    places = [place for place, _ in walk.known]
    assert max(b - a for a, b in pairwise([*places, len(walk.frames)])) <= 6


def test_most_of_the_trellis_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The decoder's shortcut omits most edges of the trellis.

    Otherwise, the other tests would compare two complete searches.
    """
    edges = {True: 0, False: 0}
    pieces = trellis._Search.pieces
    chunks = chunks_of("driving", "1 byte in 100 lost", "4096-byte blocks", 1)
    for quick in edges:

        def count(search: trellis._Search, quick: bool = quick) -> Sequence[trellis.Segment]:
            edges[quick] += len(search._edges)
            return pieces(search)

        monkeypatch.setattr(trellis._Search, "pieces", count)
        outcome(chunks, quick=quick)
    assert 0 < edges[True] < 0.4 * edges[False]


@settings(max_examples=200)
@given(st.lists(pieces, min_size=1, max_size=8).map(b"".join).map(lambda data: data[:170]))
def test_the_rest_never_costs_less_than_its_bound(data: bytes) -> None:
    """``least_costs`` is a lower bound of the cost from each node of the trellis to the end.

    Along an edge, the bound falls by at most the edge's cost, and it is 0 at the end.
    """
    least = least_costs(data)
    search = trellis._Search(
        data, NOTHING_KNOWN, Expectation(16384.0), InterFrameGaps(BYTE_S), "big"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trellis, "least_costs", lambda data: [0.0] * (2 * len(data) + 3))
        patch.setattr(trellis, "STEP", inf)
        search.run(in_step=False, closed=False)
    for start, end, price, _, _ in search._edges:
        assert least[start] <= price + least[end] + 1e-9
    assert least[search._end] == 0.0
