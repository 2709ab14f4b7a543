# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated receivers.

The tests write commands as hexadecimal numbers. Some commands are damaged.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_wire import APPENDIX

from omnibot_driver.simulator.omnibot.receivers import (
    COUNTING,
    FRAMINGS,
    Command,
    CommandReceiver,
    ReceiverKind,
)
from omnibot_driver.simulator.omnibot.wire import BYTE_S, ControlFrame, StateLetter

NAIVE = ReceiverKind(framing="naive")
IDLE_GAP = ReceiverKind(framing="idle_gap")
WINDOW = ReceiverKind(framing="window")
LETTERS_ANYWHERE = ReceiverKind(letters="anywhere")
KINDS = [
    ReceiverKind(framing=framing, letters=letters)
    for framing in FRAMINGS
    for letters in ("between", "anywhere")
]
every_kind = pytest.mark.parametrize(
    "kind", KINDS, ids=lambda kind: f"{kind.framing} {kind.letters}"
)

STOP = ControlFrame(0x02, (0, 0, 0))
START, PAUSE, RESET = StateLetter.START, StateLetter.PAUSE, StateLetter.RESET


def understood(
    *writes: str,
    kind: ReceiverKind = COUNTING,
    awake: bool = True,
    control_frames: bool = True,
    pause_s: float = 0.05,
) -> list[Command]:
    """Return the commands that a new receiver finds in the bytes written to it.

    ``writes``: bytes in hexadecimal. After each write, no bytes arrive for ``pause_s``.
    """
    receiver = CommandReceiver(kind, awake=awake)
    commands: list[Command] = []
    now_s = 0.0
    for write in writes:
        for byte in bytes.fromhex(write):
            now_s += BYTE_S
            commands += receiver.feed(byte, now_s, control_frames=control_frames)
        now_s += pause_s
    return commands


@every_kind
@pytest.mark.parametrize(("typed", "mode", "values"), APPENDIX.values(), ids=APPENDIX.keys())
def test_every_receiver_understands_each_command_of_the_appendix(
    typed: str, mode: int, values: tuple[int, int, int], kind: ReceiverKind
) -> None:
    """Every receiver understands each undamaged frame, with or without zeros before it."""
    assert understood(typed, kind=kind) == [ControlFrame(mode, values)]
    assert understood("00 00 00" + typed, kind=kind) == [ControlFrame(mode, values)]


@pytest.mark.slow
@every_kind
@given(typed=st.lists(st.sampled_from([typed for typed, _, _ in APPENDIX.values()]), max_size=20))
def test_frames_back_to_back_are_all_understood(typed: list[str], kind: ReceiverKind) -> None:
    """Frames come without a gap. Every receiver understands all of them, in order."""
    meanings = {typed: ControlFrame(mode, values) for typed, mode, values in APPENDIX.values()}
    assert understood("".join(typed), kind=kind) == [meanings[one] for one in typed]


@pytest.mark.slow
@every_kind
@given(noise=st.binary(max_size=300), awake=st.booleans(), control_frames=st.booleans())
def test_no_bytes_disturb_a_receiver_for_longer_than_a_frame(
    noise: bytes, awake: bool, control_frames: bool, kind: ReceiverKind
) -> None:
    """Any bytes arrive, then eight zeros and a letter. Every receiver understands the letter."""
    data = (noise + bytes(8)).hex() + "53"
    commands = understood(data, kind=kind, awake=awake, control_frames=control_frames)
    assert commands[-1] is START


# Letters


def test_letters_act_between_control_frames_and_not_within() -> None:
    """A frame that contains the letters P, R and S is read as one frame.

    Only letters before and after the frame act.
    """
    assert understood("53 FF FE 01 00 50 00 52 00 53 50") == [
        START,
        ControlFrame(0x01, (0x50, 0x52, 0x53)),
        PAUSE,
    ]


def test_letters_may_act_anywhere_and_the_frame_around_them_goes_on() -> None:
    """On some boards, a letter within a frame acts at once, and the board still obeys the frame."""
    assert understood("53 FF FE 01 00 50 00 52 00 53 50", kind=LETTERS_ANYWHERE) == [
        START,
        PAUSE,
        RESET,
        ControlFrame(0x01, (0x50, 0x52, 0x53)),
        START,
        PAUSE,
    ]


@every_kind
def test_letters_within_a_control_frame_act_where_frames_are_not_obeyed(kind: ReceiverKind) -> None:
    """A paused board obeys only letters, so P, R and S act even within a motion frame."""
    frame = "FF FE 01 00 50 00 52 00 53"
    assert understood(frame, kind=kind, control_frames=False) == [PAUSE, RESET, START]


def test_a_letter_after_a_stray_header_byte_is_a_letter() -> None:
    """The letter S comes after a stray FF. All receivers obey it, except the naive one."""
    assert understood("FF 53") == [START]
    assert understood("FF 53", kind=WINDOW) == [START]
    assert understood("FF 53", kind=NAIVE) == []
    assert understood("FF 53 53", kind=NAIVE) == [START]


def test_the_window_takes_no_letter_soon_after_a_header() -> None:
    """A ``window`` receiver takes FF FE and the next seven bytes as a frame.

    The receiver ignores a letter among these bytes.
    """
    assert understood("FF FE 02 00 00 00 53 00 00 53", kind=WINDOW) == [
        ControlFrame(0x02, (0, 0x0053, 0)),
        START,
    ]


# Frames that lost a byte


def test_a_counting_receiver_completes_a_short_stop_with_the_next_header() -> None:
    """A stop frame has lost its last byte, and another frame follows.

    A receiver that counts bytes takes the first byte (FF) of the next frame for the lost byte. So
    wheel C turns at 255 LSB.
    """
    short, whole = "FF FE 02 00 00 00 00 00", "FF FE 02 00 00 00 00 00 00"
    assert understood(short, whole) == [ControlFrame(0x02, (0, 0, 255))]
    assert understood(short, whole, pause_s=3600.0) == [ControlFrame(0x02, (0, 0, 255))]


def test_a_counting_receiver_completes_a_short_stop_with_a_letter() -> None:
    """A counting receiver takes the letter P for the missing last byte of a stop frame.

    So it obeys P as a speed of wheel C, not as a pause.
    """
    assert understood("FF FE 02 00 00 00 00 00", "50") == [ControlFrame(0x02, (0, 0, 80))]


def test_an_idle_gap_ends_half_a_frame() -> None:
    """An idle gap comes after half a frame.

    The receiver discards the half frame, and finds the next frame or letter.
    """
    short, whole = "FF FE 02 00 00 00 00 00", "FF FE 02 00 00 00 00 00 00"
    assert understood(short, whole, kind=IDLE_GAP) == [STOP]
    assert understood(short, "50", kind=IDLE_GAP) == [PAUSE]


def test_a_pause_of_less_than_five_milliseconds_is_not_an_idle_gap() -> None:
    """The bytes of a frame are interrupted for less than 5 ms.

    The receiver continues the frame, because bytes may be late.
    """
    short, whole = "FF FE 02 00 00 00 00 00", "FF FE 02 00 00 00 00 00 00"
    false = [ControlFrame(0x02, (0, 0, 255))]
    assert understood(short, whole, kind=IDLE_GAP, pause_s=0.0048) == false
    assert understood(short, whole, kind=IDLE_GAP, pause_s=0.0051) == [STOP]
    assert understood("FF FE 02 00 00", "00 00 00 00", kind=IDLE_GAP, pause_s=0.0048) == [STOP]


def test_a_window_acts_on_a_short_stop_too_and_finds_the_next_frame() -> None:
    """A stop frame lacks its last byte, and a complete stop frame follows.

    A ``window`` receiver takes the next FF for the missing byte, and obeys both frames.
    """
    assert understood("FF FE 02 00 00 00 00 00", "FF FE 02 00 00 00 00 00 00", kind=WINDOW) == [
        ControlFrame(0x02, (0, 0, 255)),
        STOP,
    ]


def test_a_window_finds_a_header_within_a_frame() -> None:
    """The first word of a frame is -2 (FF FE), which is also the header of a second frame.

    The receiver ``window`` keeps the bytes of a found frame, so it finds both frames. The default
    receiver finds only the first frame.
    """
    data = "FF FE 01 FF FE 02 00 00 08 00 00 00"
    first, second = ControlFrame(0x01, (-2, 0x0200, 8)), ControlFrame(0x02, (0, 0x0800, 0))
    assert understood(data, kind=WINDOW) == [first, second]
    assert understood(data) == [first]


def test_a_frame_without_its_header_acts_by_its_letters() -> None:
    """A frame has lost its FF or FE. The byte 0x52 in its payload acts as the letter R."""
    for kind in (COUNTING, IDLE_GAP, WINDOW):
        assert understood("FE 01 00 52 00 00 00 00", kind=kind) == [RESET]
        assert understood("FF 01 00 52 00 00 00 00", kind=kind) == [RESET]


# Doubled headers


def test_a_doubled_header_byte_does_not_hide_the_frame() -> None:
    """Most receivers find the frame even if the first byte of its header FF FE comes twice."""
    for kind in (COUNTING, IDLE_GAP, WINDOW):
        typed = "FF FF FE 02 00 20 00 00 00 00"
        assert understood(typed, kind=kind) == [ControlFrame(0x02, (32, 0, 0))]


def test_a_naive_receiver_loses_the_frame_behind_a_doubled_header_byte() -> None:
    """The first byte of the header FF FE comes twice.

    The naive receiver discards both FF and misses the frame. A byte 0x52 in the payload then acts
    as the letter R.
    """
    assert understood("FF FF FE 02 00 20 00 00 00 00", kind=NAIVE) == []
    assert understood("FF FF FE 02 00 52 00 00 00 00", kind=NAIVE) == [RESET]


# The wake-up


@every_kind
def test_the_first_three_bytes_after_power_up_are_swallowed(kind: ReceiverKind) -> None:
    """After power-up, the board's serial port loses three bytes, even if they are letters."""
    assert understood("52 50 53 53", kind=kind, awake=False) == [START]


@every_kind
def test_a_frame_that_wakes_the_board_loses_its_header(kind: ReceiverKind) -> None:
    """A motion frame that wakes the board loses its first three bytes.

    The board reads the remaining bytes as letters.
    """
    assert understood("FF FE 01 00 52 00 00 00 00", kind=kind, awake=False) == [RESET]


@pytest.mark.parametrize(("counted", "swallowed"), [(False, 3), (True, 1)])
def test_bytes_during_the_boot_count_for_the_wake_up_or_not(counted: bool, swallowed: int) -> None:
    """Three bytes wake the board. Some receivers also count bytes that arrive during the boot."""
    receiver = CommandReceiver(ReceiverKind(wakes_while_booting=counted))
    receiver.boot()
    receiver.boot()
    heard = [receiver.feed(0x53, 0.0, control_frames=False) for _ in range(4)]
    assert heard.index((START,)) == swallowed
