# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of a link whose port accepts no data for a while.

When the port accepts data again, Stop is written to it before anything else.
"""

import os
import threading

import pytest
from listener import (
    EMERGENCY_STOP,
    LAST_WORDS,
    PATIENCE_S,
    START,
    STOP,
    Listener,
    link_to,
    session,
    wait_for_the_end_of,
)
from terminal import Terminal

from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.packets import joined
from omnibot_driver.core.session import Session
from omnibot_driver.keeper import Keeper
from omnibot_driver.link import Link
from omnibot_driver.transports import Transport

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def test_after_a_failed_write_the_opening_sequence_comes_before_anything_else(
    terminal: Terminal,
) -> None:
    """After a failed write, the link writes Stop, then its opening sequence, before anything else.

    The board may have received only a part of a command.
    """
    listener = Listener()
    link = link_to(terminal.path, listener, session())
    link.start()
    terminal.read_until(STOP + START)
    terminal.fill()
    listener.wait_for(lambda: any("while writing" in str(text) for text in listener.reports))
    heard = terminal.read_until(2 * STOP + START)
    link.close("stop")
    last = heard.rpartition(b"x")[2]
    assert last.startswith(2 * STOP)
    # On a busy computer, the guard may also have written Stop.
    assert last.replace(STOP, b"").startswith(START)


def at_rest(terminal: Terminal) -> tuple[Link, Session]:
    """Return a link and its session.

    The link has opened the port of ``terminal``, and has nothing to write.
    """
    ours = session(run=False)
    link = link_to(terminal.path, Listener(), ours)
    link.start()
    terminal.read_until(STOP)
    return link, ours


def test_a_full_port_leaves_the_last_stop_to_the_guard(terminal: Terminal) -> None:
    """The port is full while the link closes. The link does not wait for the port.

    When the port accepts data again, the guard process writes Stop.
    """
    link, _ours = at_rest(terminal)
    terminal.fill()
    assert not link.close("stop")
    terminal.read_until(5 * joined(LAST_WORDS[0]))
    wait_for_the_end_of("omnibot-reader", "omnibot-pacer")


@pytest.mark.parametrize("full", [False, True])
def test_the_guard_keeps_the_last_packets_only_if_the_port_accepted_them(
    full: bool, terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A link ends without a proof of rest. If the port is full, the guard discards the old data.

    Otherwise, the port has accepted the link's last packets, and the guard keeps these packets.
    """
    ends: list[dict[str, bool]] = []
    end = Keeper.end

    def record(keeper: Keeper, **how: bool) -> None:
        ends.append(how)
        end(keeper, **how)

    monkeypatch.setattr(Keeper, "end", record)
    link, _ours = at_rest(terminal)
    if full:
        terminal.fill()
    link.close("stop")
    wait_for_the_end_of("omnibot-reader", "omnibot-pacer")
    assert ends[0] == {"stopped": False, "written": not full}  # a full port is opened again


def test_an_estop_that_a_full_port_does_not_take_is_known_to_be_late(terminal: Terminal) -> None:
    """The port is full when the e-stop is latched. The link reports that its output is blocked.

    When the port accepts data again, the link writes the e-stop first.
    """
    link, _ours = at_rest(terminal)
    reader, may_open = link._reader, threading.Event()
    opener = reader._open

    def open_later() -> Transport:
        assert may_open.wait(PATIENCE_S)
        return opener()

    reader._open = open_later
    assert not link.blocked
    terminal.fill()
    link.call(lambda session, now: session.estop(True, now))
    assert link.blocked
    may_open.set()
    terminal.read_until(STOP + EMERGENCY_STOP)
    link.close("stop")


def test_a_defect_while_the_port_is_full_leaves_the_stop_to_the_guard(terminal: Terminal) -> None:
    """A defect ends the driver while its port is full.

    The guard process sends Stop as soon as the port accepts data again.
    """
    link, ours = at_rest(terminal)
    terminal.fill()
    closed, session_closed = ours.closed, threading.Event()

    def defective(data: bytes, now: float) -> list[ImuEstimate]:
        raise RuntimeError("a defect")

    def tell_and_close(now: float) -> None:
        session_closed.set()
        closed(now)

    ours.inbound.hear, ours.closed = defective, tell_and_close  # type: ignore[method-assign]
    os.write(terminal.far, b"x")
    assert session_closed.wait(PATIENCE_S)
    terminal.read_until(5 * joined(LAST_WORDS[0]))
    link.close("stop")
    wait_for_the_end_of("omnibot-reader", "omnibot-pacer")
