# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A search through all worlds that ``mart_model`` can reach, for one that must not occur.

A world is one state of server, driver and network.

``PYTHONPATH=.:test:test/core python test/core/mart/mart_model_search.py 3``: the argument is the
largest number of late copies.

Results: docs/internals/mart_searches.md.
"""

import argparse
import time
from functools import cache
from typing import Final, NamedTuple

import mart_model as model
from mart_model import UNANSWERED, Rules, World, sweeps_first, table
from mart_model_server import SAID, Server, execute

from omnibot_driver.core.mart.states import HALTS, LAST_HALTS, Motion, State


def trouble(world: World) -> str:
    """Return what is wrong with the server or the robot, or an empty text if nothing is wrong.

    If the IMU is dead, or the driver has given the server up, only a crash is wrong.
    """
    server, driver = world.server, world.driver
    if server.crashed:
        return "the server has crashed"
    asks = driver.state is State.ASKING or sweeps_first(driver)
    given_up = driver.state is State.LOST or (driver.unanswered > UNANSWERED and not asks)
    if not server.imu or given_up:
        return ""
    if server.port == "hung":
        return "the command port hangs"
    # Until the driver knows which motion is in progress, the states below are allowed.
    if asks:
        return ""
    if server.released:
        return "a motion is released by the stop port, and the next stop will hang"
    if server.manual and not driver.underway:
        return "the server refuses motions, and the driver does not know it"
    if server.moving and not _can_stop(world):
        return "nothing stops the robot"
    return ""


def _can_stop(world: World) -> bool:
    """Return whether the robot would stop if all further stops of the driver arrived."""
    server, driver = world.server, world.driver
    if driver.state is State.STILL:
        motion = Motion.UNKNOWN
        words = HALTS[motion] if server.port == "free" else LAST_HALTS[motion]
        if server.port != "free" and not driver.moved:
            return False
    elif driver.state is State.CHECKING:
        return _can_stop(world._replace(driver=driver._replace(state=State.STILL)))
    else:
        words = HALTS[driver.motion]
        if driver.motion is Motion.UNKNOWN and server.port != "free":
            words = LAST_HALTS[driver.motion]
    for word in words:
        server, _ = execute(server, word.text)
    if server.moving and server.port == "free":  # a poll shows the motion, so all stops are sent
        for word in HALTS[Motion.UNKNOWN]:
            server, _ = execute(server, word.text)
    return not server.moving and server.port != "hung"


class Found(NamedTuple):
    """The result of a search.

    * ``worlds``: number of reachable states of server, driver and network.
    * ``steps``: number of steps between these states.
    * ``bad``: steps to the first forbidden state, then what is wrong in it; empty if none was
      found.
    """

    worlds: int
    steps: int
    bad: tuple[str, ...]


FOUND_MOVING: Final = (
    Server(),
    *(Server(motion, True) for motion in (Motion.REFERENCE, Motion.REVERSE, Motion.SPIN)),
    *(Server(motion, True, "busy") for motion in (Motion.STRAIGHT, Motion.TURN)),
)
"""The states in which a restarted driver may find the server."""


def search(rules: Rules = table, most: int = 3_000_000) -> Found:
    """Search the reachable worlds, breadth first. Stop at the first world that must not occur."""

    @cache
    def allowed(state: State, motion: Motion) -> tuple[str, ...]:
        return tuple(word for word in SAID if rules(state, word, motion))

    row = [World(server) for server in FOUND_MOVING]
    came: dict[World, tuple[World, str] | None] = dict.fromkeys(row)
    count = 0
    while row:
        following = []
        for world in row:
            for what, after in model.steps(world, allowed):
                count += 1
                if after in came:
                    continue
                came[after] = (world, what)
                if why := trouble(after):
                    return Found(len(came), count, (*_way(after, came), why))
                following.append(after)
        row = following
        if len(came) > most:
            raise AssertionError(f"more than {most} worlds")
    return Found(len(came), count, ())


def _way(world: World, came: dict[World, tuple[World, str] | None]) -> list[str]:
    way = []
    before = came[world]
    while before is not None:
        world, what = before
        way.append(what)
        before = came[world]
    return way[::-1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "copies",
        nargs="?",
        type=int,
        default=model.MOST_COPIES,
        help="largest number of late copies",
    )
    model.MOST_COPIES = parser.parse_args().copies  # type: ignore[misc]
    began_s = time.monotonic()
    result = search()
    print(f"{result.worlds} worlds, {result.steps} steps, {time.monotonic() - began_s:.1f} s")
    print("\n".join(result.bad) or "no trouble can be reached")
