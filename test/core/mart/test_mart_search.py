# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests that no sequence of commands, losses, copies and delays makes a MART fail.

A MART fails if its server hangs, or if nothing can stop the robot.
"""

from collections.abc import Callable
from typing import Final

import mart_model as model
import pytest
from mart_model import World
from mart_model_search import search
from mart_model_server import SAID, Server, execute, servers

from omnibot_driver.core.mart.states import Motion, State
from omnibot_driver.simulator.mart import FIRMWARE, Kind, MartServer, MartSettings

pytestmark = pytest.mark.slow

SETTLES_S: Final = 0.9
"""Longest time in s from a request to its reply. Only controlled moves are answered later."""
ON_THE_WIRE: Final = {
    "RM": b"RM 30",
    "TF": b"TF 200",
    "MCR": b"MCR 350",
    "CHECK": b"RST IMU",
    "B": b"B SLOW",
    "R": b"R SLOW",
    "L": b"L SLOW",
    "MCS": b"MCS 128 128",
}
KINDS: Final = {
    None: Motion.NONE,
    Kind.REFERENCE: Motion.REFERENCE,
    Kind.LINEAR: Motion.REVERSE,
    Kind.SPIN: Motion.SPIN,
    Kind.CONTROLLED_LINEAR: Motion.STRAIGHT,
    Kind.CONTROLLED_SPIN: Motion.TURN,
}


def test_no_reachable_world_hangs_the_server_or_leaves_it_moving() -> None:
    """The server never crashes or hangs, and the robot can always be stopped.

    Up to two copies and one reply come late, and the IMU may die. If the IMU is dead, or the driver
    has given up the server, only a crash of the server is forbidden.
    """
    found = search()
    assert found.bad == ()
    assert found.worlds > 10_000


TRAPS: Final[dict[str, tuple[Callable[[State, str, Motion], bool], str]]] = {
    "SL before SM": (
        lambda state, word, motion: word == "SL" and state is State.REVERSING,
        "the next stop will hang",
    ),
    "SS during RM": (
        lambda state, word, motion: word == "SS" and state is State.DRIVING,
        "the next stop will hang",
    ),
    "L during RM": (
        lambda state, word, motion: word == "L" and state is State.DRIVING,
        "the command port hangs",
    ),
}


@pytest.mark.parametrize("trap", TRAPS)
def test_a_planted_trap_is_found(trap: str) -> None:
    """A harmful command is added to the model's table of the commands that the driver may send.

    The search finds the failure that this command causes.
    """
    more, trouble = TRAPS[trap]
    found = search(lambda *asked: model.table(*asked) or more(*asked))
    assert trouble in found.bad[-1]
    assert any(step.startswith(trap.split()[0]) for step in found.bad)


def test_a_driver_that_does_not_wait_for_late_copies_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The test changes the model: the modelled driver does not wait for late copies of commands.

    The search finds a copy that does harm.
    """
    monkeypatch.setattr(model, "HARMFUL_LATE", frozenset())
    assert search().bad


def test_a_driver_that_sweeps_again_behind_the_stop_port_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A modelled driver that sends the stop SRM directly after SL (stop port) hangs the server.

    The search finds this failure. The real driver first queries whether a motion continues.
    """

    def sweeps(world: World) -> model.Step:
        return "sweeps", world._replace(driver=model.Driver(State.STOPPING))

    monkeypatch.setattr(model, "_asked", sweeps)
    assert "hang" in search().bad[-1]


class Desk:
    """The simulated firmware for a comparison with the model. No datagram to it is lost."""

    def __init__(self) -> None:
        self.server = MartServer(MartSettings(quirks=FIRMWARE))
        self.now_s = 1.0

    def do(self, what: str) -> None:
        if what == "the IMU dies":
            self.server.imu.alive = False
        else:
            port = int(what in ("SL", "SS"))
            data = ON_THE_WIRE.get(what, what.encode())
            self.server.receive(data, port, None, self.now_s)
        self.now_s += SETTLES_S
        self.server.advance(self.now_s)

    @property
    def seen(self) -> Server:
        server = self.server
        port = "hung" if server.hung or server.blocked else "busy" if server.busy else "free"
        motion = KINDS[server.motion]
        moving = server.moving
        released = motion is not Motion.NONE and port == "free" and not moving
        return Server(
            motion,
            moving,
            port,
            released,
            server.imu.alive,
            bool(server.crashed),
            server.manual,
        )


def compared(server: Server) -> Server:
    """Return the state of the server with only what the test can compare.

    If the command port waits or hangs, the result always has a hung port, no motion, and
    ``released`` False.
    """
    if server.port in ("waits", "hung"):
        return server._replace(port="hung", motion=Motion.NONE, released=False)
    return server


@pytest.mark.parametrize("word", [*SAID, "the IMU dies"])
def test_the_simulated_firmware_does_what_the_model_does(word: str) -> None:
    """The model of the server agrees with the simulated firmware if the server answers.

    These cases are not compared:

    * Busy server: commands other than SL and SS.
    * After a stop by the stop port (``released``): ``L``.
    """
    for server, way in servers().items():
        if server.port in ("hung", "waits") or (server.released and word == "L"):
            continue
        if server.port == "busy" and word not in ("SL", "SS"):
            continue
        if word == "the IMU dies":
            expected = server._replace(imu=False)
        else:
            expected, _ = execute(server, word)
        desk = Desk()
        for what in (*way, word):
            desk.do(what)
        assert compared(desk.seen) == compared(expected), (way, word)
