# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A model of a MART server, its network and its driver, for a search of all reachable states.

A *world* is the state of all three, and a *step* leads to the next world. The model has no clock: a
late copy of a command arrives at any later step, or is lost.
"""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from mart_model_server import SAID, START_WORDS, Reply, Server, execute

from omnibot_driver.core.mart.states import (
    HALTS,
    HARMFUL_LATE,
    NEEDS_IMU,
    STARTS,
    WHILE,
    Motion,
    State,
    may_say,
)
from omnibot_driver.core.mart.words import WORDS, Kind

BY_TEXT: Final = {("CHECK" if word.kind is Kind.CHECK else word.text): word for word in WORDS}
COPIED: Final = frozenset(SAID)
"""Commands whose late copies are modelled. Copies of other commands do not change the server."""
MOVES: Final = ("TF", "MCR")
MOST_COPIES: Final = 2
UNANSWERED: Final = 3
"""Number of unanswered stops after which the driver uses the stop port, its last resort."""


class Driver(NamedTuple):
    """The state of the modelled driver.

    * ``proved``: whether a check has just shown that the IMU works.
    * ``unanswered``: the number of stops without an answer.
    * ``moved``: whether the last motion was a controlled move (``MOVES``).
    * ``counted``: whether the encoder was read since the last stop.
    * ``greeted``: whether the server has confirmed a stop at least once.
    * ``underway``: whether the motors may be under direct control (MCS), as far as the driver
      knows.
    """

    state: State = State.UNKNOWN
    motion: Motion = Motion.UNKNOWN
    proved: bool = False
    pending: str = ""
    unanswered: int = 0
    moved: bool = False
    counted: bool = False
    greeted: bool = False
    underway: bool = False


class World(NamedTuple):
    """The state of the server, the driver and the network together.

    ``copies``: late commands to the server.

    ``replies``: late replies to the driver.
    """

    server: Server = Server()
    driver: Driver = Driver()
    copies: tuple[str, ...] = ()
    replies: tuple[str, ...] = ()


Rules = Callable[[State, str, Motion], bool]
"""A function that decides whether a command is allowed, as the driver's table of commands does. Its
arguments are the state of the driver, the command, and the motion of the robot."""
Allowed = Callable[[State, Motion], tuple[str, ...]]
"""A function that returns all commands that the table of commands allows. Its arguments are the
state of the driver, and the motion of the robot."""
Step = tuple[str, World]


def ready(world: World, word: str) -> bool:
    """Return whether the modelled driver may send ``word``, by the rules of the real driver.

    Before some commands, the driver waits until no harmful late copy is left, and checks the IMU.
    """
    driver = world.driver
    row = BY_TEXT[word]
    # The real driver waits for the longest network delay. The model has no clock, so it waits until
    # no copy is left.
    if (row in STARTS or row.kind is Kind.CHECK) and any(
        BY_TEXT[copy] in HARMFUL_LATE for copy in world.copies
    ):
        return False
    if driver.underway and (row in STARTS or row.kind is Kind.CHECK):
        return False
    if word == "MCS":
        return driver.moved and not driver.underway
    if word == "MSM" and driver.state is State.STILL:
        return driver.underway and "MCS" not in world.copies
    unproved = not driver.counted or (row in NEEDS_IMU and not driver.proved)
    if row in STARTS and driver.state is State.STILL and unproved:
        return False
    if word in ("SL", "SS") and driver.state is State.STILL:
        return driver.moved
    if driver.state is State.STOPPING:
        halts = {row.text for row in HALTS[driver.motion]}
        if word in halts:
            return driver.unanswered <= UNANSWERED
        return driver.unanswered >= UNANSWERED and halts.isdisjoint(world.copies)
    if driver.state is State.ASKING:
        return {"SRM", "SM"}.isdisjoint(world.copies)  # SL and SS are repeated every 3 s
    return True


def table(state: State, word: str, motion: Motion) -> bool:
    """Return whether the real driver may send the command ``word`` in this state and motion."""
    return may_say(state, BY_TEXT[word], motion)


def steps(world: World, allowed: Allowed) -> Iterator[Step]:
    """Yield every step that can follow ``world``: its name, and the world after the step."""
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
    for word in allowed(driver.state, driver.motion):
        if ready(world, word):
            yield from _said(word, world)


def _ends(world: World) -> Iterator[Step]:
    """Yield the possible steps at the end of a controlled move.

    If a late copy of a move has arrived, there are two steps: the server ignores the copy, or
    executes it after the move.
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
    """Yield the steps in which the driver changes its state without sending a command.

    For example, the driver begins to stop, a wait ends, or a query is answered.
    """
    server, driver = world.server, world.driver
    state = driver.state
    if state in (State.STARTING, State.DRIVING, State.REVERSING, State.TURNING, State.MOVING):
        yield "stop", world._replace(driver=driver._replace(state=State.STOPPING, unanswered=0))
    if state is State.UNKNOWN:
        yield "opens", world._replace(driver=driver._replace(state=State.STOPPING))
    if state is State.CHECKING:
        yield "no reply", world._replace(driver=driver._replace(state=State.STILL, pending=""))
    if state is State.STILL and server.port == "free" and server.moving:
        stray = _rests(driver)._replace(state=State.STOPPING, motion=Motion.UNKNOWN)
        yield "a poll shows that the robot moves", world._replace(driver=stray)
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
        yield "the server answers HELLO", world._replace(driver=_rests(driver))
    if sweeps_first(driver) and state is State.STOPPING:
        yield "asks what moves", world._replace(driver=driver._replace(state=State.ASKING))
    if state is State.ASKING and server.port == "free" and not world.copies:
        yield _asked(world)


def sweeps_first(driver: Driver) -> bool:
    """Return whether the driver must first find out which motion is in progress.

    This is so if the motion is unknown, the stop port was used, and no stop was ever confirmed.
    """
    spent = driver.unanswered > UNANSWERED and driver.motion is Motion.UNKNOWN
    return spent and not driver.greeted


def _asked(world: World) -> Step:
    """Return the model's step in which the driver finds out which motion is in progress.

    The driver does this after it has used the stop port. A lost reply changes no state, so the
    model omits this case.
    """
    # The driver first asks for the server's name. The answer shows that all earlier datagrams have
    # arrived or are lost. Then it asks for a motion in progress, and reads the encoder.
    server, _ = execute(world.server, "MSM")
    world = world._replace(server=server)
    _, reply = execute(server, "CHECK")
    driver = Driver(State.STOPPING, Motion.UNKNOWN)
    if reply == "conflict" and not world.server.moving:
        return "a motion in progress is found, but the robot is at rest", world._replace(
            driver=driver._replace(state=State.LOST)
        )
    return "SRM and SM do no harm", world._replace(driver=driver)


def _said(word: str, world: World) -> Iterator[Step]:
    """Yield the possible steps when the driver sends this command: it is lost, late or executed."""
    driver = world.driver
    row = BY_TEXT[word]
    if row in STARTS:
        state = State.MOVING if row.kind is Kind.MOVE else State.STARTING
        moves = row.kind is Kind.MOVE
        driver = Driver(state, STARTS[row], pending=word, moved=moves, greeted=True)
    elif word == "MCS":
        driver = driver._replace(underway=True)
    elif word == "MSM":
        driver = driver._replace(pending=word)
    elif word == "CHECK":
        driver = driver._replace(state=State.CHECKING, pending=word, proved=False)
    elif driver.state is State.STOPPING:
        if driver.unanswered > UNANSWERED and not sweeps_first(driver):
            driver = driver._replace(state=State.LOST)
        elif driver.unanswered > UNANSWERED:
            pass
        else:
            driver = driver._replace(unanswered=driver.unanswered + 1)
    server, _, copies, replies = world
    said = World(server, driver, copies, replies)
    yield f"{word} is lost", said
    copied = None
    if word in COPIED and len(copies) < MOST_COPIES:
        copied = World(server, driver, tuple(sorted((*copies, word))), replies)
        yield f"{word} is late", copied
    if server.port != "free" and word not in ("SL", "SS"):
        return
    after, reply = execute(server, word)
    for what, before in ((word, said), (f"{word}, and a copy later", copied)):
        if before is None:
            continue
        yield from _replied(what, World(after, driver, before.copies, replies), reply)


def _replied(what: str, world: World, reply: Reply) -> Iterator[Step]:
    """Yield the steps that may follow the server's reply: it is lost, late or received.

    ``what``: name of the step. ``world``: the world before the reply.
    """
    if reply is None:
        yield what, world
        return
    yield f"{what} (reply lost)", world
    if not world.replies:
        yield f"{what} (reply late)", World(world.server, world.driver, world.copies, (reply,))
    yield from _heard(what, world, reply, False)


def _heard(what: str, world: World, reply: str, late: bool) -> Iterator[Step]:
    """Yield the conclusions that the driver may draw from a reply.

    ``late``: whether the reply may belong to an earlier command. The driver ignores a late reply
    during a check of the IMU, a controlled move or MSM (end of direct control).
    """
    driver = world.driver
    state = driver.state
    # A check or a move lasts so long that no late reply to an earlier command arrives at its end.
    if state is State.CHECKING and not late:
        copies = tuple(copy for copy in world.copies if copy != "CHECK")
        refused = driver.underway or reply == "conflict"
        after = driver._replace(
            state=State.STILL, pending="", proved=reply == "ok", underway=refused
        )
        yield what, world._replace(driver=after, copies=copies)
    elif state is State.STILL and (driver.pending, reply) == ("MSM", "ok") and not late:
        yield what, world._replace(driver=driver._replace(pending="", underway=False))
    elif state is State.STARTING and reply == "ok":
        yield what, world._replace(driver=driver._replace(state=WHILE[driver.motion], pending=""))
    elif state is State.STARTING and reply != "no motion":
        motion = Motion.UNKNOWN if reply == "conflict" else driver.motion
        after = driver._replace(
            state=State.STOPPING,
            motion=motion,
            pending="",
            unanswered=0,
            underway=reply == "conflict",
        )
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
    return Driver(
        State.STILL, Motion.NONE, moved=driver.moved, greeted=True, underway=driver.underway
    )
