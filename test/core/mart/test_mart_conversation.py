# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that the driver reads replies, and attributes each reply to the correct request.

The texts of the replies are those of a running server.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.core.mart import Fail, Form, MartDecoder, MartSettings, Ok, Other, parse, words
from omnibot_driver.core.mart.conversation import Conversation
from omnibot_driver.core.mart.moment import Moment
from omnibot_driver.core.mart.odometry import MartOdometry
from omnibot_driver.core.mart.replies import signed
from omnibot_driver.core.mart.states import HALTS, LAST_HALTS, MAY_SAY, Motion, State, may_say
from omnibot_driver.core.mart.stopping import REPEAT_S, Stopping

GOLDEN = {
    b"ok": Ok(Form.NOTHING),
    b"ok BBB": Ok(Form.NAME, "BBB"),
    b"ok 25.31": Ok(Form.DECIMAL, "25.31"),
    b"ok -9471922026430314.00": Ok(Form.DECIMAL, "-9471922026430314.00"),
    b"ok -nan": Ok(Form.DECIMAL, "-nan"),
    b"ok -1": Ok(Form.INTEGER, "-1"),
    b"ok -49": Ok(Form.INTEGER, "-49"),
    b"ok true": Ok(Form.TRUTH, "true"),
    b"ok MotionController946684800.log 1093": Ok(Form.FILE, "MotionController946684800.log 1093"),
    b"ok  12": Ok(Form.INTEGER, "12"),
    b" ok 12\t\r\n": Ok(Form.INTEGER, "12"),
    b"ok BBB\0": Ok(Form.NAME, "BBB"),
    b"fail": Fail(""),
    b"fail ": Fail(""),
    b"fail conflicting action in progress": Fail("conflicting action in progress"),
    b"fail Insufficient front clearance.": Fail("Insufficient front clearance."),
    b"Calculated motion (\xb0): 3.1": Other(b"Calculated motion (\xb0): 3.1"),
    b"hello": Other(b"hello"),
}


@pytest.mark.parametrize("data", GOLDEN)
def test_a_reply_is_read(data: bytes) -> None:
    """The decoder turns each text of a reply into a message of the correct form."""
    assert parse(data) == GOLDEN[data]


@given(st.binary(max_size=600))
def test_no_datagram_raises(data: bytes) -> None:
    """The decoder makes one message of each datagram that has bytes, whatever these bytes are.

    An empty datagram gives no message.
    """
    assert len(MartDecoder().feed(data, 0.0)) == bool(data)


def test_a_request_fits_the_servers_buffer() -> None:
    """A request has 1 to 49 ASCII bytes. An empty datagram would shut the server down."""
    assert words.RMCS.request(5, -5).data == b"RMCS 5 -5"
    assert words.CHECK.request(0).data == b"MCR SLOW 0"
    assert words.TF.request("SLOW", 24).data == b"TF SLOW 24"
    with pytest.raises(ValueError, match="1 to 49 bytes"):
        words.TIME.request("1" * 60)


def conversation() -> Conversation:
    return Conversation(0.3)


def test_a_reply_answers_the_pending_request() -> None:
    """A reply answers the pending request.

    ``Conversation.hear`` returns the request and the time from the request to the reply.
    """
    talk = conversation()
    assert talk.ask(words.ENC.request(), 1.0) == ((0, b"ENC"),)
    answer = talk.hear(parse(b"ok 123"), 1.01)
    assert answer is not None
    assert (answer.word, answer.took_s) == (words.ENC, pytest.approx(0.01))
    assert not answer.when.doubtful
    assert talk.pending is None


@pytest.mark.parametrize(
    ("word", "late"),
    [
        (words.ENC, b"ok 1.25"),
        (words.ENC, b"ok"),
        (words.RMRA, b"ok 12"),
        (words.RM, b"fail no motion in progress"),
        (words.RMCS, b"fail conflicting action in progress"),
        (words.CHECK, b"fail no motion"),
        (words.HELLO, b"ok true"),
    ],
)
def test_a_late_reply_is_not_attributed_to_the_next_request(word: words.Word, late: bytes) -> None:
    """A late reply whose form does not fit the pending request is discarded."""
    talk = conversation()
    talk.ask(word.request(), 1.0)
    assert talk.hear(parse(late), 1.4) is None
    assert talk.discarded == 1
    assert talk.pending is not None


def test_no_late_ok_proves_the_imu() -> None:
    """An ok that comes 0.3 s after a check of the IMU does not prove that the IMU works.

    A check takes at least 0.32 s, so this ok is a late reply.
    """
    talk = conversation()
    talk.ask(words.CHECK.request(0), 1.0)
    assert talk.hear(parse(b"ok"), 1.3) is None
    assert talk.hear(parse(b"ok"), 1.5) is not None
    assert all(word.least_s > talk.delay_s for word in (words.CHECK, words.TF, words.TB, words.MCR))


def test_the_quick_proof_of_the_imu_waits_until_no_late_ok_can_be_taken_for_it() -> None:
    """The driver delays RST IMU (check of the IMU) until no late ok can be taken for its reply."""
    talk = conversation()
    talk.ask(words.CS.request(1, 1), 1.0)
    assert talk.hear(parse(b"ok"), 1.1) is not None
    assert talk.certain_from_s(words.RESET) == pytest.approx(1.1 + 0.3 - words.RESET.least_s)
    assert talk.certain_from_s(words.CHECK) < 1.1
    talk.ask(words.RM.request(30), 2.0)
    talk.give_up(2.1)
    assert talk.certain_from_s(words.RESET) > 2.7
    talk.settle(2.2)
    assert talk.certain_from_s(words.RESET) == pytest.approx(2.5 - words.RESET.least_s)


def test_after_a_lost_reply_another_query_of_its_form_waits() -> None:
    """A sonar query gets no reply.

    The next sonar query waits for this reply. ENC (encoder query) is sent at once, and its reply is
    doubtful, because a late sonar reply would look the same.
    """
    talk = conversation()
    talk.ask(words.SFC.request(), 1.0)
    assert talk.overdue(1.1) is None
    assert talk.overdue(2.0) is words.SFC
    talk.ask(words.SFC.request(), 2.0)
    talk.give_up(2.1)
    assert not talk.may_ask(words.SRC, 2.1)
    assert talk.may_ask(words.DOCKED, 2.1)
    assert talk.may_ask(words.ENC, 2.1)
    talk.ask(words.ENC.request(), 2.1)
    answer = talk.hear(parse(b"ok 7"), 2.2)
    assert answer is not None
    assert answer.when.doubtful
    assert talk.may_ask(words.SRC, 2.9)


def test_every_motion_is_stopped_by_its_own_word() -> None:
    """Each motion has its own stop command, which the driver uses first.

    The stop of a controlled move goes to the stop port. All other stops go to the command port.
    """
    texts = {motion: [word.text for word in said] for motion, said in HALTS.items()}
    assert texts == {
        Motion.NONE: [],
        Motion.REFERENCE: ["SRM"],
        Motion.REVERSE: ["SM"],
        Motion.SPIN: ["SM"],
        Motion.STRAIGHT: ["SL"],
        Motion.TURN: ["SS"],
        Motion.UNKNOWN: ["SRM", "SM"],
    }
    for state in (State.DRIVING, State.REVERSING, State.TURNING):
        assert not MAY_SAY[state] & {words.SL, words.SS, words.L, words.R, words.RM}
    assert not may_say(State.MOVING, words.SS, Motion.STRAIGHT)


def stopping(motion: Motion, *, started_s: float = 0.0, owed: int = 0) -> Stopping:
    return Stopping(motion, 10.0, delay_s=0.3, started_s=started_s, owed=owed)


def test_a_stop_is_repeated_until_it_is_answered() -> None:
    """The driver repeats a stop until the server answers.

    "No motion" proves the stop just as ok does.
    """
    stop = stopping(Motion.REFERENCE)
    assert stop.due(10.0) == (words.SRM,)
    assert stop.due(10.1) == ()
    assert stop.due(10.0 + REPEAT_S) == (words.SRM,)
    assert stop.hear(parse(b"fail no motion in progress"), 10.5)


def test_a_stop_that_may_have_overtaken_its_start_is_not_believed_alone() -> None:
    """The reply to a stop that may have overtaken its start does not prove a standstill.

    The reply to a later stop proves it.
    """
    stop = stopping(Motion.REFERENCE, started_s=9.9)
    assert stop.due(10.0) == (words.SRM,)
    assert not stop.hear(parse(b"fail no motion in progress"), 10.1)
    assert stop.due(10.3) == (words.SRM,)
    assert stop.hear(parse(b"ok"), 10.9)


def test_the_reply_of_the_start_is_not_that_of_the_stop() -> None:
    """Two ``ok`` after a start and a stop do not prove the stop: both may be replies to the start.

    The network may duplicate a reply. A later "no motion" proves the stop.
    """
    stop = stopping(Motion.REFERENCE, owed=1)
    stop.due(10.0)
    assert not stop.hear(parse(b"ok"), 10.05)
    assert not stop.hear(parse(b"ok"), 10.2)
    assert stop.hear(parse(b"fail no motion in progress"), 10.5)


def test_two_copies_of_one_reply_do_not_prove_a_stop() -> None:
    """The driver sends a stop, and again after 0.3 s.

    Only a reply that comes more than 0.6 s after the first stop proves the stop: an earlier reply
    may be a copy.
    """
    stop = stopping(Motion.REVERSE, started_s=9.9)
    assert stop.due(10.0) == (words.SM,)
    assert stop.due(10.3) == (words.SM,)
    for late_s in (10.1, 10.35, 10.59):
        assert not stop.hear(parse(b"fail no motion"), late_s)
    assert stop.hear(parse(b"fail no motion"), 10.61)


def test_the_stop_port_comes_last_and_ends_the_belief_in_replies() -> None:
    """After three unanswered stops, the driver uses the server's second port, the stop port.

    From then on, a reply no longer proves that the motion has ended.
    """
    stop = stopping(Motion.REVERSE)
    said = [word for tick in range(60) for word in stop.due(10.0 + 0.1 * tick)]
    before = said.index(words.SL)
    assert said[:before].count(words.SM) >= 3
    assert LAST_HALTS[Motion.REVERSE] == (words.SL,)
    assert stop.failed
    assert not stop.hear(parse(b"ok"), 17.0)


def test_a_count_below_zero_may_come_without_its_sign() -> None:
    """A 64-bit server prints a negative 32-bit count as an unsigned number.

    The driver restores the sign.
    """
    assert [signed(n) for n in (0, 5, -5, 4294967295, 4294966872)] == [0, 5, -5, -1, -424]


def at(at_s: float, spread_s: float = 0.01) -> Moment:
    return Moment(at_s, at_s - spread_s / 2, at_s + spread_s / 2)


def test_a_count_that_no_wheel_can_make_moves_nothing() -> None:
    """An encoder count that no wheel can reach is ignored.

    So the next count is compared with the last plausible count.
    """
    odometry = MartOdometry(MartSettings())
    odometry.begin(Motion.REFERENCE, 0.0)
    for count, at_s in ((0, 0.1), (50, 0.2), (4_000_000, 0.3), (100, 0.4), (150, 0.5)):
        odometry.counted(count, at(at_s))
    assert odometry.pose.x_m == pytest.approx(150 * 0.0004)


def test_a_count_from_before_the_motion_moves_nothing() -> None:
    """A second motion begins, and then a late encoder count of the first motion arrives.

    The pose does not change.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(0, at(0.5))
    odometry.begin(Motion.REFERENCE, 1.0)
    odometry.counted(1000, at(3.0))
    odometry.stand(4.0)
    odometry.counted(1000, at(4.5))
    odometry.rest()
    way_m = odometry.pose.x_m
    odometry.begin(Motion.REFERENCE, 5.0)
    assert odometry.counted(990, at(5.1, 0.3)) is None
    odometry.counted(1000, at(6.0))
    assert odometry.pose.x_m == way_m


@pytest.mark.parametrize("stale", [300, 0, -1])
def test_a_late_count_of_a_motion_moves_nothing_back(stale: int) -> None:
    """A count that is smaller than an earlier count of the same motion does not change the pose.

    The network has delayed or duplicated such a count.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(0, at(0.5))
    odometry.begin(Motion.REFERENCE, 1.0)
    for count, at_s in ((200, 2.0), (400, 2.5), (stale, 2.6), (500, 2.8)):
        odometry.counted(count, at(at_s, 0.3))
    assert odometry.pose.x_m == pytest.approx(500 * 0.0004)


def test_a_turn_that_was_told_by_another_number_is_told_by_the_wheel() -> None:
    """The reply to a turn gives an angle of 3°, which contradicts the encoder.

    The 3 is an old encoder count and no angle, so the odometry computes the turn from the encoder
    alone.
    """
    odometry = MartOdometry(MartSettings())
    odometry.counted(0, at(0.5))
    odometry.begin(Motion.SPIN, 1.0)
    odometry.counted(400, at(3.0))
    odometry.spin_told(3.0)
    odometry.counted(420, at(4.0))
    odometry.rest()
    assert odometry.pose.yaw_rad == pytest.approx(420 * 0.0004 * 2 / 0.4)


def test_a_first_heading_of_rm_that_is_the_last_one_before_is_not_of_it() -> None:
    """If the first heading after RM (forward drive) equals the last one before RM, it is not used.

    RM sets the server's heading to zero, so an equal heading is a late reply.
    """
    odometry = MartOdometry(MartSettings())
    odometry.turned(-50.0, at(0.5))
    odometry.begin(Motion.REFERENCE, 1.0)
    assert not odometry.turned(-50.0, at(1.5))
    assert not odometry.heading.is_known
    odometry.turned(0.1, at(1.8))
    odometry.turned(10.1, at(2.8))
    assert odometry.heading.turned_rad(2.8, stands=True) == pytest.approx(math.radians(10.0))


@pytest.mark.parametrize("reason", ["could not init", "command not supported"])
def test_a_proof_that_fails_may_do_so_at_once(reason: str) -> None:
    """The driver accepts an early failure of the IMU check, but no early ``ok``.

    A successful check takes some time, but without an IMU, the check fails at once.
    """
    talk = conversation()
    talk.ask(words.RESET.request(), 1.0)
    assert talk.hear(parse(f"fail {reason}".encode()), 1.001) is not None


def test_no_two_commands_have_the_same_text() -> None:
    """The driver compares commands by their texts. So no two commands have the same text."""
    assert len({word.text for word in words.WORDS}) == len(words.WORDS)
