# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The judge: it finds decoded frames that were never sent, and intact frames that are missing."""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate

from carriage import Chunks, Received
from truth import Key

Feed = Callable[[bytes, float], list[Key]]

MOST_DROPPED = 30
"""Largest number of intact sent frames that the judge skips to find a decoded frame.

After a larger skip, the frames may be equal by chance. So the next decoded frame of the read (if
any) must also be found.
"""
REACH_BYTES = 600
"""Number of received bytes before a read in which the judge searches for the read's frames.

In the sent stream, the judge goes back another 300 bytes.
"""


@dataclass(slots=True)
class Score:
    """Counts of decoded, wrong and intact frames. Scores can be added."""

    out: int = 0
    wrong: int = 0
    intact: int = 0
    delivered: int = 0
    texts: int = 0
    """Number of texts among the intact frames."""
    texts_delivered: int = 0
    missed_beyond_two: int = 0
    """Number of streams in which the parser missed an intact frame other than the first two.

    If a stream starts within a frame, the first two may be lost.
    """

    @property
    def wrong_share(self) -> float:
        """Share of wrong frames among those decoded."""
        return self.wrong / max(1, self.out)

    @property
    def delivered_share(self) -> float:
        """Share of intact frames that were decoded."""
        return self.delivered / max(1, self.intact)

    def __iadd__(self, other: "Score") -> "Score":
        self.out += other.out
        self.wrong += other.wrong
        self.intact += other.intact
        self.delivered += other.delivered
        self.texts += other.texts
        self.texts_delivered += other.texts_delivered
        self.missed_beyond_two += other.missed_beyond_two
        return self


def judge(received: Received, chunks: Chunks, feed: Feed, flush: Feed) -> Score:
    """Deliver the stream to a parser.

    Compare the parser's frames, in order, with those that were sent.
    """
    frames, intact = received.truth.frames, received.intact
    origins, data = received.origins, received.data
    ends = [end for _, _, end in frames]
    intact_before = [0, *accumulate(intact)]
    score = Score(intact=intact_before[-1])
    next_frame, start = 0, 0
    got = bytearray(len(frames))
    last = (len(data), chunks[-1][1] + 1.0)
    for end, now in [*chunks, last]:
        found = feed(data[start:end], now) if end > start else flush(b"", now)
        if found:
            horizon = _origin(origins, end - 1)
            nearest = _origin(origins, max(0, start - REACH_BYTES)) - 300
            for number, key in enumerate(found):
                first = bisect_left(ends, nearest, next_frame)
                at = _place(received, key, first, horizon)
                dropped = intact_before[at] - intact_before[first]
                if dropped > MOST_DROPPED and number + 1 < len(found):
                    after = _place(received, found[number + 1], at + 1, horizon)
                    skipped = intact_before[after] - intact_before[min(at + 1, after)]
                    at = at if skipped <= MOST_DROPPED else len(frames)
                score.out += 1
                if at < len(frames):
                    got[at] = 1
                    score.delivered += intact[at]
                    next_frame = at + 1
                else:
                    score.wrong += 1
        start = end
    whole = [bool(g) for g, i in zip(got, intact, strict=True) if i]
    texts = [i and frame[0][0] == "text" for frame, i in zip(frames, intact, strict=True)]
    score.texts = sum(texts)
    score.texts_delivered = sum(text and bool(g) for text, g in zip(texts, got, strict=True))
    score.missed_beyond_two = int(not all(whole[2:]))
    return score


def _place(received: Received, key: Key, at: int, horizon: int) -> int:
    """Return the index of the next true frame that equals the decoded frame ``key``.

    The search ends at the byte ``horizon``. If it finds no frame, return the number of frames.
    """
    frames = received.truth.frames
    while at < len(frames) and frames[at][1] <= horizon and frames[at][0] != key:
        at += 1
    return at if at < len(frames) and frames[at][1] <= horizon else len(frames)


def _origin(origins: list[int], at: int) -> int:
    while at > 0 and origins[at] < 0:
        at -= 1
    return origins[at]
