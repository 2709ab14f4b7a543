# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A small model of the MART server, and of any driver that keeps to the tables of ``states``.

The driver says whatever the tables allow, in any order, so it does more than the real one ever
does. Each datagram may arrive, be lost, be late, or come twice; the IMU may die at any step. All
states that can be reached are searched, so there is no limit to the number of wishes. Time is
abstract: a late copy is on its way until it arrives, or is lost, or the network delay has passed,
and what waits for that delay can be said only when no such copy is left.
"""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from omnibot_driver.core.mart.states import (
    HALTS,
    HARMFUL_LATE,
    LAST_HALTS,
    NEEDS_IMU,
    STARTS,
    WHILE,
    Motion,
    State,
    may_say,
)
from omnibot_driver.core.mart.words import WORDS, Kind

BY_TEXT: Final = {("CHECK" if word.kind is Kind.CHECK else word.text): word for word in WORDS}
START_WORDS: Final = ("RM", "B", "R", "L", "TF", "MCR")
"""TB is like TF, and MCL like MCR, in all that is modelled."""
SAID: Final = (*START_WORDS, "CHECK", "SRM", "SM", "SL", "SS")
COPIED: Final = frozenset(SAID)
"""Of these a copy may come late; one of any other changes nothing here."""
MOVES: Final = ("TF", "MCR")
MOST_COPIES: Final = 2
UNANSWERED: Final = 3
"""Stops without an answer, before the stop port is used as the last resort."""
KIND: Final = {
    "RM": Motion.REFERENCE,
    "B": Motion.REVERSE,
    "R": Motion.SPIN,
    "L": Motion.SPIN,
    "TF": Motion.STRAIGHT,
    "MCR": Motion.TURN,
}


class Server(NamedTuple):
    """``port``: free, busy (a move runs), waits (for the IMU), hung. ``released``: the stop port
    has stopped an uncontrolled motion, which the server still believes in.
    """

    motion: Motion = Motion.NONE
    moving: bool = False
    port: str = "free"
    released: bool = False
    imu: bool = True
    crashed: bool = False


class Driver(NamedTuple):
    """``proved``: the IMU was, just now. ``pending``: what is to be answered. ``unanswered``: the
    number of stops.

    ``moved``: the last motion that was begun was a controlled move; ``counted``: the encoder was
    answered since the robot stands, and since no harmful copy can come any more.
    """

    state: State = State.UNKNOWN
    motion: Motion = Motion.UNKNOWN
    proved: bool = False
    pending: str = ""
    unanswered: int = 0
    moved: bool = False
    counted: bool = False


class World(NamedTuple):
    """``copies``: commands on their way; ``replies``: those on theirs."""

    server: Server = Server()
    driver: Driver = Driver()
    copies: tuple[str, ...] = ()
    replies: tuple[str, ...] = ()


Reply = str | None
Rules = Callable[[State, str, Motion], bool]
Step = tuple[str, World]


def execute(server: Server, word: str) -> tuple[Server, Reply]:
    """One datagram arrives, on either port; what the server then is, and answers."""
    if server.crashed:
        return server, None
    if word in ("SL", "SS"):
        return _stop_port(server, word)
    if server.port != "free":
        return server, None  # it waits in the queue, and is another late copy in effect
    motion = server.motion
    if word == "CHECK":
        if motion is not Motion.NONE:
            return server, "conflict"
        return server, "ok" if server.imu else "imu lost"
    if word in START_WORDS:
        return _start(server, word)
    stops = {"SRM": (Motion.REFERENCE,), "SM": (Motion.REVERSE, Motion.SPIN)}.get(word)
    if stops is None:
        return server, "ok"
    if motion not in stops:
        return server, "no motion"
    if server.released and motion is not Motion.SPIN:
        return server._replace(port="hung", moving=False), None
    if not server.imu and not server.released:
        return server._replace(port="hung", moving=False), None
    return Server(imu=server.imu), "ok"


def _start(server: Server, word: str) -> tuple[Server, Reply]:
    motion = server.motion
    if motion is Motion.REFERENCE and word == "L":
        return server._replace(port="hung", moving=True), None
    if motion is not Motion.NONE:
        return server, "conflict"
    kind = KIND[word]
    if server.imu:
        port = "busy" if word in ("TF", "MCR") else "free"
        return server._replace(
            motion=kind, moving=True, port=port
        ), None if port == "busy" else "ok"
    if word == "MCR":
        return server, "imu lost"
    if word in ("TF", "B"):
        return server._replace(motion=kind, port="waits"), None
    return server._replace(motion=kind, moving=True, port="waits"), None


def _stop_port(server: Server, word: str) -> tuple[Server, Reply]:
    motion = server.motion
    if server.port == "waits":
        return server, None
    if motion is Motion.STRAIGHT and word == "SL":
        return Server(imu=server.imu), "ok"
    if motion is Motion.TURN and word == "SS":
        return Server(imu=server.imu), "ok"
    if motion in (Motion.REFERENCE, Motion.REVERSE) or (motion is Motion.SPIN and word == "SS"):
        return server._replace(moving=False, released=True), None
    return server, None


# The driver


def allowed(world: World, word: str, rules: Rules) -> bool:
    """Whether the tables, and the rules about time, let the driver say it now."""
    driver = world.driver
    row = BY_TEXT[word]
    if not rules(driver.state, word, driver.motion):
        return False
    if (row in STARTS or row.kind is Kind.CHECK) and any(
        BY_TEXT[copy] in HARMFUL_LATE for copy in world.copies
    ):
        return False
    unproved = not driver.counted or (row in NEEDS_IMU and not driver.proved)
    if row in STARTS and driver.state is State.STILL and unproved:
        return False
    if word in ("SL", "SS") and driver.state is State.STILL:
        return driver.moved
    if driver.state is State.STOPPING and word not in {row.text for row in HALTS[driver.motion]}:
        return driver.unanswered >= UNANSWERED
    return True


def table(state: State, word: str, motion: Motion) -> bool:
    """The rules of the real driver."""
    return may_say(state, BY_TEXT[word], motion)


def steps(world: World, rules: Rules = table) -> Iterator[Step]:
    """All that may happen next."""
    server, driver = world.server, world.driver
    if server.imu:
        yield "the IMU dies", world._replace(server=server._replace(imu=False))
    if server.port == "busy":
        yield from _ends(world)
    for copy in set(world.copies):
        copies = list(world.copies)
        copies.remove(copy)
        without = world._replace(copies=tuple(copies))
        yield f"late {copy} is lost", without
        if server.port == "free" or copy in ("SL", "SS"):
            after, reply = execute(server, copy)
            yield from _replied(f"late {copy}", without._replace(server=after), reply)
    for reply in set(world.replies):
        replies = list(world.replies)
        replies.remove(reply)
        yield from _heard(
            f"late reply {reply}", world._replace(replies=tuple(replies)), reply, True
        )
    if driver.proved:
        yield "the proof grows old", world._replace(driver=driver._replace(proved=False))
    yield from _waits(world)
    for word in SAID:
        if allowed(world, word, rules):
            yield from _said(word, world)


def _ends(world: World) -> Iterator[Step]:
    """A controlled move is over. It took longer than a copy of it can be late, so a copy has been
    lost, or is in the queue, and begins at once.
    """
    what = f"{world.server.motion.value} ends"
    over = Server(imu=world.server.imu)
    again = [copy for copy in world.copies if copy in MOVES]
    copies = tuple(copy for copy in world.copies if copy not in MOVES)
    yield from _replied(what, world._replace(server=over, copies=copies), "ok")
    if again:
        server, reply = execute(over, again[0])
        after = world._replace(server=server, copies=copies)
        yield from _replied(f"{what}, and its copy begins", after, reply or "ok")


def _waits(world: World) -> Iterator[Step]:
    """What the driver does of itself: a wish to stop, patience that ends, a poll."""
    server, driver = world.server, world.driver
    state = driver.state
    if state in (State.STARTING, State.DRIVING, State.REVERSING, State.TURNING, State.MOVING):
        yield "stop", world._replace(driver=driver._replace(state=State.STOPPING, unanswered=0))
    if state is State.UNKNOWN:
        yield "opens", world._replace(driver=driver._replace(state=State.STOPPING))
    if state is State.CHECKING:
        yield "no reply", world._replace(driver=driver._replace(state=State.STILL, pending=""))
    if state is State.STILL and server.port == "free" and server.moving:
        stray = Driver(State.STOPPING, Motion.UNKNOWN, moved=driver.moved)
        yield "a poll sees it move", world._replace(driver=stray)
    late = any(BY_TEXT[copy] in HARMFUL_LATE for copy in world.copies)
    if state is State.STILL and server.port == "free" and not server.moving and not late:
        yield "a poll is answered", world._replace(driver=driver._replace(counted=True))
    if (
        state is State.STOPPING
        and server.port == "free"
        and driver.motion
        in (
            Motion.STRAIGHT,
            Motion.TURN,
        )
    ):
        yield "it tells its name", world._replace(driver=_rests(driver))


def _said(word: str, world: World) -> Iterator[Step]:
    """Said, and the fates of the datagram."""
    driver = world.driver
    row = BY_TEXT[word]
    if row in STARTS:
        state = State.MOVING if row.kind is Kind.MOVE else State.STARTING
        driver = Driver(state, STARTS[row], pending=word, moved=row.kind is Kind.MOVE)
    elif word == "CHECK":
        driver = driver._replace(state=State.CHECKING, pending=word, proved=False)
    elif driver.state is State.STOPPING:
        if driver.unanswered > UNANSWERED:
            driver = driver._replace(state=State.LOST)
        else:
            driver = driver._replace(unanswered=driver.unanswered + 1)
    said = world._replace(driver=driver)
    yield f"{word} is lost", said
    room = word in COPIED and len(world.copies) < MOST_COPIES
    copied = said._replace(copies=tuple(sorted((*world.copies, word)))) if room else None
    if copied is not None:
        yield f"{word} is late", copied
    if world.server.port != "free" and word not in ("SL", "SS"):
        return
    for what, before in ((word, said), (f"{word}, and a copy later", copied)):
        if before is None:
            continue
        after, reply = execute(before.server, word)
        yield from _replied(what, before._replace(server=after), reply)


def _replied(what: str, world: World, reply: Reply) -> Iterator[Step]:
    """The fates of a reply."""
    if reply is None:
        yield what, world
        return
    yield f"{what} (reply lost)", world
    if not world.replies:
        yield f"{what} (reply late)", world._replace(replies=(reply,))
    yield from _heard(what, world, reply, False)


def _heard(what: str, world: World, reply: str, late: bool) -> Iterator[Step]:
    """What the driver makes of it. A check and a move take longer than any reply is late."""
    driver = world.driver
    state = driver.state
    if state is State.CHECKING and not late:
        copies = tuple(copy for copy in world.copies if copy != "CHECK")
        after = driver._replace(state=State.STILL, pending="", proved=reply == "ok")
        yield what, world._replace(driver=after, copies=copies)
    elif state is State.STARTING and reply == "ok":
        yield what, world._replace(driver=driver._replace(state=WHILE[driver.motion], pending=""))
    elif state is State.STARTING and reply != "no motion":
        motion = Motion.UNKNOWN if reply == "conflict" else driver.motion
        after = driver._replace(state=State.STOPPING, motion=motion, pending="", unanswered=0)
        yield what, world._replace(driver=after)
    elif state is State.MOVING and not late:
        yield what, world._replace(driver=_rests(driver))
    elif state is State.STOPPING and driver.unanswered > UNANSWERED:
        yield what, world
    elif state is State.STOPPING and not any(copy in START_WORDS for copy in world.copies):
        yield what, world._replace(driver=_rests(driver))
        yield f"{what} (not enough)", world._replace(driver=driver._replace(unanswered=0))
    else:
        yield what, world


def _rests(driver: Driver) -> Driver:
    return Driver(State.STILL, Motion.NONE, moved=driver.moved)


# The search


def trouble(world: World) -> str:
    """What must never be, with a living IMU and a driver that has not given up."""
    server, driver = world.server, world.driver
    if server.crashed:
        return "the server has crashed"
    given_up = driver.state is State.LOST or driver.unanswered > UNANSWERED
    if not server.imu or given_up:
        return ""
    if server.port == "hung":
        return "the command port hangs"
    if server.released:
        return "a motion is released by the stop port, and the next stop will hang"
    if server.moving and not _can_stop(world):
        return "nothing stops the robot"
    return ""


def _can_stop(world: World) -> bool:
    """Whether what the driver says of itself, when it is delivered, leaves the robot standing."""
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
    if server.moving and server.port == "free":  # the belief was wrong: a poll finds out, and
        for word in HALTS[Motion.UNKNOWN]:
            server, _ = execute(server, word.text)
    return not server.moving and server.port != "hung"


class Found(NamedTuple):
    """``worlds``: how many can be reached; ``steps``: between them; ``bad``: the way to the first
    that must not be, step by step.
    """

    worlds: int
    steps: int
    bad: tuple[str, ...]


FOUND_MOVING: Final = (
    Server(),
    *(Server(motion, True) for motion in (Motion.REFERENCE, Motion.REVERSE, Motion.SPIN)),
    *(Server(motion, True, "busy") for motion in (Motion.STRAIGHT, Motion.TURN)),
)
"""A driver that is started again may find any of these."""


def search(rules: Rules = table, most: int = 3_000_000) -> Found:
    """Everything that can happen, breadth first; ends at the first trouble."""
    row = [World(server) for server in FOUND_MOVING]
    came: dict[World, tuple[World, str] | None] = dict.fromkeys(row)
    count = 0
    while row:
        following = []
        for world in row:
            for what, after in steps(world, rules):
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


def servers() -> dict[Server, tuple[str, ...]]:
    """Every state of a server to which all datagrams are delivered, and the way there."""
    row = [Server()]
    found: dict[Server, tuple[str, ...]] = {Server(): ()}
    while row:
        server = row.pop(0)
        following = {word: execute(server, word)[0] for word in SAID}
        following["the IMU dies"] = server._replace(imu=False)
        for what, after in following.items():
            if after not in found and not (server.port == "busy" and what == "the IMU dies"):
                found[after] = (*found[server], what)
                row.append(after)
    return found


def _way(world: World, came: dict[World, tuple[World, str] | None]) -> list[str]:
    way = []
    before = came[world]
    while before is not None:
        world, what = before
        way.append(what)
        before = came[world]
    return way[::-1]


if __name__ == "__main__":
    import sys
    import time

    MOST_COPIES = int(sys.argv[1]) if len(sys.argv) > 1 else MOST_COPIES  # type: ignore[misc]
    began_s = time.monotonic()
    result = search()
    print(f"{result.worlds} worlds, {result.steps} steps, {time.monotonic() - began_s:.1f} s")
    print("\n".join(result.bad) or "no trouble can be reached")
