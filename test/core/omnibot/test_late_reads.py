# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of late reads: bytes wait in the computer until they are read, and none of them is lost."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from functools import cache
from itertools import takewhile

import pytest
from frame_strategies import triples
from hypothesis import given, settings
from hypothesis import strategies as st
from streams import BYTE_S, LEAD_IN, REST, RUNNING_STREAMS, TICK_S, frames_of, ticks_of

from omnibot_driver.core.omnibot import DeltaFrame, FrameDecoder, ImuFrame, PausedFrame, encode
from omnibot_driver.core.omnibot.frames import Frame

Read = tuple[bytes, float]
Reads = Iterator[Read]

STOPS_S = (2e-3, 5e-3, 8.8e-3, 9e-3, 10e-3, 10.1e-3, 20e-3, 0.1, 0.3)
"""Times in s for which a reader pauses.

Some are close to the idle time between two ticks, 8.8 ms, or to a tick, 10 ms.
"""


@cache
def arrivals(ticks: tuple[bytes, ...]) -> tuple[bytes, list[float]]:
    """Return all bytes, and the arrival time of each byte in s."""
    times = [
        number * TICK_S + (place + 1) * BYTE_S
        for number, tick in enumerate(ticks)
        for place in range(len(tick))
    ]
    return b"".join(ticks), times


def stopped(
    ticks: tuple[bytes, ...], place: int, stop_s: float, *, most: int = 4096, piece: int = 1
) -> Reads:
    """Yield the reads of a reader that reads ``place`` bytes, pauses for ``stop_s``, and goes on.

    * ``most``: largest number of bytes in a read.
    * ``piece``: number of bytes to wait for when no unread bytes are left.
    """
    data, times = arrivals(ticks)
    at, now = 0, 0.0
    while at < len(data):
        there = bisect_right(times, now)
        if there <= at:
            now = times[min(at + piece, len(data)) - 1]
            there = bisect_right(times, now)
        if at < place <= there:
            yield data[at:place], now
            at, now = place, now + stop_s
            continue
        end = min(there, at + most)
        yield data[at:end], now
        at, now = end, now + 20e-6


def heard(reads: Iterable[Read], begun: FrameDecoder | None = None) -> list[Frame]:
    """Return the frames of all reads.

    ``begun``: a decoder that has already decoded the reads before these; None for a new decoder.
    """
    made, found, last_s = begun or FrameDecoder(), [], 0.0
    for data, now in reads:
        assert now >= last_s
        last_s = now
        found += made.feed(data, now)
    return found + made.flush(last_s)


def heard_each(readers: Sequence[Iterable[Read]]) -> list[list[Frame]]:
    """Decode the reads of several readers separately, and return a list of frames for each reader.

    Reads at the beginning that are equal for all readers are decoded only once.
    """
    lists = [list(reads) for reads in readers]
    made, found, common = FrameDecoder(), [], 0
    for (data, now), *_ in takewhile(lambda reads: len(set(reads)) == 1, zip(*lists, strict=False)):
        found += made.feed(data, now)
        common += 1
    return [found + heard(reads[common:], deepcopy(made)) for reads in lists]


@pytest.mark.slow
@pytest.mark.parametrize("stop_s", STOPS_S)
@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_reader_that_is_stopped_anywhere_loses_nothing(name: str, stop_s: float) -> None:
    """A reader that pauses once, after any byte of a frame, loses no frame.

    Before the pause, the reader reads promptly for 0.5 s. The test repeats this with the pause at
    different bytes of five frames.
    """
    ticks = ticks_of(name)[: 62 + round(stop_s / TICK_S)]
    sent = [frame for _, frame in frames_of(b"".join(ticks))]
    begin = len(b"".join(ticks[:50]))
    places = range(begin, begin + 5 * 14, 3 if stop_s == 5e-3 else 9)
    found = heard_each([stopped(ticks, place, stop_s) for place in places])
    assert [place for place, frames in zip(places, found, strict=True) if frames != sent] == []


@pytest.mark.slow
@pytest.mark.parametrize("most", [1, 8, 32])
@pytest.mark.parametrize("piece", [1, 4])
def test_nor_does_one_that_catches_up_a_few_bytes_at_a_time(piece: int, most: int) -> None:
    """A reader pauses once. Then it reads only a few bytes at a time until it has caught up.

    No frame is lost.
    """
    for stop_s in STOPS_S:
        ticks = ticks_of("driving")[: 62 + round(stop_s / TICK_S)]
        sent = [frame for _, frame in frames_of(b"".join(ticks))]
        begin = len(b"".join(ticks[:50]))
        places = range(begin, begin + 4 * 14, 11)
        found = heard_each(
            [stopped(ticks, place, stop_s, most=most, piece=piece) for place in places]
        )
        missed = [place for place, frames in zip(places, found, strict=True) if frames != sent]
        assert missed == [], f"stopped for {stop_s} s"


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.lists(st.tuples(triples, triples, st.booleans()), min_size=4, max_size=12),
    st.lists(st.floats(0.0, 0.03), min_size=1, max_size=12),
)
def test_any_content_comes_through_a_reader_that_is_always_late(
    content: list[tuple[tuple[int, int, int], tuple[int, int, int], bool]], late_s: list[float]
) -> None:
    """If each read is late, no frame is lost, whatever the frames contain.

    First, 24 equal frames are read in time. In the late frames, the acceleration is at least 1 g.
    """
    sent: list[Frame] = [REST] * 24
    ticks = [encode(REST)] * 24
    for seq, (accel, gyro, delta) in enumerate(content):
        frames: list[Frame] = [ImuFrame((accel[0], accel[1], -16384), gyro)]
        frames += [DeltaFrame(1, 2, 3, seq)] * delta
        sent += frames
        ticks.append(b"".join(map(encode, frames)))
    sent += [REST] * 4
    ticks += [encode(REST)] * 4
    data, times = arrivals(tuple(ticks))

    def reads() -> Reads:
        at, number = 0, 0
        while at < len(data):
            late = at >= 24 * 14
            now = times[at] + (late_s[number % len(late_s)] if late else 0.0)
            number += late
            end = bisect_right(times, now)
            yield data[at:end], now
            at = end

    assert heard(reads()) == sent


@pytest.mark.parametrize("place", range(1, 11))
def test_a_text_whose_reader_was_stopped_comes_out(place: int) -> None:
    """A frame and a «Paused» text are returned although the reader pauses within each of them."""
    ticks = [encode(REST)] * 40
    text = b"Paused: 0 \n"
    made = FrameDecoder()
    found = []
    for number, tick in enumerate(ticks[:-1]):
        found += made.feed(tick, number * TICK_S)
    found += made.feed(ticks[-1][:place], 0.39)
    found += made.feed(ticks[-1][place:], 0.41)
    found += made.feed(text[:place], 0.9)
    found += made.feed(text[place:], 1.2)
    assert found == [REST] * 40 + [PausedFrame(0)]


def test_pieces_that_straddle_a_silence_are_read() -> None:
    """If a piece spans the silence between two «Paused» texts, both texts are still returned.

    The adapter delivers pieces of 8 bytes.
    """
    made, found = FrameDecoder(), []
    texts = b"".join(b"Paused: %d \n" % n for n in range(5))
    for number in range(0, len(texts), 8):
        found += made.feed(texts[number : number + 8], number * 0.1)
    assert found == [PausedFrame(n) for n in range(5)]


def test_where_the_line_was_cut_a_pause_still_tells() -> None:
    """The line is cut in one frame, and works again in a later frame.

    The two parts together have the length of a frame, but the decoder rejects them because of the
    pause in between.
    """
    ticks = [encode(ImuFrame((120 + n, -80, -16384), (1, 2, n))) for n in range(80)]
    for cut in range(3, 12):
        hurt = [*ticks[:50], ticks[50][:cut], b"", ticks[52][cut:], *ticks[53:]]
        made, found = FrameDecoder(), []
        for number, tick in enumerate(hurt):
            shift = cut if number == 52 else 0
            for place in range(len(tick)):
                now = number * TICK_S + (shift + place + 1) * BYTE_S
                found += made.feed(tick[place : place + 1], now)
        found += made.flush(1.0)
        whole = [frame for tick in ticks for _, frame in frames_of(tick)]
        assert found == whole[:50] + whole[53:], f"cut after {cut} bytes"


def test_a_line_that_was_out_for_long_is_read_anew() -> None:
    """The line is interrupted for 0.5 s in the middle of a frame.

    The decoder discards this frame. It does not take the new bytes for the end of this frame.
    """
    made = FrameDecoder()
    found = made.feed(LEAD_IN + encode(REST)[:5], 0.0)
    other = ImuFrame((100, -70, -16300), (2, 3, 4))
    for number in range(3):
        found += made.feed(encode(other), 0.5 + number * TICK_S)
    assert found == [REST, REST, other, other, other]


LATE_ENDS = {
    "the rest came at the pace of the line, and the next tick in one piece": [
        "+8.6 006affc7", "+0.3 0052e4",
        "+0.5 fffa0006", "+0.4 ffbdbfaa", "+0.4 00070000", "+0.3 fa1f",
    ],
    "every tick since was late by half a tick": [
        "+8.6 006affc70052e4", "+8.2 fffa0006ffbdbfaa00070000fa1f",
        *["+10 fffaffecff45c01500010000fa24"] * 6,
    ],
    "no two reads since were equally late": [
        "+38 006affc7", "+0.3 0052e4", *(
            f"+{late} {piece}"
            for late in (3.5, 4.1, 3.8, 6.2, 4.9, 3.6)
            for piece in ("fffa0006", "ffbdbfaa", "00070000", "fa1f")
        ),
    ],
}  # fmt: skip
"""Cases by name: the reads after the first two bytes of a delta.

Each text is one read: the time since the previous read in ms, and its bytes.
"""


@pytest.mark.parametrize("name", LATE_ENDS)
def test_a_late_end_belongs_to_its_frame_where(name: str) -> None:
    """The end of a delta is read late, as on a busy computer.

    Nevertheless, the decoder returns the delta.
    """
    made, ticks = FrameDecoder(), ticks_of("driving")[:96]
    found, now = [], 0.0
    for number, tick in enumerate(ticks):
        now = number * TICK_S
        found += made.feed(tick, now)
    imu = bytes.fromhex("fffaffecff45c01500010000fa24")
    found += made.feed(imu, now + 10e-3)
    found += made.feed(bytes.fromhex("fffb"), now + 10.3e-3)
    now += 10.3e-3
    for read in LATE_ENDS[name]:
        later_ms, data = read.split(maxsplit=1)
        now += 1e-3 * float(later_ms)
        found += made.feed(bytes.fromhex(data), now)
    for number in range(1, 8):
        found += made.feed(imu, now + number * 0.8 * TICK_S)
    assert not made.statistics.discarded_bytes
    assert DeltaFrame(0x6A, -57, 0x52, 0xE4) in found
