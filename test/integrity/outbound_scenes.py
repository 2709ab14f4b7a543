# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Seeded scripts of the outbound trials: drives, and every way in which a drive ends.

Many commands contain bytes that equal a letter or a header.
"""

import math
from collections.abc import Callable
from functools import partial
from random import Random
from typing import Final

from outbound_drive import Command, Scene
from outbound_teller import ANGULAR_SCALE, Shown

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.requests import Request
from omnibot_driver.core.session import Session

FROM_S: Final = 0.3
"""Earliest time in s at which a scene can drive.

At this time, the board runs, and the driver knows that it runs.
"""
STANDS_S: Final = 1.2
"""Time in s from the last command until the robot must be at rest."""
ESTOPPED_S: Final = 0.3
EXITED_S: Final = 0.5
DRIVE_S: Final = 1.5
DRIVE_RATES_HZ: Final = (20.0, 50.0, 100.0)
RATES_HZ: Final = (10.0, 20.0, 30.0, 50.0, 100.0)
AWKWARD_LSB: Final = (-1, -2, -6, 80, 82, 83, -176, -174, -173, 250, 0)
"""Yaw rates, in LSB of a command, whose frames contain letters or the header bytes FF and FE."""


def _twist(random: Random) -> BodyTwist:
    vx, vy = (random.choice((0.0, 1.0, 1.0)) * random.uniform(-0.35, 0.35) for _ in range(2))
    yaw_lsb = random.choice((0.0, random.uniform(-250, 250), random.choice(AWKWARD_LSB)))
    if not (vx or vy):
        vx = random.choice((-0.2, 0.2))
    return BodyTwist(vx, vy, yaw_lsb / ANGULAR_SCALE)


def _rates(random: Random) -> tuple[float, float, float]:
    a, b = (random.choice((0.0, random.uniform(-17, 17))) for _ in range(2))
    return a, b, random.choice((-1, 1)) * random.uniform(1, 17)


def driving(
    random: Random, begin_s: float, end_s: float, *, by_wheels: bool = False, rate_hz: float = 0.0
) -> list[Command]:
    """Return commands from ``begin_s`` to ``end_s``, which change at random times.

    ``rate_hz``: rate of the commands. If it is 0, the rate is random.
    """
    rate_hz, changes = rate_hz or random.choice(RATES_HZ), random.choice((0.0, 0.1, 0.1, 1.0))
    wishes = []
    now = begin_s
    twist, rates = _twist(random), _rates(random)
    while now < end_s:
        if random.random() < changes:
            twist, rates = _twist(random), _rates(random)
        if by_wheels:
            wishes.append(Command(now, partial(_turn, rates)))
        else:
            wishes.append(Command(now, partial(_drive, twist)))
        now += random.uniform(0.8, 1.2) / rate_hz
    return wishes


def _drive(twist: BodyTwist, session: Session, now: float) -> None:
    session.command_twist(twist, now)


def _turn(rates: tuple[float, float, float], session: Session, now: float) -> None:
    session.command_wheels(rates, now)


def _go(goal: Pose, session: Session, now: float) -> None:
    session.command_pose(goal, now)


def _stand(session: Session, now: float) -> None:
    session.command_twist(BodyTwist(0.0, 0.0, 0.0), now)


def _request(request: Request) -> Callable[[Session, float], object]:
    return lambda session, now: session.request(request, None, now)


def _estop(active: bool) -> Callable[[Session, float], object]:
    return lambda session, now: session.estop(active, now)


def _common(random: Random) -> dict[str, object]:
    """Choose settings of a scene at random.

    Sometimes the scale, the rate or the acceleration limit is unusual.
    """
    return {
        "linear_scale": random.choice((70.0, 70.0, 233.0)),
        "rate_hz": random.choice((20.0, 20.0, 20.0, 10.0, 50.0)),
        "limits": SpeedLimits(linear_mps2=random.choice((0.0, 0.0, 1.0))),
        "faults_from_s": FROM_S,
        "guard_after_s": random.uniform(0.0005, 0.004),
    }


def _leg(random: Random) -> tuple[list[Command], float]:
    """Return the commands of one drive, and the time in s at which the last of them is sent."""
    wishes = driving(random, FROM_S, FROM_S + random.uniform(0.1, 0.35), by_wheels=_wheels(random))
    return wishes, wishes[-1].at_s


def _wheels(random: Random) -> bool:
    return random.random() < 0.25


def drive(rate_hz: float, random: Random) -> Scene:
    """Make a scene that only drives, with commands at this rate, and does not stop the robot."""
    wishes = driving(random, FROM_S, FROM_S + DRIVE_S, rate_hz=rate_hz)
    return Scene(
        kind=f"drive {rate_hz:g}",
        wishes=tuple(wishes),
        ends_s=FROM_S + DRIVE_S,
        faults_from_s=FROM_S,
        still_by_s=math.inf,
    )


def timeout(random: Random) -> Scene:
    """Make a scene in which the commander stops sending, so the command times out."""
    wishes, last_s = _leg(random)
    return Scene(
        kind="timeout",
        wishes=tuple(wishes),
        ends_s=last_s + 1.8,
        still_by_s=last_s + STANDS_S,
        **_common(random),
    )


def zero(random: Random) -> Scene:
    """Make a scene in which the commander sends zeros for a while."""
    wishes, last_s = _leg(random)
    gap_s = 1.0 / random.choice(RATES_HZ)
    until_s, now = last_s + random.uniform(0.0, 0.7), last_s + gap_s
    while now <= until_s + gap_s:
        wishes.append(Command(now, _stand))
        now += gap_s
    return Scene(
        kind="zero",
        wishes=tuple(wishes),
        ends_s=last_s + 2.3,
        still_by_s=last_s + STANDS_S,
        **_common(random),
    )


def switch(random: Random) -> Scene:
    """Make a scene in which cmd_vel and wheel_cmd alternate, immediately or after up to 0.1 s."""
    wishes: list[Command] = []
    now = FROM_S
    for number in range(4):
        end_s = now + random.uniform(0.05, 0.3)
        wishes += driving(random, now, end_s, by_wheels=number % 2 == 0)
        now = end_s + random.choice((0.0, 0.0, 0.003, 0.1))
    last_s = max(wish.at_s for wish in wishes)
    return Scene(
        kind="switch",
        wishes=tuple(wishes),
        ends_s=last_s + 1.8,
        still_by_s=last_s + STANDS_S,
        **_common(random),
    )


def pause(random: Random) -> Scene:
    """Make a scene in which a user calls ``~/pause`` while the robot drives or is at rest."""
    wishes, last_s = _leg(random) if random.random() < 0.7 else ([], FROM_S)
    asked_s = last_s + random.choice((0.005, 0.03, 0.3))
    wishes.append(Command(asked_s, _request(Request.PAUSE)))
    return Scene(
        kind="pause",
        wishes=tuple(wishes),
        ends_s=asked_s + 2.5,
        still_by_s=last_s + STANDS_S,
        **_common(random),
    )


def start(random: Random) -> Scene:
    """Make a scene in which a user calls ``~/start`` for a paused board.

    Then the robot drives and stops.
    """
    wishes = [Command(FROM_S, _request(Request.START))]
    wishes += driving(random, FROM_S + 0.05, FROM_S + random.uniform(0.3, 1.0))
    last_s = wishes[-1].at_s
    return Scene(
        kind="start",
        wishes=tuple(wishes),
        ends_s=last_s + 1.8,
        still_by_s=last_s + STANDS_S,
        begins=Shown("paused", False),
        run=False,
        **_common(random),
    )


def reset(random: Random) -> Scene:
    """Make a scene in which a user calls ``~/reset`` after a drive.

    The board reboots and is started.
    """
    wishes, last_s = _leg(random) if random.random() < 0.8 else ([], FROM_S)
    asked_s = last_s + random.choice((0.005, 0.03, 0.3))
    wishes.append(Command(asked_s, _request(Request.RESET)))
    return Scene(
        kind="reset",
        wishes=tuple(wishes),
        ends_s=asked_s + 2.5,
        still_by_s=last_s + STANDS_S,
        **_common(random),
    )


def estop(random: Random) -> Scene:
    """Make a scene in which the e-stop is latched, and later released.

    Commands continue while the e-stop is latched.
    """
    begin_s = FROM_S + random.uniform(0.1, 0.3)
    released_s = begin_s + random.uniform(0.35, 0.6)
    wishes = driving(random, FROM_S, released_s - 0.05, by_wheels=_wheels(random))
    wishes += [Command(begin_s, _estop(True)), Command(released_s, _estop(False))]
    return Scene(
        kind="e-stop",
        wishes=tuple(wishes),
        ends_s=released_s + random.choice((0.2, 1.2)),
        still_by_s=begin_s + ESTOPPED_S,
        **_common(random),
    )


def goal(random: Random) -> Scene:
    """Make a scene with goal poses. Goals do not expire, so the e-stop ends the drive."""
    wishes = [
        Command(at_s, partial(_go, Pose(*(random.uniform(-9, 9) for _ in range(3)))))
        for at_s in (FROM_S, FROM_S + random.uniform(0.05, 0.4), FROM_S + 0.4)
    ]
    begin_s = FROM_S + random.uniform(0.5, 0.7)
    wishes.append(Command(begin_s, _estop(True)))
    return Scene(
        kind="goal",
        wishes=tuple(wishes),
        ends_s=begin_s + 1.3,
        still_by_s=begin_s + ESTOPPED_S,
        control="position",
        **_common(random),
    )


def leave(random: Random) -> Scene:
    """Make a scene in which the driver ends while commands arrive.

    Sometimes the e-stop is latched.
    """
    exits_s = FROM_S + random.uniform(0.1, 0.3)
    wishes = driving(random, FROM_S, exits_s, by_wheels=_wheels(random))
    if random.random() < 0.2:
        wishes.append(Command(exits_s - 0.02, _estop(True)))
    return Scene(
        kind="exit",
        wishes=tuple(wishes),
        exits_s=exits_s,
        on_exit=random.choice(("stop", "stop", "pause", "reset")),
        ends_s=exits_s + 2.0,
        still_by_s=exits_s + EXITED_S,
        **_common(random),
    )


def kill(random: Random) -> Scene:
    """Make a scene in which the driver is killed, perhaps during a write. Its guard sends Stop."""
    wishes, last_s = _leg(random)
    killed_s = last_s + random.choice((0.0002, 0.0007, 0.0012, 0.002, 0.02))
    if random.random() < 0.2:
        wishes.append(Command(killed_s - 0.02, _estop(True)))
    return Scene(
        kind="kill",
        wishes=tuple(wishes),
        killed_s=killed_s,
        ends_s=killed_s + 1.5,
        still_by_s=killed_s + EXITED_S,
        **_common(random),
    )


ENDED: Final[dict[str, Callable[[Random], Scene]]] = {
    "timeout": timeout,
    "zero": zero,
    "switch": switch,
    "pause": pause,
    "start": start,
    "reset": reset,
    "e-stop": estop,
    "goal": goal,
    "exit": leave,
    "kill": kill,
}
DRIVES: Final[dict[str, Callable[[Random], Scene]]] = {
    f"drive {rate_hz:g}": partial(drive, rate_hz) for rate_hz in DRIVE_RATES_HZ
}
SCENES: Final = {**ENDED, **DRIVES}
