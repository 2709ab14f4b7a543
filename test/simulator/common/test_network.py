# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated network between a host and a simulated board, with its faults."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnibot_driver.simulator.common.network import FaultyNetwork, NetworkFaults, NetworkPath

SENT = [b"%d" % number for number in range(5000)]


def through(path: NetworkPath, every_s: float = 0.01) -> list[bytes]:
    """Send one datagram every ``every_s``, and return what arrives, in order of arrival."""
    arrived = []
    for number, datagram in enumerate(SENT):
        path.send(datagram, number * every_s)
        arrived += path.arrived(number * every_s)
    return arrived + path.arrived(len(SENT) * every_s + 60.0)


def test_a_good_network_hands_over_at_once_and_in_order() -> None:
    """A network without faults delivers each datagram once, without delay and in order."""
    network = FaultyNetwork()
    network.to_board.send(b"hello", 1.0)
    assert network.to_board.arrived(1.0) == [b"hello"]
    assert network.to_board.arrived(9.0) == []
    assert through(network.from_board) == SENT
    assert network.counts == {"lost": 0, "duplicated": 0}


def test_datagrams_are_lost_at_the_given_rate() -> None:
    """With a loss rate of 0.1, one datagram in ten is lost.

    Each direction loses different datagrams.
    """
    network = FaultyNetwork(NetworkFaults(lose=0.1))
    there, back = through(network.to_board), through(network.from_board)
    assert set(there) <= set(SENT)
    assert there != back
    assert len(SENT) - len(there) == network.to_board.lost == pytest.approx(500, rel=0.2)
    assert network.counts["lost"] == 2 * len(SENT) - len(there) - len(back)


def test_datagrams_come_twice_at_the_given_rate() -> None:
    """With a duplicate rate of 0.1, one datagram in ten comes twice.

    If there is no delay, the copy directly follows the original.
    """
    path = NetworkPath(NetworkFaults(duplicate=0.1), "seed")
    arrived = through(path)
    assert len(arrived) - len(SENT) == path.duplicated == pytest.approx(500, rel=0.2)
    assert arrived == sorted(arrived, key=int)


def test_a_delay_is_never_longer_than_given_and_lets_others_overtake() -> None:
    """Datagrams have random delays of up to 50 ms, and may overtake each other.

    With a poll every 10 ms, all arrive within 60 ms.
    """
    path = NetworkPath(NetworkFaults(delay_s=0.05), "seed")
    for number in range(200):
        now_s = number * 0.01
        path.send(b"%d" % number, now_s)
        assert all(now_s - int(datagram) * 0.01 < 0.06 for datagram in path.arrived(now_s))
    arrived = through(NetworkPath(NetworkFaults(delay_s=0.05), "seed"))
    assert sorted(arrived, key=int) == SENT
    assert arrived != SENT


@given(st.integers(0, 5))
def test_equal_seeds_meet_equal_fates(seed: int) -> None:
    """Networks with the same seed have the same faults. Another seed gives other faults."""
    faults = NetworkFaults(lose=0.1, duplicate=0.1, delay_s=0.1)
    first = through(FaultyNetwork(faults, seed).to_board)
    assert first == through(FaultyNetwork(faults, seed).to_board)
    assert first != through(FaultyNetwork(faults, seed + 1).to_board)
