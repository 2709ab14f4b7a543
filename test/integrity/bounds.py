# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Limits for a parser's errors, and the streams on which the integrity report checks these limits.

A *chunking* is a way to read a stream in pieces. The *plain* parser, for comparison, decodes
without checks.
"""

from dataclasses import dataclass
from random import Random

import parsers
from busy import BUSY_LOOPS, READERS
from carriage import CHUNKERS, FAULTS, GAPS_VISIBLE, Chunker, receive
from judge import Score, judge
from truth import SCENARIOS, generate

CHUNKINGS: dict[str, Chunker] = {**CHUNKERS, **READERS, **BUSY_LOOPS}
BUSY_FAULTS = ("none, starting anywhere", "1 byte in 1,000 lost", "1 byte in 100 lost")


@dataclass(frozen=True, slots=True)
class Bound:
    """The limits of a parser's errors under one fault of the line.

    ``one_wrong_in_visible``: N in "at most one decoded frame in N may be wrong", for chunkings that
    show the line's idle gaps. None: every decoded frame must be right.

    ``one_wrong_in_hidden``: the same number for chunkings that hide the idle gaps.

    ``delivered``: least share of the intact frames that must be decoded. With 1.0, only the first
    two of them in a stream may be missing.

    ``chunkers``: names of the chunkings that have these limits.
    """

    one_wrong_in_visible: int | None
    one_wrong_in_hidden: int | None
    delivered: float
    chunkers: tuple[str, ...] = tuple(CHUNKINGS)

    def one_wrong_in(self, chunker: str) -> int | None:
        """Return the number N in "at most one decoded frame in N may be wrong".

        Return ``None`` if every decoded frame must be right.
        """
        visible = chunker in GAPS_VISIBLE
        return self.one_wrong_in_visible if visible else self.one_wrong_in_hidden

    def share(self, chunker: str) -> float:
        """Return the share of the intact frames that must be decoded with this chunking.

        For a chunking in ``BUSY_LOOPS``, no more than 0.999 is required, because both the adapter
        and the reader are late.
        """
        return min(self.delivered, 0.999) if chunker in BUSY_LOOPS else self.delivered

    def holds(self, chunker: str, score: Score) -> bool:
        """Return whether the errors that a parser made with a chunking are within the limits.

        If there are no limits for this chunking, return True.

        ``score``: the counts of the parser's decoded, wrong and missing frames.
        """
        if chunker not in self.chunkers:
            return True
        one_in = self.one_wrong_in(chunker)
        few = score.wrong == 0 if one_in is None else score.wrong * one_in <= score.out
        if self.share(chunker) == 1.0:
            return few and score.missed_beyond_two == 0
        return few and score.delivered_share >= self.share(chunker)


BOUNDS: dict[str, Bound] = dict(
    zip(
        FAULTS,
        (
            Bound(None, None, 1.0),
            Bound(10_000, 4_000, 0.995),
            Bound(500, 150, 0.95),
            Bound(5_000, 5_000, 0.995, ("whole bursts", "FTDI", "4096-byte blocks")),
            Bound(3_000, 1_000, 0.995),
        ),
        strict=True,
    )
)
"""The limits for each fault.

The fault that adds bytes to the stream has limits only for the three chunkings with long chunks.
"""

Scores = dict[tuple[str, str, str], Score]
"""Scores by the names of a fault, a chunking and a scenario."""

PLAIN_CHUNKING = "whole bursts"
"""The only chunking for the plain parser, whose result does not depend on the chunking."""


def chunkings(fault: str) -> dict[str, Chunker]:
    """Return the chunkings with which this fault is tested.

    Only the faults in ``BUSY_FAULTS`` are tested with chunkings in which the reading process is
    late.
    """
    return CHUNKINGS if fault in BUSY_FAULTS else CHUNKERS


def run(scenario: str, seed: int, seconds: float, parser: str) -> Scores:
    """Return a parser's scores on one stream with every fault.

    The driver's parser gets every chunking. The plain parser gets only one, because its result does
    not depend on the chunking.
    """
    truth = generate(SCENARIOS[scenario], seed, seconds)
    scores: Scores = {}
    for fault_name, fault in FAULTS.items():
        received = receive(truth, fault, Random(f"{scenario} {seed} {fault_name}"))
        tried = chunkings(fault_name)
        for chunker_name in tried if parser == "driver" else (PLAIN_CHUNKING,):
            chunks = tried[chunker_name](received, Random(seed))
            feed, flush = getattr(parsers, parser)()
            score = judge(received, chunks, feed, flush)
            scores[fault_name, chunker_name, scenario] = score
    return scores


def over_scenarios(scores: Scores, fault: str, chunker: str) -> Score:
    """Return the sum of a parser's scores over all scenarios, for one fault and one chunking."""
    total = Score()
    for scenario in SCENARIOS:
        total += scores[fault, chunker, scenario]
    return total


def over_chunkers(scores: Scores, fault: str, scenario: str) -> Score:
    """Return the sum of a parser's scores over all chunkings, for one fault and one scenario."""
    total = Score()
    for chunker in chunkings(fault):
        total += scores[fault, chunker, scenario]
    return total
