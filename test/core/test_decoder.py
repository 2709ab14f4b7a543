"""The decoder on undamaged, damaged and meaningless streams.

Streams come from the simulated board and are typed from the manual's layouts; what is expected of
them comes from their single frames.
"""

import struct
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from random import Random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from strategies import believable_frames, chunkings, cut, frames

from omnibot_driver.core.omnibot import (
    DeltaFrame,
    FrameDecoder,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    decode,
    encode,
)
from omnibot_driver.core.omnibot.frames import CommandFrame, Frame
from omnibot_driver.simulator import BoardSettings, SimulatedBoard

TICK_S = 0.01
BYTE_S = 10 / 115200

REST = ImuFrame((120, -80, -16384), (1, 2, 3))
HEADER_BYTES = b"\xff\xfa\xfb\xfc"
LEAD_IN = encode(REST) * 2
"""Enough to bring a decoder into step, with nothing in it that looks like a header."""


def velocity(x: int, y: int, omega: int) -> bytes:
    """A body velocity command, typed from the manual."""
    return bytes.fromhex("FF FE 01") + struct.pack(">3h", x, y, omega)


def record(board: SimulatedBoard, seconds: float) -> list[bytes]:
    """What the board sends in each tick."""
    return [board.step() for _ in range(round(seconds * 100))]


def drive(board: SimulatedBoard, seconds: float) -> list[bytes]:
    """The same with a new random velocity every half second."""
    random, ticks = Random(7), []
    for _ in range(round(seconds * 2)):
        board.receive(velocity(*(random.randint(-24, 24) for _ in range(2)), random.randint(-9, 9)))
        ticks += record(board, 0.5)
    return ticks


def life(board: SimulatedBoard) -> list[bytes]:
    """Boot, start, drive, pause, un-pause, reset: every mode and every change of it."""
    ticks = record(board, 2.6)
    board.receive(bytes(8) + b"S")
    ticks += drive(board, 2.0)
    for letter in (b"P", b"P", b"R"):
        board.receive(letter)
        ticks += record(board, 2.37)
    return ticks


RUNNING = BoardSettings(running=True)
STREAMS: dict[str, Callable[[], list[bytes]]] = {
    "at rest": lambda: record(SimulatedBoard(RUNNING), 4.0),
    "driving": lambda: drive(SimulatedBoard(RUNNING), 4.0),
    "look-alike gyro": lambda: record(
        SimulatedBoard(BoardSettings(running=True, gyro_stuck=(-6, -5, -4))), 4.0
    ),
    "IMU only": lambda: record(SimulatedBoard(BoardSettings(running=True, imu_only=True)), 4.0),
    "IMU only, look-alike gyro": lambda: record(
        SimulatedBoard(BoardSettings(running=True, imu_only=True, gyro_stuck=(-6, -5, -4))), 4.0
    ),
    "IMU ends in FF": lambda: record(
        SimulatedBoard(BoardSettings(running=True, gyro_stuck=(3, -1, -1))), 4.0
    ),
    "paused": lambda: record(SimulatedBoard(), 12.0),
    "all modes": lambda: life(SimulatedBoard()),
}
RUNNING_STREAMS = [name for name in STREAMS if name not in ("paused", "all modes")]


@cache
def ticks_of(name: str) -> tuple[bytes, ...]:
    return tuple(STREAMS[name]())


def lengths_of(stream: bytes) -> list[int]:
    """The lengths of the frames of an undamaged stream, from the manual's tables."""
    lengths, at = [], 0
    while at < len(stream):
        kind = stream[at + 1]
        text = stream.index(b"\n", at) + 1 - at if stream[at] == 0x50 else 0
        lengths.append({0xFA: 14, 0xFB: 9, 0xFC: 15}.get(kind, text))
        at += lengths[-1]
    assert at == len(stream)
    return lengths


def frames_of(stream: bytes) -> list[tuple[int, Frame]]:
    """Each frame of an undamaged stream with the place where it begins."""
    found, at = [], 0
    for length in lengths_of(stream):
        frame = decode(stream[at : at + length])
        assert not isinstance(frame, CommandFrame)
        found.append((at, frame))
        at += length
    return found


def decoded(chunks: Iterable[bytes], *, step_s: float = TICK_S) -> list[Frame]:
    """All that a fresh decoder makes of chunks that arrive ``step_s`` apart."""
    made, now, found = FrameDecoder(), 100.0, []
    for chunk in chunks:
        found += made.feed(chunk, now)
        now += step_s
    return found + made.flush(now)


def byte_by_byte(ticks: Sequence[bytes]) -> list[Frame]:
    """As a line at 115200 baud brings them."""
    made, found = FrameDecoder(), []
    for number, tick in enumerate(ticks):
        for place in range(len(tick)):
            now = number * TICK_S + place * BYTE_S
            found += made.feed(tick[place : place + 1], now)
    return found + made.flush(len(ticks) * TICK_S)


def is_subsequence(some: Sequence[Frame], of: Sequence[Frame]) -> bool:
    remaining = iter(of)
    return all(frame in remaining for frame in some)


# Undamaged


@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_is_decoded_whole_by_ticks_and_byte_by_byte(name: str) -> None:
    """Every frame that the simulated board sent, in order, and nothing else."""
    ticks = ticks_of(name)
    sent = [frame for _, frame in frames_of(b"".join(ticks))]
    assert decoded([b"".join(ticks)]) == sent
    assert decoded(ticks) == sent
    assert byte_by_byte(ticks) == sent


@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_is_decoded_in_random_chunks(name: str) -> None:
    """Twenty ways of cutting it."""
    stream = b"".join(ticks_of(name))
    sent = [frame for _, frame in frames_of(stream)]
    random = Random(11)
    for mean_length in (1.5, 3, 7, 14, 40, 200) * 4:
        cuts = sorted(random.sample(range(len(stream)), int(len(stream) / mean_length)))
        assert decoded(cut(stream, cuts), step_s=1e-3) == sent


@given(st.lists(believable_frames, max_size=25), st.data())
@settings(max_examples=300)
def test_in_step_any_content_is_delivered_in_any_chunks(
    sent: list[Frame], data: st.DataObject
) -> None:
    """A true shock, a stuck sensor and words that look like headers are frames like all others."""
    stream = LEAD_IN + b"".join(map(encode, sent))
    chunks = [chunk for chunk in data.draw(chunkings(stream)) if chunk]  # and no pauses
    assert decoded(chunks, step_s=1e-3) == [REST, REST, *sent]


@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_comes_out_with_its_last_byte(name: str) -> None:
    """But one that ends in a header's byte, or leaps: the first bytes of the next tell."""
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


@given(believable_frames.filter(lambda frame: not isinstance(frame, PausedFrame)), st.data())
def test_odd_content_waits_for_two_frames_at_the_most(odd: Frame, data: st.DataObject) -> None:
    """It may be damaged; what follows in its place says that it is not."""
    made, content = FrameDecoder(), encode(odd) + LEAD_IN + encode(REST)[:2]
    assert made.feed(LEAD_IN, 0.0) == [REST, REST]
    found = [frame for chunk in data.draw(chunkings(content)) for frame in made.feed(chunk, 0.0)]
    assert found[0] == odd


def test_a_shock_goes_on_across_a_delta_and_into_silence() -> None:
    """An adapter's pause within the last frame and its leap together do not make it a false one."""
    made = FrameDecoder()
    made.feed(LEAD_IN + 300 * encode(REST), 0.0)  # it learns how calm the sensor is
    shock = [
        ImuFrame((-6375, 8786, -16371), (2, -8, 1005)),
        DeltaFrame(176, -24, -45, 146),
        ImuFrame((-5884, 8083, -16389), (3, 13, 1223)),
    ]
    content = b"".join(map(encode, shock))
    found = made.feed(content[:-6], 0.016) + made.feed(content[-6:], 0.032)
    assert found + made.feed(b"Paused: 0 \n", 0.7) == [*shock, PausedFrame(0)]


def test_a_knock_right_before_a_silence_is_delivered() -> None:
    """Out of the calm, with an adapter's pause within it: it ends where the line falls silent."""
    made = FrameDecoder()
    made.feed(LEAD_IN + 300 * encode(REST), 0.0)
    knock = ImuFrame((-2683, 3744, -16377), (0, 1, 1949))
    found = made.feed(encode(knock)[:-3], 0.016) + made.feed(encode(knock)[-3:], 0.032)
    assert found + made.feed(b"Paused: 0 \n", 0.95) == [knock, PausedFrame(0)]


def test_a_doubtful_frame_comes_out_with_the_first_byte_of_the_next() -> None:
    """One byte of waiting, not one frame."""
    made = FrameDecoder()
    made.feed(LEAD_IN, 0.0)
    doubtful = DeltaFrame(1, 2, 3, 255)
    assert made.feed(encode(doubtful), 0.0) == []
    assert made.feed(b"\xff", 0.0) == [doubtful]


def test_where_pauses_tell_only_a_frame_that_another_may_follow_waits() -> None:
    """An IMU frame that ends in FB or FC, before a delta: the rest of the tick is silent."""
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


@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("by", ["whole", "ticks", "bytes"])
def test_starting_anywhere_all_frames_but_the_first_two_come_and_nothing_false(
    name: str, by: str
) -> None:
    """From each of the places in the first fifth of a second and a little more."""
    ticks = ticks_of(name)[:60]
    stream = b"".join(ticks)
    sent = frames_of(stream)
    for start in range(0, 345, 7 if by == "bytes" else 1):
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
    """Five degrees of tilt, and −6 on a gyro axis is a false header in every frame."""
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
    """At one text a second nobody wants to wait for two."""
    assert FrameDecoder().feed(b"used: 3 \nPaused: 4 \n", 0.0) == [PausedFrame(4)]


def test_two_frames_with_nonsense_behind_them_are_not_believed() -> None:
    """Out of step, what follows speaks against them all."""
    look_alike = encode(DeltaFrame(1, 2, 3, 4)) + encode(DeltaFrame(5, 6, 7, 8))
    assert decoded([look_alike + b"\x00" + LEAD_IN * 2]) == [REST] * 4


@pytest.mark.parametrize("start", range(12))
def test_a_paused_board_is_understood_from_the_first_whole_text(start: int) -> None:
    """Starting anywhere within a text."""
    texts = [b"Paused: 7 \n", b"Paused: 8 \n", b"Paused: 9 \n"]
    found = decoded([texts[0][start:], *texts[1:]], step_s=1.0)
    assert found == [PausedFrame(n) for n in (7, 8, 9)][start > 0 :]


# Damaged


def assert_back_in_step(
    sent: list[tuple[int, Frame]], hurt: set[int], found: list[Frame], place: int
) -> None:
    """``hurt``: numbers of the frames whose bytes are changed or pushed apart."""
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
    """Each byte of the frames 20 to 45 with the number of its frame."""
    ends = [at for at, _ in sent[1:]]
    return [
        (place, number)
        for number in range(20, 45)
        for place in range(sent[number][0], ends[number])
    ]


@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_that_lost_a_byte_does_not_come_out(name: str) -> None:
    """One byte lost anywhere, when what follows is in hand; in step again within two frames."""
    stream = b"".join(ticks_of(name)[:80])
    sent = frames_of(stream)
    for place, number in damage_places(sent):
        # Losing either of two equal neighbours is one damage: it may be either's frame.
        hurt = set() if stream[place] in (stream[place - 1], stream[place + 1]) else {number}
        found = decoded([stream[:place] + stream[place + 1 :]])
        if hurt:
            assert_back_in_step(sent, hurt, found, place)
        else:
            assert is_subsequence(found, [frame for _, frame in sent]), f"damage at {place}"


@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("extra", [0x00, 0x50, 0x7E, 0xFA, 0xFB, 0xFC, 0xFF])
def test_a_gained_byte_never_makes_more_than_one_false_frame(name: str, extra: int) -> None:
    """One byte inserted anywhere; in step again, and truly so, within two frames."""
    stream = b"".join(ticks_of(name)[:80])
    sent = frames_of(stream)
    truth = [frame for _, frame in sent]
    for place, number in damage_places(sent):
        found = decoded([stream[:place] + bytes([extra]) + stream[place:]])
        before, after = truth[: number - 1], truth[number + 4 :]
        assert found[: len(before)] == before, f"damage at {place}"
        assert found[len(found) - len(after) :] == after, f"damage at {place}"
        between = found[len(before) : len(found) - len(after)]
        false = [frame for frame in between if frame not in truth]
        assert len(false) <= 1, f"damage at {place}"


@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_gained_byte_hardly_ever_makes_a_false_frame(name: str) -> None:
    """Without a checksum a gyro that happens to read a header may do it, once in thirty times."""
    stream = b"".join(ticks_of(name)[:80])
    sent = frames_of(stream)
    truth = [frame for _, frame in sent]
    random, false = Random(13), 0
    for place, _ in damage_places(sent) * 3:
        extra = bytes([random.randrange(256)])
        found = decoded([stream[:place] + extra + stream[place:]])
        false += not is_subsequence(found, truth)
    assert false <= len(damage_places(sent)) * 3 / 30


@pytest.mark.parametrize(
    "extra", [b"\x00", b"P", b"\xfa", b"\xff", b"\xff\xff", b"\xff\xfd", b"Pau"]
)
def test_bytes_between_two_frames_cost_at_most_the_one_before_them(extra: bytes) -> None:
    """Nobody can tell whether they were its own; the frame behind them comes out."""
    other = ImuFrame((100, 90, -16300), (4, 5, 6))
    after = LEAD_IN * 2
    found = decoded([LEAD_IN + encode(other) + extra + after])
    assert found in ([REST, REST, *[REST] * 4], [REST, REST, other, *[REST] * 4])


@pytest.mark.parametrize("name", RUNNING_STREAMS)
def test_a_frame_that_lost_one_byte_and_took_the_next_headers_does_not_come_out(name: str) -> None:
    """Byte by byte as well: the FF that completes it waits for the byte that betrays it."""
    ticks = ticks_of(name)[:30]
    truth = [frame for _, frame in frames_of(b"".join(ticks))]
    for number in range(8, 24):
        tick = ticks[number]
        for place in range(2, len(tick)):
            if tick[place] == 0xFF or tick[place - 1] == 0xFF or tick[place - 2] == 0xFF:
                continue  # a header's byte, or a neighbour of one
            hurt = [*ticks[:number], tick[:place] + tick[place + 1 :], *ticks[number + 1 :]]
            found = byte_by_byte(hurt)
            assert is_subsequence(found, truth), f"tick {number}, byte {place}"
            assert len(truth) - 4 <= len(found) < len(truth), f"tick {number}, byte {place}"


@given(
    st.lists(st.one_of(frames, st.binary(min_size=1, max_size=20)), max_size=20),
    st.data(),
)
def test_rubbish_between_frames_costs_a_few_frames_only(
    pieces: list[Frame | bytes], data: st.DataObject
) -> None:
    """After any past, six ordinary frames later the decoder is in step."""
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
    """A pause in the middle of the data, and a start in the middle of the texts."""
    text = encode(PausedFrame(count))
    stream = LEAD_IN + text + (LEAD_IN if ends == "data" else text)
    last = [REST, REST] if ends == "data" else [PausedFrame(count)]
    for place in range(len(stream) + 1):
        assert decoded([stream[:place], stream[place:]]) == [
            REST, REST, PausedFrame(count), *last,
        ]  # fmt: skip


@pytest.mark.parametrize("place", [*range(8), 9, 10])
def test_a_damaged_text_does_not_come_out(place: int) -> None:
    """A lost letter anywhere but in the number, where nobody can see it, or of its blank."""
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
    """A cable that was out for a moment: what comes now does not finish what was begun then."""
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:length], 0.0)
    after = [DeltaFrame(1, 2, 3, 4), REST, PoseFrame(1.0, 2.0, 3.0, 4), DeltaFrame(5, 6, 7, 8)]
    found = [out for i, frame in enumerate(after) for out in made.feed(encode(frame), 1 + i / 100)]
    assert found == after


@pytest.mark.parametrize("length", range(1, 14))
def test_a_reboot_in_the_middle_of_a_frame_is_heard_with_its_first_text(length: int) -> None:
    """The rest of the frame never comes; the text does, after the boot."""
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:length], 0.0)
    assert made.feed(b"Paused: 0 \n", 0.3) == [PausedFrame(0)]


@pytest.mark.parametrize("name", RUNNING_STREAMS)
@pytest.mark.parametrize("late_s", [0.15, 1.0])
def test_a_late_backlog_costs_no_frame(name: str, late_s: float) -> None:
    """It was us who slept: what is held goes on in what was waiting, wherever it was cut."""
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
    """Nothing spoke against it."""
    made = FrameDecoder()
    made.feed(LEAD_IN, 0.0)
    doubtful = DeltaFrame(1, 2, 3, 255)
    assert made.feed(encode(doubtful), 0.0) == []
    assert made.feed(encode(REST), 1.0) == [doubtful, REST]


def test_flush_tells_what_can_still_be_told() -> None:
    """In step a whole frame; never a part of one, never one that is not proved."""
    doubtful = DeltaFrame(1, 2, 3, 255)
    in_step = FrameDecoder()
    in_step.feed(LEAD_IN + encode(doubtful), 0.0)
    assert in_step.flush(0.0) == [doubtful]
    assert in_step.flush(0.0) == []
    partial = FrameDecoder()
    partial.feed(LEAD_IN + encode(REST)[:13], 0.0)
    assert partial.flush(0.0) == []
    unproved = FrameDecoder()
    assert unproved.feed(encode(REST), 0.0) == []
    assert unproved.flush(0.0) == []


def test_a_decoder_goes_on_after_a_flush() -> None:
    """With the next whole frames."""
    made = FrameDecoder()
    made.feed(LEAD_IN + encode(REST)[:5], 0.0)
    made.flush(0.0)
    assert made.feed(LEAD_IN, 0.0) == [REST, REST]


# Counting


@pytest.mark.parametrize("name", STREAMS)
def test_an_undamaged_stream_has_no_faults(name: str) -> None:
    """Every byte is a frame's."""
    made = FrameDecoder()
    for number, tick in enumerate(ticks_of(name)):
        made.feed(tick, number * TICK_S)
    made.flush(1e3)
    sent = frames_of(b"".join(ticks_of(name)))
    assert made.statistics.frames == len(sent)
    assert (made.statistics.faults, made.statistics.discarded_bytes) == (0, 0)


@given(st.lists(st.one_of(frames.map(encode), st.binary(max_size=20)), max_size=20))
@example([LEAD_IN, b"\x00", LEAD_IN])
def test_every_byte_is_a_frames_or_counted_as_discarded(pieces: list[bytes]) -> None:
    """None is lost in silence."""
    made, stream = FrameDecoder(), b"".join(pieces)
    found = made.feed(stream, 0.0) + made.flush(0.0)
    in_frames = sum(len(encode(frame)) for frame in found if not isinstance(frame, PausedFrame))
    if not any(isinstance(frame, PausedFrame) for frame in found):
        assert made.statistics.discarded_bytes == len(stream) - in_frames
    assert made.statistics.frames == len(found)


def test_a_pose_is_read_in_the_byte_order_asked_for() -> None:
    """The manual has two readings of it."""
    pose = PoseFrame(1000.0, -2.5, 1.0, 9)
    for order in ("big", "little"):
        made = FrameDecoder(order)
        assert made.feed(LEAD_IN + encode(pose, order), 0.0) == [REST, REST, pose]
