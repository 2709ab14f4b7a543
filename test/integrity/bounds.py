# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The bounds of the integrity report, and how streams are run to compare with them."""

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
    """At most one wrong frame in this many (None: none), and at least this share delivered.

    A share of 1.0 means all frames after the first two.
    """

    one_wrong_in_visible: int | None
    one_wrong_in_hidden: int | None
    delivered: float
    chunkers: tuple[str, ...] = tuple(CHUNKINGS)

    def one_wrong_in(self, chunker: str) -> int | None:
        """Return the bound, which depends on whether the chunking keeps the line's idle gaps."""
        visible = chunker in GAPS_VISIBLE
        return self.one_wrong_in_visible if visible else self.one_wrong_in_hidden

    def share(self, chunker: str) -> float:
        """Return the share to deliver, which is smaller where adapter and reader are both late."""
        return min(self.delivered, 0.999) if chunker in BUSY_LOOPS else self.delivered

    def holds(self, chunker: str, score: Score) -> bool:
        """Return whether the score reaches the bound."""
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
"""Bounds by fault; for added bytes only with reads that contain what follows a frame."""

Scores = dict[tuple[str, str, str], Score]
"""Scores by fault, chunking and scenario."""

PLAIN_CHUNKING = "whole bursts"
"""Chunking for the plain parser, which makes the same of all chunkings."""


def chunkings(fault: str) -> dict[str, Chunker]:
    """Return the chunkings for this fault; busy readers are run with some faults only."""
    return CHUNKINGS if fault in BUSY_FAULTS else CHUNKERS


def run(scenario: str, seed: int, seconds: float, parser: str) -> Scores:
    """Run one stream with every fault; the driver's parser in every chunking."""
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
    """Return the sum over all scenarios."""
    total = Score()
    for scenario in SCENARIOS:
        total += scores[fault, chunker, scenario]
    return total


def over_chunkers(scores: Scores, fault: str, scenario: str) -> Score:
    """Return the sum over all chunkings."""
    total = Score()
    for chunker in chunkings(fault):
        total += scores[fault, chunker, scenario]
    return total
