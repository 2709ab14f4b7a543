# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Ports that are open but accept no data: stuck adapters, full buffers, half-open sockets."""

from collections.abc import Callable
from functools import partial
from typing import Final

from breakable_line import cut
from other_rigs import NetworkRig
from rig import TIMEOUT_S, Rig
from std_srvs.srv import SetBool

TAKES_NOTHING: Final = "(lost .* while writing|is missing): it has not accepted all data"
LOST: Final = "lost .*retrying"


def stuck(seconds: float, rig: Rig, *, mute: bool = False) -> None:
    """Let the adapter hold back all bytes to the board until 1 s after the last command.

    When the adapter delivers the bytes, the robot must be at rest.

    ``seconds``: time in s for which commands continue while the adapter holds bytes.

    ``mute``: whether the driver gets no data from the board until the delivery.
    """
    rig.drive()
    rig.terminal.deaf = True
    if mute:
        rig.line.from_board = cut
    rig.wait_ticks(round(seconds * 100))
    rig.hand.leave()
    rig.wait_ticks(100)
    rig.heal()
    rig.expect_still(rig.line.tick, "the adapter takes bytes again", 0.0)


def full(rig: Rig, *, mute: bool = False) -> None:
    """Fill the port with old commands.

    When the port accepts data again, the robot must come to rest.

    ``mute``: whether the driver receives no data from the board while the port is full.
    """
    rig.drive()
    mark = len(rig.driver.lines)
    with rig.terminal.full(rig.kind.old_command):
        if mute:
            rig.line.from_board = cut
        rig.driver.wait_for_line(TAKES_NOTHING, mark)
        rig.hand.leave()
    rig.heal()
    rig.expect_still(rig.line.tick, "the full port takes bytes again", rig.kind.old_bytes_s)
    rig.expect_said_once(TAKES_NOTHING, mark)


def full_for_long(rig: Rig) -> None:
    """Keep the port full until the driver has closed and opened it again more than once.

    The driver must report the full port only once. When the port accepts data again, the robot must
    come to rest.
    """
    rig.drive()
    states, mark = len(rig.states), len(rig.driver.lines)
    with rig.terminal.kept_full(rig.kind.old_command):
        rig.probe.wait_for(lambda: len(rig.states) >= states + 6)  # opened twice without success
        rig.wait_for_diagnosis("not accepted all data")
        rig.hand.leave()
    rig.probe.wait_for_state("nominal")
    rig.expect_still(rig.line.tick, "the port takes bytes again, and is open", TIMEOUT_S)
    rig.expect_said_once(TAKES_NOTHING, mark)


def estop_into_a_full_port(rig: Rig) -> None:
    """Latch the e-stop while the port accepts no data. The driver's reply must contain a warning.

    When the port accepts data again, the e-stop must come before any new motion command.
    """
    rig.drive()
    rig.hand.leave()
    rig.expect_still(rig.line.tick, "no command")
    rig.wait_ticks(100)  # the line is quiet
    with rig.terminal.kept_full(rig.kind.old_command):
        answer = rig.probe.call(SetBool, "estop", data=True)
        late = any(why in answer.message for why in ("not accepting data", "not open"))
        rig.findings.expect(late, f"it said {answer.message!r}")
        obeyed = len(rig.line.board.commands)
    assert rig.wait_for_board(
        lambda line: any(each.kind == "estop" for each in list(line.board.commands)[obeyed:])
    ), "no e-stop arrived"
    rig.expect_still(rig.line.tick, "the e-stop has arrived", 0.0)
    kinds = [command.kind for command in list(rig.line.board.commands)[obeyed:]]
    ours = kinds[next(n for n, kind in enumerate(kinds) if kind not in ("velocity", "reset")) :]
    before = set(ours[: ours.index("estop")])
    rig.findings.expect("wheels" in before <= {"wheels", "start"}, f"it obeyed {ours[:5]}")
    rig.probe.call(SetBool, "estop", data=False)


TERMINAL: Final[dict[str, Callable[[Rig], None]]] = {
    "an adapter that accepts no data for 3 s": partial(stuck, 2.0),
    "an adapter that transfers nothing for 3 s": partial(stuck, 2.0, mute=True),
    "the kernel's buffer is full": full,
    "the kernel's buffer is full, and the board is silent": partial(full, mute=True),
    "the kernel's buffer stays full, with one warning": full_for_long,
    "e-stop into a full port": estop_into_a_full_port,
}

# Over the network


def server_holds(rig: NetworkRig, *, mute: bool) -> None:
    """Let the serial-port server hold the driver's data for 3 s, then deliver all of it at once.

    ``mute``: whether the server also holds back the board's data.
    """
    rig.drive()
    rig.server.deaf, rig.server.mute = True, mute
    rig.wait_ticks(200)
    rig.hand.leave()
    rig.wait_ticks(100)
    rig.server.deaf = rig.server.mute = False
    rig.expect_still(rig.line.tick, "the server forwards again", 0.0)


def server_closes_one_direction(rig: NetworkRig) -> None:
    """The server closes one direction of the connection: from the board to the driver.

    The driver must notice this, and send Stop in the other direction, which is still open.
    """
    rig.drive()
    since, mark = rig.line.tick, len(rig.driver.lines)
    rig.server.close_from_here()
    rig.hand.leave()
    rig.expect_still(since, "closed in one direction", rig.kind.deaf_s)
    rig.driver.wait_for_line(LOST, mark)
    rig.probe.wait_for_state("nominal")
    rig.expect_said_once(LOST, mark)


def server_dies(rig: NetworkRig) -> None:
    """Close the server for a while, so that it refuses connections.

    The robot must be at rest when the driver has connected again.
    """
    rig.drive()
    mark = len(rig.driver.lines)
    rig.unplug()
    rig.hand.leave()
    rig.wait_for_diagnosis("Connection refused")
    rig.plug()
    _expect_still_once_connected(rig, 0, "the server is there again")
    rig.expect_said_once("Connection refused.*retrying", mark)


def server_vanishes(rig: NetworkRig) -> None:
    """Cut the network without closing the connection. Later, restore it for new connections.

    The robot must be at rest when the driver has connected again.
    """
    rig.drive()
    before = len(rig.server.accepted_at)
    rig.server.vanish()
    rig.hand.leave()
    rig.probe.wait_for_state("connecting")
    rig.wait_for_diagnosis("no (valid )?data")
    rig.probe.wait_for_state("disconnected")
    rig.server.come_back()
    _expect_still_once_connected(rig, before, "the server is back")


def _expect_still_once_connected(rig: NetworkRig, before: int, what: str) -> None:
    assert rig.wait_for_board(lambda _: len(rig.server.accepted_at) > before), rig.driver.output
    rig.expect_still(rig.server.accepted_at[before], what, 0.0)


NETWORK: Final[dict[str, Callable[[NetworkRig], None]]] = {
    "socket: the server delays the data to the board": partial(server_holds, mute=False),
    "socket: the server delays all data": partial(server_holds, mute=True),
    "socket: closed in one direction": server_closes_one_direction,
    "socket: the server ends and is started again": server_dies,
    "socket: the peer vanishes without closing the connection": server_vanishes,
}
