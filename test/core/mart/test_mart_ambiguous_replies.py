# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of replies that could belong to more than one request, or could be copies."""

from omnibot_driver.core.mart import State, parse, words
from omnibot_driver.core.mart.conversation import Answer, Conversation
from omnibot_driver.core.mart.polls import Polls
from omnibot_driver.core.mart.states import Motion
from omnibot_driver.core.mart.stopping import REPEAT_S, Stopping
from omnibot_driver.core.mart.words import Word


def stopped(*replies: tuple[float, bytes]) -> bool | None:
    """Return whether the replies show that a motion began before its stop; None if this is unclear.

    The driver requests the motion at 8 s, and its stop at 10 s and 10.3 s. Each item of ``replies``
    has the time in s and the bytes.
    """
    stop = Stopping(Motion.REVERSE, 10.0, delay_s=0.3, started_s=8.0, owed=1)
    stop.due(10.0)
    for at_s, data in replies:
        if at_s > 10.0 + REPEAT_S:
            stop.due(10.0 + REPEAT_S)
        stop.hear(parse(data), at_s)
    return stop.began


def test_the_reply_to_a_stop_tells_whether_the_motion_had_begun() -> None:
    """The reply to the first stop shows whether the motion had begun before this stop.

    "No motion" in reply to a second stop does not: the first stop may have ended the motion.
    """
    assert stopped((10.2, b"fail no motion")) is False
    assert stopped((10.4, b"ok"), (10.41, b"fail no motion")) is True
    assert stopped((10.2, b"fail insufficent clearence")) is True
    assert stopped((10.4, b"fail no motion")) is None


def asked(talk: Conversation, word: Word, reply: bytes, at_s: float, took_s: float) -> Answer:
    talk.ask(word.request(), at_s)
    answer = talk.hear(parse(reply), at_s + took_s)
    assert answer is not None
    return answer


def test_a_copy_of_one_reply_is_not_that_to_the_next_query() -> None:
    """A copy of the encoder count arrives after a sonar query.

    The driver does not take this copy for a distance.
    """
    talk = Conversation(0.3)
    asked(talk, words.SFC, b"ok 141", 0.5, 0.06)
    asked(talk, words.ENC, b"ok 1792", 1.0, 0.01)
    talk.ask(words.SFC.request(), 1.02)
    assert talk.hear(parse(b"ok 1792"), 1.06) is None
    answer = talk.hear(parse(b"ok 141"), 1.08)
    assert answer is not None
    assert not answer.when.doubtful


def test_two_queries_that_are_answered_alike_each_time_are_both_answered() -> None:
    """The server answers two different queries (MCSTAT and ENC) with 0, again and again.

    Although the answers are equal, the driver does not take one answer for a copy of another.
    """
    talk = Conversation(0.3)
    for n in range(3):
        asked(talk, words.MCSTAT, b"ok 0", 1.0 + 0.1 * n, 0.01)
        asked(talk, words.ENC, b"ok 0", 1.05 + 0.1 * n, 0.01)


def test_a_change_that_is_answered_by_the_angle_of_just_now_is_answered() -> None:
    """A heading query (RMRA) and then a speed change (RMCS) are answered with the same angle.

    The driver accepts both replies. It does not take the second reply for a copy of the first.
    """
    talk = Conversation(0.3)
    asked(talk, words.RMCS, b"ok 1.00", 0.5, 0.01)
    asked(talk, words.RMRA, b"ok 2.00", 1.0, 0.01)
    asked(talk, words.RMCS, b"ok 2.00", 1.02, 0.01)


def test_a_copy_of_what_has_come_is_not_the_reply_that_is_owed() -> None:
    """A copy of an older reply does not replace a missing reply, for which the driver still waits.

    Meanwhile, the driver sends no other query whose reply has the same form.
    """
    talk = Conversation(0.3)
    asked(talk, words.ENC, b"ok 5", 1.0, 0.01)
    talk.ask(words.SFC.request(), 1.1)
    talk.give_up(1.2)
    assert talk.hear(parse(b"ok 5"), 1.21) is None
    assert not talk.may_ask(words.SRC, 1.22)
    assert talk.hear(parse(b"ok 141"), 1.23) is None
    assert talk.may_ask(words.SRC, 1.24)


def test_the_sonars_are_asked_so_far_apart_that_their_replies_differ_in_time() -> None:
    """The driver leaves more than 0.35 s between two sonar queries.

    Both sonars report -1 if nothing is near, so replies differ only in time.
    """
    polls, asked_s = Polls(), {words.SFC: -1.0, words.SRC: -1.0}
    for tick in range(1000):
        now = tick * 0.01
        for word in polls.due(State.STILL, now)[:1]:
            if word in asked_s:
                assert now - max(asked_s.values()) > 0.35
                asked_s[word] = now
            polls.asked(word, now)
    assert min(asked_s.values()) > 8.0
