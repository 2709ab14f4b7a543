# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the examples in docs/internals/omnibot_protocol.md agree with the codec.

An example is a line with bytes, ``->`` and a word with its numbers.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

import pytest

from omnibot_driver.boards.omnibot import PARAMETERS
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.omnibot import (
    CommandFrame,
    DeltaFrame,
    FrameDecoder,
    ImuFrame,
    OmniBot,
    OmniBotSettings,
    PausedFrame,
    PoseFrame,
    decode,
    encode,
)
from omnibot_driver.core.omnibot.command_encoder import CommandEncoder
from omnibot_driver.core.packets import joined

DOCUMENT = (Path(__file__).parents[3] / "docs" / "internals" / "omnibot_protocol.md").read_text(
    encoding="utf-8"
)

EXAMPLE = re.compile(r"((?:[0-9A-F]{2} )+) *-> (\S+)((?: -?[\d.]+)*)\s*(?:# (.*))?")
BOARD = OmniBot(OmniBotSettings())
ENCODER = CommandEncoder(OmniBotSettings())

APPENDIX = {
    "Stop": "FF FE 02 00 00 00 00 00 00",
    "E-stop": "FF FE 10 00 00 00 00 00 00",
    "Rotate all": "FF FE 02 00 20 00 20 00 20",
    "Rotate all reversed": "FF FE 02 FF E0 FF E0 FF E0",
    "Rotate A": "FF FE 02 00 20 00 00 00 00",
    "Rotate B": "FF FE 02 00 00 00 20 00 00",
    "Rotate C": "FF FE 02 00 00 00 00 00 20",
    "Vx = 32": "FF FE 01 00 20 00 00 00 00",
    "Vy = 32": "FF FE 01 00 00 00 20 00 00",
    "Omega = 8": "FF FE 01 00 00 00 00 00 08",
}

DECISIONS = {
    "linear_scale",
    "angular_scale",
    "position_scale",
    "heading_scale",
    "wheel_radius",
    "base_radius",
    "counts_per_revolution",
    "axis_signs",
    "delta_frame",
    "delta_period",
    "pose_byte_order",
    "accel_range",
    "gyro_range",
}

Number = int | float
AnyFrame = ImuFrame | DeltaFrame | PoseFrame | PausedFrame | CommandFrame


def command(mode: int) -> Callable[..., CommandFrame]:
    return lambda a, b, c: CommandFrame(mode, (a, b, c))


FRAMES: dict[str, Callable[..., AnyFrame]] = {
    "imu": lambda *words: ImuFrame(words[:3], words[3:]),
    "delta": DeltaFrame,
    "pose": PoseFrame,
    "pose-little": PoseFrame,
    "paused": PausedFrame,
    "velocity": command(0x01),
    "wheels": command(0x02),
    "estop": command(0x10),
}
SENT_AS_IT_IS = {
    "S": b"\x53",
    "P": b"\x50",
    "R": b"\x52",
    "opening": joined(BOARD.wake() + BOARD.start()),
}


class Example(NamedTuple):
    """One example of the document."""

    data: bytes
    word: str
    numbers: tuple[Number, ...]
    remark: str


def code_lines(text: str) -> list[str]:
    """Return the lines inside fenced code blocks."""
    return [line for block in text.split("```")[1::2] for line in block.splitlines()[1:]]


def examples(text: str) -> list[Example]:
    """Return the examples in the code blocks of a text, in order."""
    found = filter(None, map(EXAMPLE.fullmatch, code_lines(text)))
    return [
        Example(
            bytes.fromhex(data),
            word,
            tuple(map(json.loads, numbers.split())),
            remark or "",
        )
        for data, word, numbers, remark in (match.groups() for match in found)
    ]


def section(title: str) -> str:
    """Return the section of the document whose second-level heading contains ``title``."""
    return next(part for part in DOCUMENT.split("\n## ") if title in part.partition("\n")[0])


EXAMPLES = examples(DOCUMENT)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: f"{e.word} {e.data.hex()}")
def test_each_example_means_what_the_document_says(example: Example) -> None:
    """The bytes of an example decode to its numbers, and the numbers encode to the bytes."""
    if example.word in SENT_AS_IT_IS:
        assert example.data == SENT_AS_IT_IS[example.word]
    else:
        frame = FRAMES[example.word](*example.numbers)
        order: Literal["big", "little"] = "little" if example.word == "pose-little" else "big"
        assert decode(example.data, order) == frame
        assert encode(frame, order) == example.data


def test_no_line_of_bytes_escapes_the_check() -> None:
    """Each line of a code block that looks like an example is a valid example.

    A line looks like one if it begins with bytes, or if it has an arrow.
    """
    suspects = re.compile(r"\s*[0-9A-Fa-f]{2}( [0-9A-Fa-f]{2})*(\s|$)|.*\s->\s")
    lines = [line for line in code_lines(DOCUMENT) if suspects.match(line)]
    assert [line for line in lines if not EXAMPLE.fullmatch(line)] == []
    assert len(lines) == len(EXAMPLES)


def test_every_kind_of_frame_and_letter_has_an_example() -> None:
    """The document has an example of every kind of frame, and of every letter."""
    assert {example.word for example in EXAMPLES} == FRAMES.keys() | SENT_AS_IT_IS.keys()


def test_the_ten_commands_of_the_appendix_are_shown_under_their_names() -> None:
    """The ten commands of the manual's appendix have the same names and bytes in the document."""
    shown = {example.remark: example.data.hex(" ").upper() for example in EXAMPLES}
    assert {name: shown.get(name) for name in APPENDIX} == APPENDIX


def test_the_commands_in_si_units_are_what_the_driver_sends_by_default() -> None:
    """Some examples have a remark that gives a motion in SI units.

    The driver encodes this motion to the bytes of the example.
    """
    wishes = [
        (example, [float(part.split()[0]) for part in example.remark.split(",")])
        for example in EXAMPLES
        if example.remark.endswith("rad/s")
    ]
    assert {example.word for example, _ in wishes} == {"velocity", "wheels"}
    for example, (a, b, c) in wishes:
        wheels = example.word == "wheels"
        sent = ENCODER.wheels((a, b, c)) if wheels else ENCODER.velocity(BodyTwist(a, b, c))
        assert bytes(4) + example.data == sent


def test_the_false_frames_lie_at_their_offsets_and_do_not_deceive_the_decoder() -> None:
    """The document shows two true frames whose bytes contain false frames, at the given offsets.

    The decoder returns only the true frames.
    """
    in_section = examples(section("Why framing is hard"))
    false = [example for example in in_section if example.remark.startswith("false")]
    true = [example for example in in_section if example not in false]
    line = b"".join(example.data for example in true)
    assert {example.word for example in false} == {"imu", "delta"}
    for example in false:
        offset = int(example.remark.rsplit(maxsplit=1)[1])
        assert line[offset : offset + len(example.data)] == example.data
    assert FrameDecoder().feed(line, 0.0) == [decode(example.data) for example in true]


def test_the_parameters_that_carry_a_decision_exist_with_the_stated_defaults() -> None:
    """The document has a table of parameters and their defaults. They are the driver's defaults."""
    rows = re.findall(r"^\| `([a-z]\w+)` \| ([^|]+?) \|", DOCUMENT, re.MULTILINE)
    assert {name for name, _ in rows} == DECISIONS
    for name, value in rows:
        default = PARAMETERS.by_name[name].default
        assert value == default if isinstance(default, str) else json.loads(value) == default
