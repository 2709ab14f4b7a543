# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Fuzz tests of the decoder, with any bytes, at any times, in any chunks.

``test/integrity`` measures how rarely a damaged stream gives a wrong frame.
"""

from typing import Any

import pytest
from frame_strategies import any_streams, believable_frames, calm_frames, paused_frames
from hypothesis import example, given, settings
from hypothesis import strategies as st
from interpreted import interpreted_only
from strategies import chunkings

from omnibot_driver.core.omnibot import FrameDecoder, ImuFrame, decoder, encode, trellis
from omnibot_driver.core.omnibot.decoder import DOUBT_BYTES
from omnibot_driver.core.omnibot.frames import LENT, Frame, decode_measured, measure

REST = encode(ImuFrame((120, -80, -16384), (1, 2, 3)))
THIRD = 180
"""Number of bytes in a third of a stream. The decoder's buffers are full after the first third."""
times_s = st.sampled_from([0.0, 1e-4, 0.005, 0.01, 0.016, 0.099, 0.2, 5.0])


def assert_stand_in_order(found: list[Frame], stream: bytes) -> None:
    """Check that ``stream`` contains the frames of ``found`` in order.

    Frames are compared as text, because a NaN in a pose is not equal to itself.
    """
    at = 0
    for frame in found:
        while at < len(stream):
            length = measure(stream, at)
            if length > 0 and repr(decode_measured(stream[at : at + length])) == repr(frame):
                at += length
                break
            at += 1
        else:
            pytest.fail(f"{frame} is not in the stream, or out of order")


@pytest.mark.slow
@settings(max_examples=40)
@given(any_streams, st.data())
def test_any_bytes_at_any_times_give_only_frames_that_stand_there(
    stream: bytes, data: st.DataObject
) -> None:
    """All returned frames are in the stream, in order and without overlap.

    The decoder holds fewer bytes than its limit, ``DOUBT_BYTES``.
    """
    made, now, found = FrameDecoder(), 0.0, []
    for chunk in data.draw(chunkings(stream)):
        now += data.draw(times_s)
        found += made.feed(chunk, now)
        assert len(made._held) < DOUBT_BYTES
    found += made.flush(now)
    assert not made._held
    assert_stand_in_order(found, stream)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(st.lists(st.one_of(believable_frames, paused_frames), max_size=6)), st.data())
def test_all_frames_between_silences_come_in_any_chunks(
    bursts: list[list[Frame]], data: st.DataObject
) -> None:
    """The board sends frames in bursts, with silences between them. A chunk may end at any byte.

    The decoder returns all frames.
    """
    made, now = FrameDecoder(), 0.0
    found = made.feed(REST * 2, now)[2:]
    for burst in bursts:
        now += 1.0
        for chunk in data.draw(chunkings(b"".join(map(encode, burst)))):
            found += made.feed(chunk, now)
    found += made.flush(now)
    assert found == [frame for burst in bursts for frame in burst]


@pytest.mark.slow
@settings(max_examples=40)
@given(calm_frames)
def test_a_calm_frame_comes_out_with_its_last_byte(frames: list[Frame]) -> None:
    """A frame that is similar to the last one of its kind is returned when its last byte arrives.

    The only exception is a last byte that may begin a header.
    """
    made, came = FrameDecoder(), 0
    made.feed(REST * 2, 0.0)
    for number, frame in enumerate(frames, 1):
        content = encode(frame)
        for byte in content[:-1]:
            came += len(made.feed(bytes([byte]), 0.0))
        assert came >= number - 1
        came += len(made.feed(content[-1:], 0.0))
        assert came == number or (content[-1] in LENT and came == number - 1)


@pytest.mark.parametrize("word", [-6, -5, -4])
def test_in_free_fall_only_a_look_alike_of_a_header_is_lost(word: int) -> None:
    """In free fall, only an IMU frame with an acceleration word of -6 is lost.

    The bytes of -6 are those of a header. Above 0.5 g, such a frame is not lost.
    """
    made, fall = FrameDecoder(), ImuFrame((word, 3, 900), (1, 2, 3))
    found = made.feed(REST * 2 + encode(fall) + REST * 4, 0.0) + made.flush(1.0)
    assert found.count(fall) == (word != -6)
    assert len(found) - found.count(fall) == 6


ADVERSARIES = {
    "FF": b"\xff",
    "FF FA": b"\xff\xfa",
    "FF FB": b"\xff\xfb",
    "FF FC": b"\xff\xfc",
    "all headers": b"\xff\xfa\xff\xfb\xff\xfc",
    "P": b"P",
    "text begun": b"Paused: ",
    "text begun with a number": b"Paused: 25",
    "text too large": b"Paused: 256 \n",
    "zeros": b"\x00",
    "one frame and a byte": REST + b"\x00",
    "two frames and a byte": REST * 2 + b"\x00",
    "two frames and FF": REST * 2 + b"\xff",
    "headers without gravity": b"\xff\xfa" + bytes(12),
    "FF FB and a frame": b"\xff\xfb" + REST,
    "a text within a frame": REST[:7] + b"Paused: 3 \n" + REST[7:],
}


def work(
    monkeypatch: pytest.MonkeyPatch, stream: bytes, chunk_length: int, pause_s: float = 0.0
) -> tuple[list[int], int]:
    """Return the decoder's work after each chunk, and the largest number of bytes that it held.

    The list of work begins with 0. A unit of work is one byte or one edge of the search graph.
    """
    done, measure, forward = 0, decoder.measure, trellis._Search._forward

    def measuring(data: bytes | bytearray, at: int) -> int:
        nonlocal done
        done += 1
        return measure(data, at)

    def searching(search: trellis._Search, *of: Any) -> None:
        nonlocal done
        forward(search, *of)
        done += len(search._data) + len(search._edges) * (1 + len(search._pauses.gaps))

    sums, most = [0], 0
    with monkeypatch.context() as patch:
        patch.setattr(decoder, "measure", measuring)
        patch.setattr(trellis._Search, "_forward", searching)
        made = FrameDecoder()
        for number, at in enumerate(range(0, len(stream), chunk_length)):
            made.feed(stream[at : at + chunk_length], number * pause_s)
            sums.append(done)
            most = max(most, len(made._held))
    return sums, most


@interpreted_only
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "chunk_length", "pause_s"),
    [
        (name, *chunks)
        for name in ADVERSARIES
        for chunks in [(1, 0), (1, 0.005), (1_000_000, 0)]
        if chunks != (1, 0.005) or name not in ("FF FA", "FF FB", "FF FC")  # in "all headers"
    ],
)
def test_work_is_linear_and_memory_bounded(
    monkeypatch: pytest.MonkeyPatch, name: str, chunk_length: int, pause_s: float
) -> None:
    """The decoder's work grows only linearly, even for a repeated pattern that is hard to decode.

    The number of bytes that the decoder holds stays below its limit.
    """
    stream = ADVERSARIES[name] * (THIRD // len(ADVERSARIES[name]))
    if chunk_length < THIRD:
        sums, most = work(monkeypatch, stream * 3, chunk_length, pause_s)
        chunks = len(sums) - 1
        once, twice, thrice = sums[chunks // 3], sums[2 * chunks // 3], sums[chunks]
    else:
        (_, once), _ = work(monkeypatch, stream, chunk_length)
        (_, twice), _ = work(monkeypatch, stream * 2, chunk_length)
        (_, thrice), most = work(monkeypatch, stream * 3, chunk_length)
    assert most < DOUBT_BYTES
    assert thrice - twice <= 1.1 * (twice - once) + 5000


@pytest.mark.slow
@given(st.binary(min_size=1, max_size=40), st.sampled_from([1, 5, 13, 62, 4096]))
@settings(max_examples=20)
@example(b"\xff\xfb\xff\xfa", 1)
def test_no_repeated_pattern_costs_much_more_than_another(
    pattern: bytes, chunk_length: int
) -> None:
    """A stream repeats a pattern. For all patterns, the work for each byte has the same bound."""
    stream = pattern * (1000 // len(pattern))
    with pytest.MonkeyPatch.context() as patch:
        sums, _ = work(patch, stream, chunk_length)
    assert sums[-1] <= 1000 * len(stream)
