# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""A small model of the MART server: the effect of each command in each state of the server.

``test_mart_search`` compares the model with the simulated firmware.
"""

from typing import Final, NamedTuple

from omnibot_driver.core.mart.states import Motion

START_WORDS: Final = ("RM", "B", "R", "L", "TF", "MCR")
"""Commands that start a motion. TB and MCL are left out: they behave as TF and MCR."""
SAID: Final = (*START_WORDS, "CHECK", "SRM", "SM", "SL", "SS", "MCS", "MSM")
KIND: Final = {
    "RM": Motion.REFERENCE,
    "B": Motion.REVERSE,
    "R": Motion.SPIN,
    "L": Motion.SPIN,
    "TF": Motion.STRAIGHT,
    "MCR": Motion.TURN,
}


class Server(NamedTuple):
    """The state of the modelled server.

    * ``port``: state of the command port: "free", "busy" (a controlled move is in progress),
      "waits" (for an IMU that does not work) or "hung" (no more answers).
    * ``released``: whether the stop port has stopped a motion that the server still regards as in
      progress.
    * ``manual``: whether the motors are under direct control (MCS); the server then refuses
      motions.
    """

    motion: Motion = Motion.NONE
    moving: bool = False
    port: str = "free"
    released: bool = False
    imu: bool = True
    crashed: bool = False
    manual: bool = False


Reply = str | None


def execute(server: Server, word: str) -> tuple[Server, Reply]:
    """Execute one datagram, and return the new state of the server, and its reply or None."""
    if server.crashed:
        return server, None
    if word in ("SL", "SS"):
        return _stop_port(server, word)
    if server.port != "free":
        return server, None  # the datagram waits in the queue, like a late copy
    motion = server.motion
    if word == "MSM":
        return server._replace(manual=False), "ok"
    if word in ("CHECK", "MCS"):
        if motion is not Motion.NONE or server.manual:
            return server, "conflict"
        if word == "MCS":
            return server._replace(manual=True), "ok"
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
    if motion is not Motion.NONE or server.manual:
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


def servers() -> dict[Server, tuple[str, ...]]:
    """Return all states that the server can reach without lost datagrams, with the steps to each.

    A step is a command or, except during a controlled move, a failure of the IMU.
    """
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
