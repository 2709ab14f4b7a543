# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the lines of both Teensy boards: checksums, messages and damage.

The lines in ``GOLDEN`` are from the manual, or are formed from its lists of fields.
"""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import chunkings

from omnibot_driver.core.fejemis.codec import parse
from omnibot_driver.core.fejemis.decoder import LONGEST_LINE, FejemisDecoder
from omnibot_driver.core.fejemis.forms import OF
from omnibot_driver.core.fejemis.messages import (
    Acceleration,
    Attitude,
    Battery,
    BoardPose,
    Comment,
    Distance,
    FrontAngle,
    FrontWheelOffset,
    Gyro,
    Heartbeat,
    Infrared,
    Magnetic,
    Message,
    Status,
    SteeringConfiguration,
    WheelConfiguration,
    WheelSpeeds,
    Words,
)
from omnibot_driver.core.fejemis.polls import Polls
from omnibot_driver.core.fejemis.sums import sum_of, with_sum, without_sum

GOLDEN_SUMS = [
    b";19rc 1 0.5 65",
    b";69sub hbt 400",
    b";34sub fwl 15",
    b";50sub gyro 10",
    b";31leave",
    b";06hbt 44.97199 90 110 24.95 10 0",
]
"""Example lines with checksums, in the form in which public host programs write them."""
GOLDEN: dict[str, Message] = {
    "hbt 44.97199 90 110 24.95 10 0": Heartbeat(44.97199, 90, 110, 24.95, 10.0),
    "hbt 45.1 90 110 24.95 -1 0": Heartbeat(45.1, 90, 110, 24.95, -1.0),
    "hbt 34.7925 91 100 0.00 1 0.011": Heartbeat(34.7925, 91, 100, 0.0, 1.0),
    "fwl 10.50 0x0 0x3c2": FrontAngle(10.5, 0, 0x3C2),
    "fwl -1.80 0x0 0x13c2": FrontAngle(-1.8, 0, 0x13C2),
    "pose 45.37199 1.234 -0.056 0.7854": BoardPose(45.37199, 1.234, -0.056, 0.7854, 3),
    "pose 45.37199 1.234 -0.056 0.7854 0.0": BoardPose(45.37199, 1.234, -0.056, 0.7854, 3),
    "vel 0.250 -0.250": WheelSpeeds(0.25, -0.25),
    "vel 45.37199 0.250 -0.250": WheelSpeeds(0.25, -0.25, 45.37199),
    "gyro 0.10 -0.20 90.00": Gyro(0.1, -0.2, 90.0),
    "acc 0.01 -0.02 9.81": Acceleration(0.01, -0.02, 9.81),
    "mag 17.0 -1.5 -47.0": Magnetic(17.0, -1.5, -47.0),
    "imupose 0.0100 -0.0200 1.5708": Attitude(0.01, -0.02, 1.5708),
    "bat 24.95 0.420 6": Battery(24.95, 0.42, 6),
    "tofd 1.250": Distance("tofd", 1.25),
    "sr04 0.310": Distance("sr04", 0.31),
    "ir 0.310 0.290": Infrared((0.31, 0.29)),
    "irc 0.310 0.290 20000 21000 46000 14000 45000 13000": Infrared(
        (0.31, 0.29), (46000.0, 14000.0, 45000.0, 13000.0)
    ),
    "conf 0.0775 0.0776 19.0 68 0.4 0.001": WheelConfiguration(
        0.0775, 0.0776, 19.0, 68.0, 0.4, 0.001, (0.0001, 0.0001, 0.1, 1.0, 0.1, 0.001)
    ),
    "confs 0.42 0.40": SteeringConfiguration(0.42, 0.4, (0.01, 0.01)),
    "fwo -3.50 1": FrontWheelOffset(-3.5, True),
    "adc 2490 2050 812 790 0": Status("adc", (2490.0, 2050.0, 812.0, 790.0, 0.0)),
    "int 1000 1001": Status("int", (1000.0, 1001.0)),
    "time 1000 120 210 260 320 3": Status("time", (1000.0, 120.0, 210.0, 260.0, 320.0, 3.0)),
    "amp 0.42 2050 0": Status("amp", (0.42, 2050.0, 0.0)),
    "cur 0.42 2050 0": Status("cur", (0.42, 2050.0, 0.0)),
    "cvdrive 0.5 0.1": Status("cvdrive", (0.5, 0.1)),
    "cpdrive 1 7 1 0.05": Status("cpdrive", (1.0, 7.0, 1.0, 0.05)),
    "cvsteer 10.5 10.4": Status("cvsteer", (10.5, 10.4)),
    "cpsteer 1 43 0 0": Status("cpsteer", (1.0, 43.0, 0.0, 0.0)),
    "gyroo 0.1 0.2 0.3": Status("gyroo", (0.1, 0.2, 0.3)),
    "acco 0.1 0.2 0.3": Status("acco", (0.1, 0.2, 0.3)),
    "magw 17.0 -1.5 -47.0": Status("magw", (17.0, -1.5, -47.0)),
    "mago 0 0 0 1 0 0 0 1 0 0 0 1": Status("mago", (0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)),
    "enc 2760 4267": Status("enc", (2760.0, 4267.0)),
    "mot 6.0 0 0 0 0 15000": Status("mot", (6.0, 0, 0, 0, 0, 15000.0)),
    "svp 569": Status("svp", (569.0,)),
    "svjt 0 0 0": Status("svjt", (0.0, 0.0, 0.0)),
    "tof1 1.25": Status("tof1", (1.25,)),
    "id drive 90": Words("id", "drive 90"),
    "ver 110 Fejemis drive": Words("ver", "110 Fejemis drive"),
    "confirm !rc 2 0 0": Words("confirm", "!rc 2 0 0"),
    "# Starting main loop": Comment("# Starting main loop"),
}
DAMAGED = [
    "hbt 44.97199 90 110 24.95",
    "hbt nan 90 110 24.95 10",
    "hbt 44.97199 90.5 110 24.95 10",
    "fwl 10.50 0x0",
    "fwl 1050 0x0 0x3c2",
    "fwl 10.50 0x0 3c2",
    "pose 45.37199 1.234 -0.056",
    "pose 45.37199 1.2.34 -0.056 0.7854",
    "pose -1 1.234 -0.056 0.7854",
    "vel 250 250",
    "gyro 0.1 -0.2",
    "gyro inf 0 0",
    "bat 24.95 0.42 6.5",
    "bat 2495 0.42 6",
    "fwo 3 2",
    "imupose 0 0 157",
    "xyz 1 2 3",
    "",
    "   ",
]


def feed(decoder: FejemisDecoder, data: bytes) -> list[Message]:
    return decoder.feed(data, 0.0)


@pytest.mark.parametrize("line", GOLDEN_SUMS)
def test_sums_are_those_of_the_public_hosts(line: bytes) -> None:
    """The driver writes and checks a checksum as the public host programs do."""
    text = line[3:]
    assert with_sum(text) == line
    assert without_sum(line) == (text, True)
    assert without_sum(text) == (text, None)


@pytest.mark.parametrize("text", GOLDEN)
def test_every_message_is_understood(text: str) -> None:
    """The parser reads each example line of the manual.

    For some kinds of message, the manual lists only the fields. The parser reads these kinds too.
    """
    assert parse(text) == GOLDEN[text]


@pytest.mark.parametrize("text", DAMAGED)
def test_what_no_board_sends_is_not_a_message(text: str) -> None:
    """Lines with too few fields, implausible numbers or unknown keywords are rejected."""
    assert parse(text) is None


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
@pytest.mark.parametrize("sums", [False, True])
def test_every_chunking_tells_the_same(end: bytes, *, sums: bool) -> None:
    """The same bytes arrive in one piece, byte by byte or in random pieces.

    In each case, the decoder returns the same messages.
    """
    of_each_kind = {text.split()[0]: (text, GOLDEN[text]) for text in GOLDEN}.values()
    texts = [text.encode() for text, _ in of_each_kind]
    lines = [with_sum(text) if sums else text for text in texts]
    data = b"".join(line + end for line in lines)
    whole = feed(FejemisDecoder(), data)
    assert whole == [message for _, message in of_each_kind]
    decoder = FejemisDecoder()
    assert [m for byte in data for m in feed(decoder, bytes([byte]))] == whole
    chance = random.Random(3)
    for _ in range(20):
        decoder, at, found = FejemisDecoder(), 0, []
        while at < len(data):
            step = chance.randrange(1, 90)
            found += feed(decoder, data[at : at + step])
            at += step
        assert found == whole


def test_extra_fields_are_left_alone() -> None:
    """Newer firmware adds fields at the end of a line. The known fields are still decoded."""
    assert parse("vel 1.0 0.250 -0.250 7 8") == WheelSpeeds(0.25, -0.25, 1.0)
    assert parse("gyro 1 2 3 4 5") == Gyro(1.0, 2.0, 3.0)


def test_a_wrong_sum_is_counted_and_costs_no_other_line() -> None:
    """A line loses its end and runs into the next. A good line and one with a wrong sum follow.

    The driver counts two faults, and decodes the good line.
    """
    decoder = FejemisDecoder("on")
    good = with_sum(b"gyro 1.0 2.0 3.0") + b"\n"
    assert feed(decoder, good[:9] + good + good) == [Gyro(1.0, 2.0, 3.0)]
    assert decoder.statistics.faults == 1
    assert decoder.statistics.discarded_bytes == 9 + len(good)
    assert feed(decoder, good.replace(b"2.0", b"9.0")) == []
    assert decoder.statistics.faults == 2


def test_a_line_may_have_200_characters_and_no_more() -> None:
    """A line of 200 characters is accepted.

    A longer line is discarded up to its end, even if it arrives in many pieces.
    """
    decoder = FejemisDecoder()
    text = b"# " + b"x" * (LONGEST_LINE - 2)
    assert len(feed(decoder, text + b"\n")) == 1
    for _ in range(1000):
        assert feed(decoder, b"y" * 64) == []
    assert feed(decoder, b"\ngyro 1 2 3\n") == [Gyro(1.0, 2.0, 3.0)]


@pytest.mark.slow
@given(
    st.lists(
        st.sampled_from([b"gyro 1 2 3", b"\r"])
        | st.builds(
            lambda text, length, end: text.ljust(length) + end,
            st.sampled_from([b"# x", b""]),
            st.integers(LONGEST_LINE - 2, LONGEST_LINE + 2) | st.integers(0, 3 * LONGEST_LINE),
            st.sampled_from([b"", b"\r"]),
        ),
        max_size=6,
    ),
    st.data(),
)
def test_the_limit_of_a_line_does_not_depend_on_the_chunking(
    lines: list[bytes], data: st.DataObject
) -> None:
    """Lines of about 200 characters are decoded in the same way in whatever pieces they arrive.

    Even if the line end arrives separately, messages and counts are the same.
    """
    stream = b"\n".join(lines)
    whole, split = FejemisDecoder(), FejemisDecoder()
    wanted = feed(whole, stream)
    pieces = data.draw(chunkings(stream))
    assert [message for piece in pieces for message in feed(split, piece)] == wanted
    whole.flush(0.0)
    split.flush(0.0)
    assert split.statistics == whole.statistics


def test_a_line_of_200_characters_may_arrive_without_its_line_end() -> None:
    """A read ends just before the line end of a line of 200 characters. The line is accepted."""
    decoder = FejemisDecoder()
    assert feed(decoder, b"# ".ljust(LONGEST_LINE, b"x")) == []
    assert len(feed(decoder, b"\n")) == 1
    assert decoder.statistics.faults == 0


def test_half_a_line_at_the_end_is_none() -> None:
    """The bytes end without a line end.

    The last line is not decoded, because it may be incomplete.
    """
    decoder = FejemisDecoder()
    assert feed(decoder, b"gyro 1 2 3") == []
    assert decoder.flush(0.0) == []
    assert decoder.statistics.faults == 1


BEAT = b"hbt 44.97199 90 110 24.95 10 0"


@pytest.mark.parametrize("sums", [False, True])
def test_whether_lines_have_sums_is_learnt_from_the_heartbeat(*, sums: bool) -> None:
    """The first heartbeat shows whether the board's lines have checksums.

    If it has a checksum, the decoder discards lines without checksums. If it has none, the decoder
    discards lines with checksums.
    """
    decoder = FejemisDecoder("auto")
    assert decoder.sums is None
    beat, gyro = (with_sum(t) if sums else t for t in (BEAT, b"gyro 1 2 3"))
    assert len(feed(decoder, beat + b"\n" + gyro + b"\n")) == 2
    assert decoder.sums is sums
    other = b"gyro 1 2 3" if sums else with_sum(b"gyro 1 2 3")
    assert feed(decoder, other + b"\n") == []
    assert decoder.doubtful
    assert not decoder.changed


def test_sums_that_begin_or_cease_are_believed_by_the_second_heartbeat() -> None:
    """A change in the use of checksums is accepted when two heartbeats in a row show it.

    A single heartbeat without its checksum may be damaged.
    """
    decoder = FejemisDecoder("auto")
    feed(decoder, with_sum(BEAT) + b"\n")
    feed(decoder, BEAT + b"\n" + with_sum(BEAT) + b"\n" + BEAT + b"\n")
    assert decoder.sums is True
    assert not decoder.changed
    feed(decoder, BEAT + b"\n")
    assert decoder.sums is False
    assert decoder.changed


@pytest.mark.parametrize(("setting", "sums"), [("on", True), ("off", False)])
def test_heartbeats_contradict_a_setting_but_do_not_overrule_it(
    setting: str, *, sums: bool
) -> None:
    """Heartbeats contradict the user's setting for checksums. The setting stays as it is."""
    decoder = FejemisDecoder(setting)  # type: ignore[arg-type]
    right, wrong = (with_sum(BEAT), BEAT) if sums else (BEAT, with_sum(BEAT))
    for beat in (wrong, wrong, right):
        feed(decoder, beat + b"\n")
        assert decoder.sums is sums
        assert decoder.contradicted is (beat is wrong)


def test_a_line_that_lost_a_decimal_is_not_believed_even_without_a_sum() -> None:
    """A board always prints a value with the same number of decimals.

    A line with another number of decimals is damaged and discarded.
    """
    decoder = FejemisDecoder("off")
    feed(decoder, b"pose 1.00000 1.234 0.567 0.1000\n" * 3)
    assert feed(decoder, b"pose 1.00000 1.24 0.567 0.1000\n") == []
    assert feed(decoder, b"pose 1.00000 1234 0.567 0.1000\n") == []
    assert len(feed(decoder, b"pose 1.00000 1.234 0.567 0.1000\n")) == 1


def test_a_firmware_that_prints_otherwise_is_believed_soon() -> None:
    """The firmware changes the number of decimals in a kind of line.

    The decoder discards two changed lines, and accepts the next. If the number keeps varying, the
    decoder soon accepts all lines.
    """
    decoder = FejemisDecoder("off")
    feed(decoder, b"gyro 1.00 2.00 3.00\n")
    assert len(feed(decoder, b"gyro 1.0 2.0 3.0\n" * 5)) == 3
    for n in range(40):
        feed(decoder, b"acc 0.%d 1 %s\n" % (n, b"2.5" if n % 3 else b"7"))
    assert len(feed(decoder, b"acc 0.125 1.5 2\n")) == 1


@pytest.mark.parametrize("windows", range(3))
def test_other_forms_are_counted_in_windows_of_24_lines(windows: int) -> None:
    """Of 24 lines of one kind, the first seven with an unusual form are rejected.

    The eighth is accepted. The lines have checksums, and the unusual ones do not come three in a
    row.

    ``windows``: number of earlier windows of 24 lines without an unusual form.
    """
    learnt, other = (with_sum(text) + b"\n" for text in (b"acc 0.1 0.1 0.1", b"acc 0.1 0.1 1"))
    decoder = FejemisDecoder("on")
    feed(decoder, learnt * OF * windows)
    feed(decoder, learnt * (OF - 14) + (learnt + other) * 7)
    feed(decoder, (other + learnt) * 7)
    assert decoder.statistics.faults == 14
    assert len(feed(decoder, other)) == 1
    assert decoder.statistics.faults == 14


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_no_input_raises_and_little_is_held(pieces: list[bytes]) -> None:
    """Random bytes in random pieces raise no error.

    The buffer never holds more than the longest line.
    """
    decoder = FejemisDecoder()
    for piece in pieces:
        feed(decoder, piece)
        assert len(decoder._held) <= LONGEST_LINE
    decoder.flush(0.0)


@given(st.text(alphabet="0123456789.-+eExX hbtfwlposevgyrac;#\r", max_size=60))
def test_no_line_raises(text: str) -> None:
    """A random text, made of characters that occur in real lines, raises no error."""
    parse(text)
    feed(FejemisDecoder(), b";07" + text.encode() + b"\n")


def test_a_sum_lets_one_damaged_line_in_99_through() -> None:
    """One damaged line in 99 passes its checksum. So the driver also checks the values."""
    chance, passed = random.Random(1), 0
    line = with_sum(b"pose 45.37199 1.234 -0.056 0.7854")
    for _ in range(20_000):
        damaged = bytearray(line)
        for at in chance.sample(range(3, len(line)), 3):
            damaged[at] = chance.randrange(0x20, 0x7F)
        passed += without_sum(bytes(damaged))[1] is True
    assert 100 < passed < 320
    assert sum_of(b"") == 1


def test_what_is_a_command_without_its_last_character_is_asked_with_a_sum_alone() -> None:
    """The query ``svpi`` without its ``i`` would set the servo.

    So the driver sends this query only with a checksum.
    """
    for sums in (True, False):
        polls = Polls("front")
        texts = [text for n in range(40) for text in polls.due(float(n), sums=sums, unknown={})]
        assert (b"svpi" in texts) is sums
        assert (b"svjti" in texts) is sums
        assert b"cvsteeri" in texts
