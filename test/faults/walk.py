# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Faults in random order, several of them at the same time, while random commands move the robot.

Every few steps, the commands and most faults end, and the robot must come to rest. When all faults
have ended, the robot must obey a new command.
"""

from collections.abc import Callable
from random import Random
from typing import Final

from breakable_line import Damage, cut, gaining, late, losing, losing_bursts, noise
from rig import Rig
from rig_board import RigBoard
from std_srvs.srv import SetBool, Trigger

STEPS_TO_A_REST: Final = 3
TRIES: Final = 15
STANDS_AGAIN_S: Final = 1.0
"""Longest time in s from the end of the commands until the robot must be at rest.

The limit has a margin for a line to the board that was cut, or is still damaged.
"""


def walk(rig: Rig, random: Random, steps: int) -> list[str]:
    """Cause ``steps`` random faults, and return the names of the faults in order."""
    possible = steps_of(rig.kind)
    names = []
    for step in range(1, steps + 1):
        if random.random() < 0.8:
            rig.hand.hold(*(random.uniform(-0.5, 0.5) for _ in range(3)))
        else:
            rig.hand.leave()
        name = random.choice(list(possible))
        names.append(name)
        possible[name](rig, random)
        rig.wait_ticks(random.randrange(150))
        if step % STEPS_TO_A_REST == 0 or step == steps:
            _rest(rig, f"step {step}, after {', '.join(names[-STEPS_TO_A_REST:])}")
    return names


def _rest(rig: Rig, what: str) -> None:
    to_board = rig.line.to_board
    rig.heal()
    if to_board is not cut:
        rig.line.to_board = to_board
    rig.hand.leave()
    rig.expect_still(rig.line.tick, what, STANDS_AGAIN_S + rig.kind.rests_later_s)
    rig.heal()
    rig.probe.call(SetBool, "estop", data=False)
    if "pause" in rig.kind.services:
        _run_again(rig, what)
    rig.expect_obeys_again()


def _run_again(rig: Rig, what: str) -> None:
    for _ in range(TRIES):  # another request may be in progress
        answer = rig.probe.call(SetBool, "pause", data=False)
        if answer.success:
            break
        rig.wait_ticks(100)
    rig.findings.expect(answer.success, f"{what}: it does not run: {answer.message}")


def _damage(kind: Callable[[Random], Damage]) -> Callable[[Rig, Random], None]:
    def start(rig: Rig, random: Random) -> None:
        to_board, from_board = random.choice(((True, False), (False, True), (True, True)))
        rig.line.to_board = kind(random) if to_board else rig.line.to_board
        rig.line.from_board = kind(random) if from_board else rig.line.from_board

    return start


def _from_board(kind: Callable[[Random], Damage]) -> Callable[[Rig, Random], None]:
    def start(rig: Rig, random: Random) -> None:
        rig.line.from_board = kind(random)

    return start


def _heal(rig: Rig, _random: Random) -> None:
    rig.heal()


def _stick(rig: Rig, _random: Random) -> None:
    rig.terminal.deaf = True


def _reboot(rig: Rig, _random: Random) -> None:
    rig.reboot_board()


def _replug(rig: Rig, random: Random) -> None:
    rig.unplug()
    if random.random() < 0.5:
        rig.probe.wait_for_state("disconnected")
    rig.plug()


def _call(service: str) -> Callable[[Rig, Random], None]:
    def call(rig: Rig, random: Random) -> None:
        if service in ("pause", "estop"):
            rig.probe.call_async(SetBool, service, data=random.random() < 0.5)
        else:
            rig.probe.call_async(Trigger, service)

    return call


STEPS: Final[dict[str, Callable[[Rig, Random], None]]] = {
    "a cut": _damage(lambda _: cut),
    "1 byte in 100 lost": _damage(lambda random: losing(1e-2, random)),
    "1 byte in 1,000 lost": _damage(lambda random: losing(1e-3, random)),
    "1 byte in 1,000 added": _from_board(lambda random: gaining(1e-3, random)),
    "bursts lost": _from_board(lambda random: losing_bursts(1e-3, random)),
    "noise": _from_board(noise),
    "a late adapter": _from_board(lambda random: late(random.randrange(2, 60))),
    "a stuck adapter": _stick,
    "a whole line": _heal,
    "a reboot": _reboot,
    "a replug": _replug,
}
CALLS: Final = {
    "start": "start",
    "pause": "pause",
    "reset": "reset",
    "e-stop": "estop",
    "reset_odometry": "reset_odometry",
}


def steps_of(kind: RigBoard) -> dict[str, Callable[[Rig, Random], None]]:
    """Return the faults of this board's line, and the service calls that its driver offers."""
    calls = {name: _call(call) for name, call in CALLS.items() if call in kind.services}
    return {**(STEPS if kind.steps is None else kind.steps), **calls}
