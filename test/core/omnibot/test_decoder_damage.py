# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the decoder on damaged streams, on texts between frames, and after silences."""

import math
from random import Random

import pytest
from frame_strategies import frames
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import chunkings
from streams import (
    LEAD_IN,
    REST,
    RUNNING_STREAMS,
    TICK_S,
    byte_by_byte,
    decoded,
    frames_of,
    is_subsequence,
    ticks_of,
)

from omnibot_driver.core.omnibot import (
    DeltaFrame,
    FrameDecoder,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    encode,
)
from omnibot_driver.core.omnibot.frames import Frame

# Damaged streams


def assert_back_in_step(
    sent: list[tuple[int, Frame]], hurt: set[int], found: list[Frame], place: int
) -> None:
    """Check that no frame is false, and that only frames near the damage are missing.

    ``hurt``: numbers of the frames that the damage has changed or split.

    ``place``: position of the damage, for the message.
    """
    truth = [frame for _, frame in sent]
    assert is_subsequence(found, truth), f"a false frame came out: damage at {place}"
    first, last = min(hurt), max(hurt)
    before, after = truth[: max(0, first - 1)], truth[last + 3 :]
    assert found[: len(before)] == before, f"damage at {place}"
    assert found[len(found) - len(after) :] == after, f"damage at {place}"
    for number in hurt:
        following = truth[number + 1 :]
        assert truth[number] not in found or truth[number] in following, f"damage at {place}"


def damage_places(sent: list[tuple[int, Frame]]) -> list[tuple[int, int]]:
    """Return the position of each byte of frames 20 to 37, with the number of its frame."""
    ends = [at for at, _ in sent[1:]]
    return [
        (place, number)
        for number in range(20, 38)
        for place in range(sent[number][0], ends[number])
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_that_lost_a_byte_does_not_come_out(name: str) -> None:
    """A frame has lost one byte, and is not returned.

    The decoder finds the true frames again within two frames.
    """
    stream = b"".join(ticks_of(name)[:48])
    sent = frames_of(stream)
    for place, number in damage_places(sent):
        # If two neighbouring bytes are equal, losing either of them gives the same stream. So it is
        # unknown in which frame a byte is missing.
        hurt = set() if stream[place] in (stream[place - 1], stream[place + 1]) else {number}
        found = decoded([stream[:place] + stream[place + 1 :]])
        if hurt:
            assert_back_in_step(sent, hurt, found, place)
        else:
            assert is_subsequence(found, [frame for _, frame in sent]), f"damage at {place}"


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("extra", [0x00, 0x50, 0xFA, 0xFB, 0xFC, 0xFF])
def test_a_gained_byte_never_makes_more_than_one_false_frame(name: str, extra: int) -> None:
    """A byte is inserted into a stream. At most one false frame is returned.

    Afterwards, the decoder is in step again: it finds the true frames.
    """
    stream = b"".join(ticks_of(name)[:48])
    sent = frames_of(stream)
    truth = [frame for _, frame in sent]
    for place, number in damage_places(sent)[extra % 5 :: 5]:
        found = decoded([stream[:place] + bytes([extra]) + stream[place:]])
        before, after = truth[: number - 1], truth[number + 4 :]
        assert found[: len(before)] == before, f"damage at {place}"
        assert found[len(found) - len(after) :] == after, f"damage at {place}"
        between = found[len(before) : len(found) - len(after)]
        false = [frame for frame in between if frame not in truth]
        assert len(false) <= 1, f"damage at {place}"


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_gained_byte_hardly_ever_makes_a_false_frame(name: str) -> None:
    """At most 1 in 30 random bytes that are inserted into a stream makes a false frame.

    The limit also holds if gyro values look like headers.
    """
    stream = b"".join(ticks_of(name)[:48])
    sent = frames_of(stream)
    truth = [frame for _, frame in sent]
    random, false, places = Random(13), 0, damage_places(sent)
    for place, _ in places:
        extra = bytes([random.randrange(256)])
        found = decoded([stream[:place] + extra + stream[place:]])
        false += not is_subsequence(found, truth)
    assert false <= len(places) / 30


@pytest.mark.parametrize(
    "extra", [b"\x00", b"P", b"\xfa", b"\xff", b"\xff\xff", b"\xff\xfd", b"Pau"]
)
def test_bytes_between_two_frames_cost_at_most_the_one_before_them(extra: bytes) -> None:
    """Extra bytes come between two frames. At most the frame before them is lost."""
    other = ImuFrame((100, 90, -16300), (4, 5, 6))
    after = LEAD_IN * 2
    found = decoded([LEAD_IN + encode(other) + extra + after])
    assert found in ([REST, REST, *[REST] * 4], [REST, REST, other, *[REST] * 4])


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_that_lost_one_byte_and_took_the_next_headers_does_not_come_out(name: str) -> None:
    """A frame that lost a byte is not completed by the first byte of the next header.

    The second byte of this header shows the error.
    """
    ticks = ticks_of(name)[:30]
    truth = [frame for _, frame in frames_of(b"".join(ticks))]
    for number in range(9, 21, 3):
        tick = ticks[number]
        for place in range(2, len(tick)):
            if tick[place] == 0xFF or tick[place - 1] == 0xFF or tick[place - 2] == 0xFF:
                continue  # a header's byte, or a neighbour of one
            hurt = [*ticks[:number], tick[:place] + tick[place + 1 :], *ticks[number + 1 :]]
            found = byte_by_byte(hurt)
            assert is_subsequence(found, truth), f"tick {number}, byte {place}"
            assert len(truth) - 4 <= len(found) < len(truth), f"tick {number}, byte {place}"


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.lists(st.one_of(frames, st.binary(min_size=1, max_size=20)), max_size=20),
    st.data(),
)
def test_rubbish_between_frames_costs_a_few_frames_only(
    pieces: list[Frame | bytes], data: st.DataObject
) -> None:
    """The decoder gets frames and noise, then seven normal frames. It returns the seventh."""
    stream = b"".join(piece if isinstance(piece, bytes) else encode(piece) for piece in pieces)
    made = FrameDecoder()
    for chunk in data.draw(chunkings(stream)):
        made.feed(chunk, 0.0)
    for _ in range(6):
        made.feed(encode(REST), 0.0)
    assert made.feed(encode(REST), 0.0) == [REST]


# Texts between frames


@pytest.mark.parametrize("count", [0, 42, 255])
@pytest.mark.parametrize("ends", ["text", "data"])
def test_a_text_between_frames_may_be_cut_anywhere(count: int, ends: str) -> None:
    """The board sends the text «Paused: i» after frames, and a read ends anywhere within it.

    The text is returned.
    """
    text = encode(PausedFrame(count))
    stream = LEAD_IN + text + (LEAD_IN if ends == "data" else text)
    last = [REST, REST] if ends == "data" else [PausedFrame(count)]
    for place in range(len(stream) + 1):
        assert decoded([stream[:place], stream[place:]]) == [
            REST, REST, PausedFrame(count), *last,
        ]  # fmt: skip


@pytest.mark.parametrize("place", [*range(8), 9, 10])
def test_a_damaged_text_does_not_come_out(place: int) -> None:
    """A «Paused: i» text that has lost one character is not returned.

    The only exception is the blank before the line feed: a text without it may be returned.
    """
    text = b"Paused: 7 \n"
    hurt = text[:place] + text[place + 1 :]
    found = decoded([LEAD_IN + hurt + LEAD_IN + LEAD_IN])
    whole = [PausedFrame(7)] if hurt == b"Paused: 7\n" else []
    assert PausedFrame(7) not in found or whole
    assert found[-2:] == [REST, REST]
    assert len(found) >= 4


# Silence


@pytest.mark.parametrize("length", range(1, 14))
def test_a_partial_frame_before_a_silence_swallows_nothing(length: int) -> None:
    """The line is interrupted within a frame.

    The bytes after the silence do not complete that frame.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:length], 0.0)
    after = [DeltaFrame(1, 2, 3, 4), REST, PoseFrame(1.0, 2.0, 3.0, 4), DeltaFrame(5, 6, 7, 8)]
    found = [out for i, frame in enumerate(after) for out in made.feed(encode(frame), 1 + i / 100)]
    assert found == after


@pytest.mark.parametrize("length", range(1, 14))
def test_a_reboot_in_the_middle_of_a_frame_is_heard_with_its_first_text(length: int) -> None:
    """The board reboots while it sends a frame. After the boot, it first sends a «Paused» text.

    The decoder returns this text at once.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:length], 0.0)
    assert made.feed(b"Paused: 0 \n", 0.3) == [PausedFrame(0)]


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("late_s", [0.15, 1.0])
def test_a_late_backlog_costs_no_frame(name: str, late_s: float) -> None:
    """If the reader is late in the middle of a frame, no frame is lost.

    The decoder completes the frame with the bytes that have waited.
    """
    ticks = ticks_of(name)
    stream = b"".join(ticks[: round(1 + late_s / TICK_S) + 40])
    sent = [frame for _, frame in frames_of(stream)]
    start = len(b"".join(ticks[:20]))
    backlog = len(b"".join(ticks[20 : 20 + round(late_s / TICK_S)]))
    for place in range(start, start + 38):
        made = FrameDecoder()
        found = made.feed(stream[:place], 0.2)
        found += made.feed(stream[place : place + backlog], 0.2 + late_s)
        found += made.feed(stream[place + backlog :], 0.21 + late_s)
        found += made.flush(0.3 + late_s)
        assert found == sent, f"cut at {place}"


def test_a_doubtful_frame_before_a_silence_comes_out_before_what_follows() -> None:
    """A frame that ends in FF is returned before the frame that comes after a silence.

    The decoder holds such a frame until the silence shows that FF does not begin a header.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN, 0.0)
    doubtful = DeltaFrame(1, 2, 3, 255)
    assert made.feed(encode(doubtful), 0.0) == []
    assert made.feed(encode(REST), 1.0) == [doubtful, REST]


def test_flush_tells_what_can_still_be_told() -> None:
    """``flush`` returns a complete frame that the decoder has held, and no incomplete frame."""
    doubtful = DeltaFrame(1, 2, 3, 255)
    in_step = FrameDecoder()
    in_step.feed(LEAD_IN + encode(doubtful), 0.0)
    assert in_step.flush(0.0) == [doubtful]
    assert in_step.flush(0.0) == []
    partial = FrameDecoder()
    partial.feed(LEAD_IN + encode(REST)[:13], 0.0)
    assert partial.flush(0.0) == []


@pytest.mark.parametrize("frame", [REST, DeltaFrame(1, 2, 3, 4), PoseFrame(10.0, -20.0, 300.0, 5)])
def test_flush_tells_the_only_frame_of_a_line(frame: Frame) -> None:
    """``flush`` returns the only frame of a line.

    It does not return a frame that is damaged or impossible, or that comes after discarded bytes.
    """
    data = encode(frame)
    for pieces in ([data], [data[index : index + 1] for index in range(len(data))]):
        alone = FrameDecoder()
        assert [found for piece in pieces for found in alone.feed(piece, 0.0)] == []
        assert alone.flush(0.0) == [frame]
        assert alone.feed(data, 0.0) + alone.flush(0.0) == [frame]
    for index in range(len(data)):
        for damaged in (data[:index] + data[index + 1 :], data[:index] + b"\x41" + data[index:]):
            decoder = FrameDecoder()
            assert decoder.feed(damaged, 0.0) + decoder.flush(0.0) == []
    after = FrameDecoder()
    after.feed(b"\x41\x42", 0.0)
    assert after.flush(0.0) == []
    assert after.feed(data, 0.0) + after.flush(0.0) == []
    impossible = FrameDecoder()
    far = encode(PoseFrame(math.nan, 1e30, 0.0, 5))
    assert impossible.feed(far, 0.0) + impossible.flush(0.0) == []


def test_a_decoder_goes_on_after_a_flush() -> None:
    """After ``flush``, complete frames are decoded as before."""
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:5], 0.0)
    made.flush(0.0)
    assert made.feed(LEAD_IN, 0.0) == [REST, REST]
