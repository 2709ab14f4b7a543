# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Short trials of boards that read the driver's bytes from a damaged line; tests of the judge.

The judge compares what the board understood with what the driver sent.
"""

from copy import copy
from dataclasses import replace
from random import Random

import pytest
from outbound import BOUNDS
from outbound_course import Course
from outbound_judge import Judge, Score
from outbound_line import FAULTS, GOOD, LOSSES, Arrival, Bursts, Line
from outbound_runs import RECEIVERS, boards, one, over
from outbound_scenes import DRIVES, ENDED, FROM_S
from outbound_trial import BoardKind, Trial
from outbound_words import parse

from omnibot_driver.simulator.omnibot.receivers import ReceiverKind
from omnibot_driver.simulator.omnibot.wire import ControlFrame

COUNTING = BoardKind(ReceiverKind())
STOP = bytes.fromhex("FF FE 02 00 00 00 00 00 00")


class Losing:
    """A line that loses the bytes at the given positions, counted from 0 over all writes."""

    def __init__(self, *numbers: int) -> None:
        self.whole = 0
        self._numbers, self._at = numbers, 0

    def carry(self, data: bytes) -> list[Arrival]:
        begin, self._at = self._at, self._at + len(data)
        return [(byte, at, at) for at, byte in enumerate(data) if begin + at not in self._numbers]


def on_all_receivers(course: Course, line: Line) -> Score:
    """Send the driver's writes in ``course`` to each kind of receiver. Return the total score.

    Each receiver gets its own copy of ``line``, with the same faults.
    """
    total = Score()
    for receiver in RECEIVERS:
        for _, board in boards(course.scene.kind, receiver):
            Trial(course, board, {}).run(copy(line), total)
    return total


def shown(score: Score) -> str:
    """Return a score as a text: its counts, and the bytes that led to the counted errors."""
    return "\n".join([str(score), *map(str, score.examples)])


@pytest.mark.parametrize("scene", ENDED)
def test_nothing_is_wrong_on_a_good_line(scene: str) -> None:
    """The line is undamaged.

    Each kind of receiver obeys only what the driver has sent, and the robot stops in time.
    """
    course = Course(ENDED[scene](Random(scene)))
    score = on_all_receivers(course, GOOD)
    found = score.strayed, score.overdue, score.uncommanded, score.false_letters, score.false_estops
    assert found == (0, 0, 0, 0, 0), shown(score)


@pytest.mark.parametrize("scene", [*ENDED, "drive 20"])
def test_the_bounds_of_the_outbound_report_hold(scene: str) -> None:
    """The results of a short run of a scene are within the bounds of the outbound report.

    Bounds on rates are not checked: the run has too few frames.
    """
    scores, _ = one(0.025, (scene, 0), LOSSES)
    for fault in LOSSES:
        score = Score()
        for key, more in scores.items():
            if key[0] == fault:
                score += more
        if scene in ENDED:
            bound = replace(BOUNDS[fault], share=1.0, long_in=0.0)  # too few frames for a rate
            assert not bound.missed(score), shown(score)
        else:
            assert score.uncommanded_s < 0.12 * score.driving_s


def test_a_motion_frame_that_lost_a_byte_is_in_force_for_a_moment_only() -> None:
    """If a motion frame loses its last byte, the board obeys a wrong frame for less than 1.5 ms."""
    course = Course(DRIVES["drive 20"](Random("a byte")))
    moving = next(
        number
        for number, write in enumerate(course.writes)
        if write.at_s >= FROM_S and course.items[number].moves
    )
    begin = (
        course.bytes_before[moving]
        - course.bytes_before[
            next(n for n, write in enumerate(course.writes) if write.at_s >= FROM_S)
        ]
    )
    score = Score()
    line = Losing(begin + len(course.writes[moving].data) - 1)
    Trial(course, COUNTING, {}).run(line, score)
    assert score.uncommanded == 1, shown(score)
    assert score.longest_s < 0.0015


def test_the_judge_finds_motion_that_was_made_of_a_stop() -> None:
    """The judge reports stray motion if a Stop that lost a byte becomes a wheel command."""
    judge = Judge()
    judge.write(parse(STOP), 0.0)
    judge.write(parse(STOP), 0.05)
    assert judge.frame(ControlFrame(2, (0, 0, 255)), 0.0501) == "stray motion"
    judge.frame(ControlFrame(2, (0, 0, 0)), 0.101)
    judge.end(1.0)
    assert judge.score.strayed == 1
    assert judge.score.stray_s == pytest.approx(0.0509)


def test_the_judge_tells_an_old_command_from_one_that_was_never_given() -> None:
    """Just after a write, the judge accepts a frame with the set-point of the previous write.

    It reports a frame whose set-point is neither in the current write nor in the previous one.
    """
    first = bytes.fromhex("FF FE 01 00 20 00 00 00 00")
    second = bytes.fromhex("FF FE 01 00 10 00 00 00 00")
    judge = Judge()
    judge.write(parse(first), 0.0)
    assert judge.frame(ControlFrame(1, (32, 0, 0)), 0.0008) == ""
    judge.write(parse(second), 0.05)
    assert judge.frame(ControlFrame(1, (32, 0, 0)), 0.0505) == ""
    judge.write(parse(second), 0.10)
    assert judge.frame(ControlFrame(1, (48, 0, 0)), 0.1008) == "uncommanded"
    judge.write(parse(second), 0.15)
    assert judge.frame(ControlFrame(1, (16, 0, 0)), 0.1508) == ""
    judge.end(0.2)
    assert judge.score.uncommanded_s == pytest.approx(0.05)
    assert (judge.score.long, judge.score.frames) == (1, 4)


def test_the_judge_tells_letters_of_the_driver_from_others() -> None:
    """The judge accepts a letter (S, P or R) that the driver sent, and counts all others.

    A byte that the driver did not send as a letter counts as "false". A letter that the line added
    counts as "added".
    """
    judge = Judge()
    judge.write(parse(bytes(8) + STOP + bytes(8) + b"P"), 0.0)
    assert judge.letter(0x50, 25) == ""
    assert judge.letter(0x50, 24) == "false letter"
    assert judge.letter(0x52, -1) == ""
    assert (judge.score.false_letters, judge.score.added_letters) == (1, 1)


def test_a_cut_line_leaves_the_robot_driving_and_the_judge_says_so() -> None:
    """The line is cut during a drive, so Stop never arrives.

    The judge reports that the robot still drives.
    """
    course = Course(ENDED["timeout"](Random("cut")))
    driving = next(n for n, items in enumerate(course.items) if items.moves)
    begin = next(n for n, write in enumerate(course.writes) if write.at_s >= FROM_S)
    heard = course.bytes_before[driving + 1] - course.bytes_before[begin]
    cut = Bursts(0.5, 1 << 40, Random(2))
    cut.whole = heard
    score = Score()
    Trial(course, COUNTING, {}).run(cut, score)
    assert (score.overdue, score.for_good) == (1, 1)


@pytest.mark.parametrize("fault", FAULTS)
def test_passing_over_what_arrives_whole_changes_no_score(fault: str) -> None:
    """A trial that skips undamaged writes has the same score as a trial that plays every write."""

    class Slow(Trial):
        def _skip(self) -> None:
            pass

    for scene in ("switch", "e-stop", "drive 100"):
        course = Course({**ENDED, **DRIVES}[scene](Random(scene)))
        for seed in range(2):
            quick, slow = Score(), Score()
            Trial(course, COUNTING, {}).run(FAULTS[fault](Random(seed)), quick)
            Slow(course, COUNTING, {}).run(FAULTS[fault](Random(seed)), slow)
            quick.examples, slow.examples = [], []
            assert quick == slow


def test_a_write_is_read_by_the_layout_alone() -> None:
    """The parser splits a write into zeros, frames and letters. Other bytes raise ValueError."""
    items = parse(bytes(8) + STOP + bytes(8) + b"S")
    assert items.frames == ((16, 2, (0, 0, 0)),)
    assert items.letters == ((25, 0x53),)
    with pytest.raises(ValueError, match="neither zeros"):
        parse(bytes(8) + STOP[1:])


def test_sums_of_one_scene_and_of_all_that_end() -> None:
    """``over`` adds the scores of a given scene, or of all scenes in which the robot must stop."""
    scores = {
        ("a", "r", "timeout"): Score(trials=1),
        ("a", "r", "kill"): Score(trials=2),
        ("a", "r", "drive 20"): Score(trials=4),
        ("b", "r", "kill"): Score(trials=8),
    }
    assert over(scores, fault="a").trials == 3
    assert over(scores, fault="a", scene="drive 20").trials == 4
