# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the limits in the integrity report, with shorter streams than the report uses."""

from random import Random

import pytest
from bounds import BOUNDS, Scores, chunkings, over_scenarios, run
from carriage import CHUNKERS, FAULTS, receive
from judge import judge
from parsers import plain
from pieces import add
from truth import SCENARIOS, generate

SECONDS = 2.5
SEED = 25
"""A seed for which the stream contains a pause of the board and a text from the board.

Few seeds give both in a stream as short as this one.
"""


@pytest.fixture(scope="module")
def scores() -> Scores:
    """Return the counts of right and wrong frames for every scenario, fault and chunking.

    For each fault and chunking, the scenarios together have about 2,100 frames.
    """
    total: Scores = {}
    for scenario in SCENARIOS:
        add(total, run(scenario, SEED, SECONDS, "driver"))
    return total


@pytest.mark.parametrize(
    ("fault", "chunker"), [(fault, chunker) for fault in FAULTS for chunker in chunkings(fault)]
)
def test_the_bounds_of_the_integrity_report_hold(fault: str, chunker: str, scores: Scores) -> None:
    """All scenarios together keep the limits of wrong frames and of lost frames."""
    score = over_scenarios(scores, fault, chunker)
    assert BOUNDS[fault].holds(chunker, score), score
    assert score.out > 1_500


def test_the_judge_finds_nothing_wrong_with_a_stream_that_is_whole() -> None:
    """If the stream is undamaged, even the plain parser makes no error. The judge reports none."""
    truth = generate(SCENARIOS["driving"], 1, 10.0)
    received = receive(truth, lambda length, _: list(range(length)), Random(1))
    score = judge(received, CHUNKERS["FTDI"](received, Random(1)), *plain())
    assert (score.wrong, score.delivered, score.missed_beyond_two) == (0, len(truth.frames), 0)


def test_the_judge_finds_what_the_plain_parser_makes_up() -> None:
    """The stream is damaged, and the plain parser returns many false frames.

    The judge finds them.
    """
    truth = generate(SCENARIOS["gyro stuck at (-6, -5, -4)"], 1, 20.0)
    received = receive(truth, FAULTS["1 byte in 1,000 lost"], Random(1))
    score = judge(received, CHUNKERS["FTDI"](received, Random(1)), *plain())
    assert score.wrong > 20
