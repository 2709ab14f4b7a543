# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the estimated delay of commands, with clocks that are wrong, drift, or are set."""

from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.transit import (
    HEALS_AFTER_S,
    KNOWN_AFTER,
    LARGEST_DRIFT,
    MOST_SENDERS,
    Arrival,
    Delay,
    Transit,
)

LONGEST_S = 0.5
DAY_NS = 1_700_000_000_000_000_000
HOUR_S = 3600.0
NS = 1_000_000_000


@dataclass
class Sender:
    """A sender on one topic. Its clock is ahead of the true time by ``ahead_s``."""

    ahead_s: float = 0.0
    numbered: bool = True
    sent: int = 0


@dataclass
class Receiver:
    """The part of the driver that receives commands.

    Its time of day is ahead of the true time by ``ahead_s``, but its steady clock is correct.
    """

    ahead_s: float = 0.0
    transit: Transit = field(default_factory=Transit)

    def hear(
        self, sender: Sender, sent_s: float, under_way_s: float = 0.0, waited_s: float = 0.0
    ) -> Delay:
        """Receive a message that was sent at the true time ``sent_s``, and return its delay."""
        sender.sent += 1
        received_s = sent_s + under_way_s
        now_s = received_s + waited_s
        arrival = Arrival(
            sent_ns=DAY_NS + round((sent_s + sender.ahead_s) * NS),
            received_ns=DAY_NS + round((received_s + self.ahead_s) * NS),
            now_ns=DAY_NS + round((now_s + self.ahead_s) * NS),
            steady_ns=round(now_s * NS),
            number=sender.sent if sender.numbered else None,
        )
        return self.transit.delay(arrival, LONGEST_S)


def refused(delay: Delay) -> bool:
    try:
        delay.require("cmd_vel", LONGEST_S)
    except CommandRefused:
        return True
    return False


offsets_s = st.one_of(st.floats(-2.0, 2.0), st.sampled_from([0.0, HOUR_S, -HOUR_S, 1.7e9, -1.7e9]))
in_time_s = st.floats(0.0, LONGEST_S)
pauses_s = st.floats(0.001, 30.0)


@given(offsets_s, offsets_s, st.lists(st.tuples(pauses_s, in_time_s, st.booleans()), min_size=1))
def test_no_command_that_came_in_time_is_refused_however_far_the_clocks_are_apart(
    sender_s: float, receiver_s: float, messages: list[tuple[float, float, bool]]
) -> None:
    """The estimated delay never exceeds the true delay, so a command in time is never refused.

    The delay consists of the time in the network and in the driver's queue.
    """
    receiver, sender, now_s = Receiver(receiver_s), Sender(sender_s), 100.0
    for pause_s, late_s, waits in messages:
        now_s += pause_s
        under_way_s, waited_s = (0.0, late_s) if waits else (late_s, 0.0)
        delay = receiver.hear(sender, now_s, under_way_s, waited_s)
        assert -1e-9 <= delay.waited_s <= delay.total_s + 1e-9
        assert delay.total_s <= late_s + 1e-6


@given(offsets_s, offsets_s, st.booleans(), st.floats(0.6, 100.0), st.floats(0.0, 60.0))
def test_a_command_that_was_under_way_for_longer_is_refused(
    sender_s: float, receiver_s: float, numbered: bool, late_s: float, silent_s: float
) -> None:
    """A late command is refused, even if its sender was silent before it.

    The next command that arrives in time is accepted.
    """
    receiver, sender = Receiver(receiver_s), Sender(sender_s, numbered)
    for number in range(10):
        assert not refused(receiver.hear(sender, 100.0 + 0.1 * number, 0.01))
    sent_s = 101.0 + silent_s
    delay = receiver.hear(sender, sent_s, 0.01 + late_s)
    assert refused(delay)
    drift_s = LARGEST_DRIFT * (silent_s + late_s + 1.0)
    assert late_s - drift_s - 1e-6 <= delay.total_s <= late_s + 0.01 + 1e-6
    assert not refused(receiver.hear(sender, sent_s + late_s + 0.1, 0.02))


@given(st.floats(0.6, 100.0))
def test_a_command_that_waited_in_our_own_queue_is_refused_even_if_it_is_the_first(
    waited_s: float,
) -> None:
    """A command that waits too long in the driver's queue is refused, even a sender's first one."""
    delay = Receiver().hear(Sender(-HOUR_S), 100.0, 0.01, waited_s)
    assert refused(delay)
    assert delay.total_s == pytest.approx(waited_s)


@settings(max_examples=30)
@given(st.sampled_from([1, -1]), st.floats(1.0, 1e6), st.booleans())
def test_a_step_of_our_own_clock_refuses_nothing(sign: int, step_s: float, shared: bool) -> None:
    """The driver's clock is set, alone or with the sender's clock. No command is refused."""
    receiver, sender, now_s = Receiver(), Sender(), 100.0
    for number in range(1000):
        now_s += 0.1
        if number == 500:
            receiver.ahead_s += sign * step_s
            sender.ahead_s += sign * step_s * shared
        assert not refused(receiver.hear(sender, now_s, 0.01))
        if number == 900:
            assert refused(receiver.hear(sender, now_s, 1.0)), (
                "a late command must still be refused"
            )


@settings(max_examples=40)
@given(st.floats(1.0, 1e6), st.floats(0.0, 0.3))
def test_a_sender_whose_clock_is_set_back_is_heard_again_soon(
    step_s: float, jitter_s: float
) -> None:
    """Commands seem late after the sender's clock was set back, but are soon accepted again."""
    receiver, sender, now_s = Receiver(), Sender(), 100.0
    for _ in range(100):
        now_s += 0.1
        receiver.hear(sender, now_s, 0.01)
    sender.ahead_s -= step_s
    stepped_s = now_s
    while refused(receiver.hear(sender, now_s, 0.01 + jitter_s * (round(now_s * 10) % 2))):
        now_s += 0.1
    assert now_s - stepped_s <= HEALS_AFTER_S + 0.2
    for _ in range(100):
        now_s += 0.1
        assert not refused(receiver.hear(sender, now_s, 0.01 + jitter_s))
    assert refused(receiver.hear(sender, now_s, 1.0 + jitter_s))


@given(st.floats(1.0, 1e6))
def test_a_sender_whose_clock_is_set_forward_is_heard_on(step_s: float) -> None:
    """The sender's clock is set forward.

    Its commands are still accepted, and late ones still refused.
    """
    receiver, sender, now_s = Receiver(), Sender(), 100.0
    for number in range(100):
        now_s += 0.1
        if number == 50:
            sender.ahead_s += step_s
        assert not refused(receiver.hear(sender, now_s, 0.01))
    assert refused(receiver.hear(sender, now_s, 1.0))


def test_late_commands_now_and_then_do_not_pass_for_a_clock_that_was_set_back() -> None:
    """Single commands arrive late after a silence, like key presses on a bad network.

    They are refused. The driver does not conclude that the sender's clock was set back.
    """
    receiver, sender = Receiver(), Sender()
    receiver.hear(sender, 100.0, 0.01)
    for number in range(20):
        assert refused(receiver.hear(sender, 110.0 + 10.0 * number, 2.0))


def test_a_burst_of_what_an_outage_had_kept_is_refused_as_far_as_it_is_old() -> None:
    """After an outage of the network, all commands of the outage arrive at once.

    Only the old ones are refused.
    """
    receiver, sender = Receiver(), Sender()
    for number in range(50):
        receiver.hear(sender, 100.0 + 0.1 * number, 0.01)
    outage = [receiver.hear(sender, 105.0 + 0.1 * n, 4.0 - 0.1 * n) for n in range(40)]
    assert [refused(delay) for delay in outage] == 35 * [True] + 5 * [False]


@settings(max_examples=30)
@given(offsets_s, offsets_s, st.lists(st.integers(0, 1), min_size=50, max_size=100))
def test_two_senders_with_clocks_of_their_own_are_both_heard(
    one_s: float, other_s: float, turns: list[int]
) -> None:
    """Two senders have clocks that differ by hours. The driver accepts the commands of both."""
    receiver, senders, now_s = Receiver(), (Sender(one_s, sent=1000), Sender(other_s)), 100.0
    for sender in senders:
        receiver.hear(sender, now_s, 0.01)
    for turn in turns:
        now_s += 0.05
        assert not refused(receiver.hear(senders[turn], now_s, 0.01))


def test_a_late_command_does_not_pass_for_that_of_another_sender() -> None:
    """A late command is refused, even if another sender on the same host sends in time."""
    receiver, old, new = Receiver(), Sender(sent=1000), Sender()
    for number in range(20):
        receiver.hear(old, 100.0 + 0.1 * number, 0.01)
        receiver.hear(new, 100.05 + 0.1 * number, 0.01)
    receiver.hear(old, 102.05, 0.01)
    assert refused(receiver.hear(old, 110.0, 1.0))
    assert refused(receiver.hear(new, 112.0, 1.0))


@given(st.floats(1.0, 1000.0), st.floats(-1e-4, 1e-4), st.floats(1.2, 10.0))
def test_late_commands_of_two_senders_are_refused_after_one_of_them_was_silent(
    silent_s: float, drift: float, late_s: float
) -> None:
    """One of two senders on a host is silent while the host's clock drifts.

    After the silence, each sender sends a late command. The driver refuses these commands.
    """
    receiver, silent, busy = Receiver(), Sender(), Sender(sent=1000)
    receiver.hear(busy, 99.0, 0.01)
    for number in range(20):
        receiver.hear(silent, 100.0 + 0.1 * number, 0.01)
    silent.ahead_s = busy.ahead_s = drift * silent_s
    for number in range(20):
        assert not refused(receiver.hear(busy, 102.0 + silent_s + 0.1 * number, 0.01))
    assert refused(receiver.hear(busy, 104.0 + silent_s, late_s))
    assert refused(receiver.hear(silent, 104.05 + silent_s, late_s))
    assert not refused(receiver.hear(silent, 104.1 + silent_s + late_s, 0.01))
    assert not refused(receiver.hear(busy, 104.15 + silent_s + late_s, 0.01))


def test_each_command_of_a_sender_that_sends_one_is_heard() -> None:
    """The driver accepts the only command of a sender, such as ``ros2 topic pub --once``.

    This also applies if the sender's clock is behind.
    """
    receiver = Receiver()
    for number in range(20):
        assert not refused(receiver.hear(Sender(), 100.0 + number, 0.01))
        assert not refused(receiver.hear(Sender(-3.0), 100.5 + number, 0.01))
    assert len(receiver.transit._senders) <= MOST_SENDERS


@given(st.floats(-1e-4, 1e-4))
def test_clocks_that_drift_are_followed(drift: float) -> None:
    """No command is refused while the clocks drift for ten hours. Some silences last an hour."""
    receiver, sender, now_s = Receiver(), Sender(), 100.0
    for number in range(200):
        now_s += HOUR_S if number % 20 == 0 else 0.1
        sender.ahead_s = drift * now_s
        assert not refused(receiver.hear(sender, now_s, 0.01 + 0.1 * (number % 3)))


def test_an_old_command_is_refused_after_a_night_without_commands() -> None:
    """A command that was sent 5 s ago is refused, even after eight hours without a command."""
    receiver, sender = Receiver(), Sender()
    for number in range(20):
        receiver.hear(sender, 100.0 + 0.1 * number, 0.01)
    assert refused(receiver.hear(sender, 100.0 + 8 * HOUR_S, 5.0))


def test_a_refusal_says_how_old_the_command_is_and_where_to_look() -> None:
    """A refusal says how old the command is, and whether to check the network or this computer."""
    with pytest.raises(CommandRefused, match=r"^cmd_vel refused: it was sent 1\.2 s ago.*network"):
        Delay(1.2, 0.1).require("cmd_vel", 0.5)
    with pytest.raises(CommandRefused, match=r"waited 1\.1 s in this driver's queue.* load"):
        Delay(1.2, 1.1).require("cmd_vel", 0.5)
    Delay(0.5, 0.5).require("cmd_vel", 0.5)


def test_what_came_sooner_than_all_before_it_may_have_been_sent_sooner_than_it_seems() -> None:
    """A new sender's first message takes 0.5 s. The driver assumes that this message took no time.

    So the driver's estimate of the next sending time is 0.5 s too late. The driver also returns the
    time by the sender's clock, which is right.
    """
    receiver, sender = Receiver(), Sender()
    receiver.hear(sender, 100.0, 0.5)
    seems_ns, says_ns = receiver.hear(sender, 101.0, 0.7).sent_ns
    assert seems_ns == pytest.approx(DAY_NS + 101.5 * NS, abs=1e6)
    assert says_ns == DAY_NS + 101 * NS


def test_of_a_sender_that_is_known_its_clock_alone_tells_nothing() -> None:
    """The sender's clock is an hour behind. After ten messages, the driver knows this difference.

    The driver then returns one sending time, by its own clock. This time is right.
    """
    receiver, sender = Receiver(), Sender(-HOUR_S)
    for number in range(KNOWN_AFTER):
        delay = receiver.hear(sender, 100.0 + number, 0.01)
    assert delay.sent_ns == (pytest.approx(DAY_NS + (109.01) * NS, abs=1e7),)
