# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Common parts of the integrity reports: damage to a stream in pieces, and sums of scores.

The format of frames is not used here. Scores need the operator ``+=``.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from multiprocessing import Pool
from random import Random
from typing import Any, TypeVar

from carriage import Fault

Key = TypeVar("Key")
Job = TypeVar("Job")


def damaged(pieces: Sequence[bytes], fault: Fault, random: Random) -> list[bytes]:
    """Damage the bytes of a line, and return the damaged pieces.

    In these pieces, the lost bytes are missing, and the added bytes are included.
    """
    whole = b"".join(pieces)
    ends, at = [], 0
    for piece in pieces:
        at += len(piece)
        ends.append(at)
    result, number = [bytearray() for _ in pieces], 0
    for origin in fault(len(whole), random):
        while origin >= 0 and origin >= ends[number]:
            number += 1
        result[number].append(whole[origin] if origin >= 0 else random.randrange(256))
    return [bytes(piece) for piece in result]


def add(total: dict[Key, Any], more: Mapping[Key, Any]) -> None:
    """Add each score in ``more`` to the score with the same key in ``total``."""
    for key, score in more.items():
        if key in total:
            total[key] += score
        else:
            total[key] = score


def scores_of(one: Callable[[Job], Mapping[Key, Any]], jobs: Iterable[Job]) -> dict[Key, Any]:
    """Run the jobs in parallel on all cores, and return the sums of their scores."""
    total: dict[Key, Any] = {}
    with Pool(os.cpu_count()) as pool:
        for scores in pool.imap_unordered(one, jobs):
            add(total, scores)
    return total
