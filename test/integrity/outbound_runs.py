# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Which outbound trials run, and their scores.

The module chooses scenes, kinds of board, and the number of trials.
"""

import math
import os
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from multiprocessing import get_context
from random import Random
from typing import Final

from outbound_course import Course
from outbound_judge import Score
from outbound_line import FAULTS, OTHERS, Fault
from outbound_scenes import DRIVES, ENDED, SCENES
from outbound_trial import BoardKind, Memo, Trial

from omnibot_driver.simulator.omnibot.receivers import FRAMINGS, ReceiverKind

SCRIPTS: Final = 6
"""Number of scripts for each scene. The commands differ from script to script."""
NEEDED: Final = 10_000
"""Minimum number of trials with a stop, for each receiver and rate of lost bytes.

All scenes in ``ENDED`` together have this number of trials. With 1 byte in 100 lost, each scene in
``HURRIES``, for example "e-stop", has this number alone.
"""
HURRIES: Final = ("timeout", "e-stop", "exit")
AT_HURRIES: Final = "1 byte in 100 lost"
DRIVEN: Final = 150
"""Number of trials of each script that drives and does not stop. No stop is judged in these
trials."""
OTHER_TRIALS: Final = 20
"""Number of trials of each script with one of the faults ``OTHERS``.

The report has no limits for their results.
"""
ESTOPS: Final = ("e-stop", "goal", "exit")
"""Scenes in which it matters whether the board obeys an emergency stop."""
BOOTS: Final = ("reset", "exit")
"""Scenes in which the board boots, and may count bytes that arrive then as wake-up bytes."""

RECEIVERS: Final = {
    f"{framing.replace('_', ' ')}, letters {letters}": (framing, letters)
    for framing in FRAMINGS
    for letters in ("between", "anywhere")
}
Scores = dict[tuple[str, str, str], Score]
"""Scores by the names of a fault, a receiver and a scene."""


def boards(scene: str, receiver: str) -> Iterator[tuple[str, BoardKind]]:
    """Yield the kinds of board on which a scene runs, as pairs of a name and a kind.

    All these boards have the receiver ``receiver``. The scores of boards with the same name are
    added.
    """
    framing, letters = RECEIVERS[receiver]
    for obeys in (True, False) if scene in ESTOPS else (True,):
        name = f"{scene}, {'obeyed' if obeys else 'ignored'}" if scene == "e-stop" else scene
        for counts in (False, True) if scene in BOOTS else (False,):
            kind = ReceiverKind(framing=framing, letters=letters, wakes_while_booting=counts)
            yield name, BoardKind(kind, obeys)


def trials(fault: str, scene: str) -> int:
    """Return how often each script of ``scene`` runs with this fault, for each receiver and name.

    A script is one sequence of commands. ``boards`` yields the names.
    """
    if fault in OTHERS:
        return OTHER_TRIALS
    if scene in DRIVES:
        return DRIVEN
    hurry = fault == AT_HURRIES and scene in HURRIES
    return math.ceil(NEEDED / SCRIPTS / (1 if hurry else len(ENDED)))


def one(
    share: float, job: tuple[str, int], faults: Mapping[str, Fault] = FAULTS
) -> tuple[Scores, int]:
    """Run one script of a scene with each fault and each kind of board.

    Return the scores, and the number of runs of the driver's session.

    ``share``: share of the usual number of trials.

    ``job``: name of the scene, and seed of the script.
    """
    scene, seed = job
    course = Course(SCENES[scene](Random(f"{scene} {seed}")))
    scores: Scores = {}
    for receiver in RECEIVERS:
        memo: Memo = {}
        variants = list(boards(scene, receiver))
        names = {name for name, _ in variants}
        for fault, line in faults.items():
            number = max(1, round(share * trials(fault, scene) * len(names) / len(variants)))
            for name, board in variants:
                total = scores.setdefault((fault, receiver, name), Score())
                random = Random(f"{fault} {board} {scene} {seed}")
                trial = Trial(course, board, memo)
                for _ in range(number):
                    trial.run(line(random), total)
    return scores, course.rehearsals


def add(total: Scores, more: Scores) -> None:
    """Add each score in ``more`` to the score with the same key in ``total``."""
    for key, score in more.items():
        total.setdefault(key, Score()).__iadd__(score)


def over(scores: Scores, *, fault: str, receiver: str = "", scene: str = "") -> Score:
    """Return the sum of all scores with the given fault, receiver and scene.

    An empty ``receiver`` means all receivers. An empty ``scene`` means all scenes except those in
    ``DRIVES``.
    """
    total = Score()
    for (its_fault, its_receiver, its_scene), score in scores.items():
        wanted = its_scene == scene if scene else its_scene not in DRIVES
        if wanted and its_fault == fault and receiver in ("", its_receiver):
            total += score
    return total


def run(share: float, scripts: int, kinds: tuple[str, ...] = tuple(SCENES)) -> tuple[Scores, int]:
    """Run all trials on all processors.

    Return the scores, and the number of runs of the driver's session.

    ``share``: share of the usual number of trials.

    ``scripts``: number of scripts for each scene.
    """
    jobs = [(scene, seed) for seed in range(scripts) for scene in kinds]
    total: Scores = {}
    rehearsals = 0
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        for done, (scores, number) in enumerate(pool.imap_unordered(partial(one, share), jobs), 1):
            add(total, scores)
            rehearsals += number
            if sys.stderr.isatty():
                print(f"\r{done} of {len(jobs)} scripts", end="", file=sys.stderr, flush=True)
    return total, rehearsals
