# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the decoder on undamaged streams, from their beginning or from any other byte."""

from random import Random

import pytest
from frame_strategies import believable_frames, frames
from hypothesis import example, given, settings
from hypothesis import strategies as st
from strategies import chunkings, cut
from streams import (
    BYTE_S,
    HEADER_BYTES,
    LEAD_IN,
    REST,
    RUNNING_STREAMS,
    STREAMS,
    TICK_S,
    byte_by_byte,
    decoded,
    frames_of,
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

# Undamaged streams


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_is_decoded_whole_by_ticks_and_byte_by_byte(name: str) -> None:
    """The decoder returns all frames of the simulated board in order, and no others."""
    ticks = ticks_of(name)
    sent = [frame for _, frame in frames_of(b"".join(ticks))]
    assert decoded([b"".join(ticks)]) == sent
    assert decoded(ticks) == sent
    assert byte_by_byte(ticks) == sent


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_is_decoded_in_random_chunks(name: str) -> None:
    """Each stream is cut into random chunks, of 1.5 to 200 bytes on average.

    All frames are returned.
    """
    stream = b"".join(ticks_of(name))
    sent = [frame for _, frame in frames_of(stream)]
    random = Random(11)
    for mean_length in (1.5, 3, 7, 14, 40, 200):
        cuts = sorted(random.sample(range(len(stream)), int(len(stream) / mean_length)))
        assert decoded(cut(stream, cuts), step_s=1e-3) == sent


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(believable_frames, max_size=25), st.data())
def test_in_step_any_content_is_delivered_in_any_chunks(
    sent: list[Frame], data: st.DataObject
) -> None:
    """The decoder is synchronized. All frames are returned, whatever their content.

    The content may be a real shock, a stuck sensor, or words that look like headers.
    """
    stream = LEAD_IN + b"".join(map(encode, sent))
    chunks = [chunk for chunk in data.draw(chunkings(stream)) if chunk]  # an empty one is a pause
    assert decoded(chunks, step_s=1e-3) == [REST, REST, *sent]


@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_comes_out_with_its_last_byte(name: str) -> None:
    """A frame of an undamaged stream is returned as soon as its last byte arrives.

    The decoder may wait if the frame's values jump, or if its last byte may begin a header.
    """
    made, found, complete = FrameDecoder(), 0, 0
    last = REST
    for number, tick in enumerate(ticks_of(name)):
        for at, frame in frames_of(tick):
            content, leaps = encode(frame), False
            if isinstance(frame, ImuFrame):
                leaps = (
                    abs(frame.accel[0] - last.accel[0]) + abs(frame.accel[1] - last.accel[1]) > 800
                )
                last = frame
            for place, byte in enumerate(content):
                assert place < 2 or found == complete or complete < 2
                found += len(made.feed(bytes([byte]), number * TICK_S + (at + place) * BYTE_S))
            complete += 1
            doubtful = leaps or content[-1] in HEADER_BYTES
            assert complete < 2 or found == complete or (doubtful and found == complete - 1)


@pytest.mark.slow
@given(believable_frames.filter(lambda frame: not isinstance(frame, PausedFrame)), st.data())
def test_odd_content_waits_for_two_frames_at_the_most(odd: Frame, data: st.DataObject) -> None:
    """The content of a frame looks like damage.

    The frame is returned at the latest when two good frames have followed it.
    """
    made, content = FrameDecoder(), encode(odd) + LEAD_IN + encode(REST)[:2]
    assert made.feed(LEAD_IN, 0.0) == [REST, REST]
    found = [frame for chunk in data.draw(chunkings(content)) for frame in made.feed(chunk, 0.0)]
    assert found[0] == odd


def test_a_shock_goes_on_across_a_delta_and_into_silence() -> None:
    """A shock makes the readings of two IMU frames jump, with a delta in between.

    The second IMU frame arrives in two parts, before a silence. The decoder returns all three
    frames.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN + 300 * encode(REST), 0.0)  # shows how calm the sensor is
    shock = [
        ImuFrame((-6375, 8786, -16371), (2, -8, 1005)),
        DeltaFrame(176, -24, -45, 146),
        ImuFrame((-5884, 8083, -16389), (3, 13, 1223)),
    ]
    content = b"".join(map(encode, shock))
    found = made.feed(content[:-6], 0.016) + made.feed(content[-6:], 0.032)
    assert found + made.feed(b"Paused: 0 \n", 0.7) == [*shock, PausedFrame(0)]


def test_a_knock_right_before_a_silence_is_delivered() -> None:
    """The IMU frame of a knock is returned, although the line is silent right after it.

    A knock is a short shock. The frame arrives in two parts.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN + 300 * encode(REST), 0.0)
    knock = ImuFrame((-2683, 3744, -16377), (0, 1, 1949))
    found = made.feed(encode(knock)[:-3], 0.016) + made.feed(encode(knock)[-3:], 0.032)
    assert found + made.feed(b"Paused: 0 \n", 0.95) == [knock, PausedFrame(0)]


def test_a_doubtful_frame_comes_out_with_the_first_byte_of_the_next() -> None:
    """A frame whose last byte may begin a header is returned when the next frame begins.

    The decoder holds the frame until the first byte of the next frame arrives.
    """
    made = FrameDecoder()
    made.feed(LEAD_IN, 0.0)
    doubtful = DeltaFrame(1, 2, 3, 255)
    assert made.feed(encode(doubtful), 0.0) == []
    assert made.feed(b"\xff", 0.0) == [doubtful]


def test_where_pauses_tell_only_a_frame_that_another_may_follow_waits() -> None:
    """An IMU frame whose end looks like a header is held only if a delta is due next.

    The decoder learns from idle times of the line when a delta is due.
    """
    made, waited = FrameDecoder(), []
    for tick in range(60):
        imu = encode(ImuFrame((120, -80, -16384), (1, 2, -4 - tick % 2)))
        delta = encode(DeltaFrame(0, 0, 0, tick // 4)) if tick % 4 == 3 else b""
        for place, byte in enumerate(imu + delta):
            found = made.feed(bytes([byte]), tick * TICK_S + place * BYTE_S)
            if place == len(imu) - 1:
                waited.append(not found)
    assert waited[30:] == [tick % 4 == 3 for tick in range(30, 60)]


# Starting in the middle


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("by", ["whole", "ticks", "bytes"])
def test_starting_anywhere_all_frames_but_the_first_two_come_and_nothing_false(
    name: str, by: str
) -> None:
    """If decoding starts at any of the first 345 bytes, at most two frames are lost.

    To save time, the slower variants start only at every 9th or 23rd byte.
    """
    ticks = ticks_of(name)[:40]
    stream = b"".join(ticks)
    sent = frames_of(stream)
    for start in range(0, 345, {"whole": 1, "ticks": 9, "bytes": 23}[by]):
        expected = [frame for at, frame in sent if at >= start]
        if by == "whole":
            found = decoded([stream[start:]])
        else:
            skip, rest = start, []
            for tick in ticks:
                rest.append(tick[skip:])
                skip = max(0, skip - len(tick))
            found = decoded(rest) if by == "ticks" else byte_by_byte(rest)
        missing = len(expected) - len(found)
        assert 0 <= missing <= 2, f"from {start}"
        assert found == expected[missing:], f"from {start}"


@pytest.mark.parametrize("gyro", [(-6, 7, 9), (7, -6, 9), (7, 9, -6), (-6, -6, -6)], ids=str)
@pytest.mark.parametrize("imu_only", [True, False], ids=["IMU only", "nominal"])
def test_a_robot_on_a_slope_is_not_misread_for_ever(
    gyro: tuple[int, int, int], imu_only: bool
) -> None:
    """A gyro value of -6 looks like a header in every frame.

    From any starting byte, at most two frames are lost.
    """
    random, ticks = Random(3), []
    for tick in range(60):
        accel = tuple(round(random.gauss(mean, 46)) for mean in (1428, 0, -16322))
        data = encode(ImuFrame((accel[0], accel[1], accel[2]), gyro))
        if not imu_only and tick % 4 == 3:
            data += encode(DeltaFrame(0, 0, 0, tick // 4))
        ticks.append(data)
    stream = b"".join(ticks)
    sent = frames_of(stream)
    for start in range(60):
        expected = [frame for at, frame in sent if at >= start]
        found = decoded([stream[start:]])
        assert len(found) >= len(expected) - 2, f"from {start}"
        assert found == expected[len(expected) - len(found) :], f"from {start}"


def test_one_whole_text_is_enough_to_believe() -> None:
    """A complete «Paused» text at the beginning of a stream is accepted at once.

    The second text would come only a second later.
    """
    assert FrameDecoder().feed(b"used: 3 \nPaused: 4 \n", 0.0) == [PausedFrame(4)]


def test_two_frames_with_nonsense_behind_them_are_not_believed() -> None:
    """The decoder rejects two frames at the beginning of a stream if a wrong byte follows them."""
    look_alike = encode(DeltaFrame(1, 2, 3, 4)) + encode(DeltaFrame(5, 6, 7, 8))
    assert decoded([look_alike + b"\x00" + LEAD_IN * 2]) == [REST] * 4


@pytest.mark.parametrize("start", range(12))
def test_a_paused_board_is_understood_from_the_first_whole_text(start: int) -> None:
    """Decoding starts within a «Paused» text. All later texts, which are complete, are returned."""
    texts = [b"Paused: 7 \n", b"Paused: 8 \n", b"Paused: 9 \n"]
    found = decoded([texts[0][start:], *texts[1:]], step_s=1.0)
    assert found == [PausedFrame(n) for n in (7, 8, 9)][start > 0 :]


# Fault counters


@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_has_no_faults(name: str) -> None:
    """In an undamaged stream every byte belongs to a frame, so no fault is counted."""
    made = FrameDecoder()
    for number, tick in enumerate(ticks_of(name)):
        made.feed(tick, number * TICK_S)
    made.flush(1e3)
    sent = frames_of(b"".join(ticks_of(name)))
    assert made.statistics.frames == len(sent)
    assert (made.statistics.faults, made.statistics.discarded_bytes) == (0, 0)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.lists(st.one_of(frames.map(encode), st.binary(max_size=20)), max_size=20))
@example([LEAD_IN, b"\x00", LEAD_IN])
def test_every_byte_is_a_frames_or_counted_as_discarded(pieces: list[bytes]) -> None:
    """The stream contains frames and noise.

    Each byte is part of a returned frame, or counted as discarded.
    """
    made, stream = FrameDecoder(), b"".join(pieces)
    found = made.feed(stream, 0.0) + made.flush(0.0)
    in_frames = sum(len(encode(frame)) for frame in found if not isinstance(frame, PausedFrame))
    if not any(isinstance(frame, PausedFrame) for frame in found):
        assert made.statistics.discarded_bytes == len(stream) - in_frames
    assert made.statistics.frames == len(found)


def test_a_pose_is_read_in_the_byte_order_asked_for() -> None:
    """The byte order of poses is a setting, because the manual does not make it clear.

    The decoder uses the setting.
    """
    pose = PoseFrame(1000.0, -2.5, 1.0, 9)
    for order in ("big", "little"):
        made = FrameDecoder(order)
        assert made.feed(LEAD_IN + encode(pose, order), 0.0) == [REST, REST, pose]
