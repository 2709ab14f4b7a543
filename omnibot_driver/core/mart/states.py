# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands that the driver may send to the MART controller in each state of motion.

A wrong command can hang the server with the motors turning. This module knows commands and states;
it does not know times or measurements.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Final

from omnibot_driver.core.mart.words import (
    CHECK,
    CS,
    DOCKED,
    ENC,
    EXIT,
    HELLO,
    LAST_MOVE,
    LAST_TURN,
    LOG,
    MCL,
    MCR,
    MCS,
    MCSTAT,
    MSM,
    RESET,
    RM,
    RMCS,
    RMRA,
    SB,
    SFC,
    SL,
    SM,
    SRC,
    SRM,
    SS,
    SSP,
    TB,
    TD,
    TF,
    TIME,
    VOLTS,
    B,
    L,
    R,
    Word,
)


class State(Enum):
    """The state of the robot's motion, as far as the replies show it."""

    UNKNOWN = "not known: the server may be moving the robot"
    STILL = "at rest"
    CHECKING = "at rest; the IMU is being checked"
    STARTING = "starting"
    DRIVING = "driving by RM"
    REVERSING = "driving by B"
    TURNING = "turning by R or L"
    MOVING = "controlled move by TF, TB, MCR or MCL"
    SERVING = "at rest; the server is busy"
    STOPPING = "stopping"
    ASKING = (
        "not known: the driver used the stop port, and is asking the server what is in progress"
    )
    LOST = "lost: the server must be restarted"


ROLLING: Final = (State.DRIVING, State.REVERSING, State.TURNING)
"""The states in which the robot moves and the server answers queries."""


class Motion(Enum):
    """A kind of motion. Its value names the commands that begin a motion of this kind."""

    NONE = "none"
    REFERENCE = "RM"
    REVERSE = "B"
    SPIN = "R or L"
    STRAIGHT = "TF or TB"
    TURN = "MCR or MCL"
    UNKNOWN = "any"


QUICK: Final = frozenset({ENC, RMRA, VOLTS, MCSTAT, DOCKED, HELLO})
"""Queries that the server answers at once whenever its command port is free."""

MAY_SAY: Final[Mapping[State, frozenset[Word]]] = {
    State.UNKNOWN: frozenset({HELLO, SRM, SM}),
    State.STILL: QUICK
    | {SFC, SRC, TD, RESET, CHECK, SSP, MCS, MSM, RM, B, R, L, TF, TB, MCR, MCL, SRM, SM, SL, SS}
    | {SB, TIME, LOG, LAST_MOVE, LAST_TURN, EXIT},
    State.CHECKING: frozenset(),
    State.STARTING: frozenset({SRM, SM}),
    State.DRIVING: QUICK | {RMCS, SRM},
    State.REVERSING: QUICK | {CS, SM},
    State.TURNING: QUICK | {SM},
    State.MOVING: frozenset({SL, SS}),
    State.SERVING: frozenset(),
    State.STOPPING: frozenset({SRM, SM, SL, SS}),
    State.ASKING: frozenset({HELLO, ENC, RESET, MSM, SL, SS}),
    State.LOST: frozenset({HELLO, SRM, SM, SL, SS}),
}
"""The commands that are allowed in each state. HELLO is sent without a check of this table.

The commands in NEEDS_IMU also require a recent successful check of the IMU (RESET or CHECK).
"""

HALTS: Final[Mapping[Motion, tuple[Word, ...]]] = {
    Motion.NONE: (),
    Motion.REFERENCE: (SRM,),
    Motion.REVERSE: (SM,),
    Motion.SPIN: (SM,),
    Motion.STRAIGHT: (SL,),
    Motion.TURN: (SS,),
    Motion.UNKNOWN: (SRM, SM),
}
"""The commands that stop each motion. Other stop commands have no effect, or hang the server."""

LAST_HALTS: Final[Mapping[Motion, tuple[Word, ...]]] = {
    Motion.NONE: (),
    Motion.REFERENCE: (SL,),
    Motion.REVERSE: (SL,),
    Motion.SPIN: (SS,),
    Motion.STRAIGHT: (SL,),
    Motion.TURN: (SS,),
    Motion.UNKNOWN: (SL, SS),
}
"""Commands that stop each motion by the stop port, if the command port stays silent. They are the
last resort, because they may hang the server."""

STARTS: Final[Mapping[Word, Motion]] = {
    RM: Motion.REFERENCE,
    B: Motion.REVERSE,
    R: Motion.SPIN,
    L: Motion.SPIN,
    TF: Motion.STRAIGHT,
    TB: Motion.STRAIGHT,
    MCR: Motion.TURN,
    MCL: Motion.TURN,
}
"""The motion that each start command begins."""

# with a dead IMU, some servers turn the robot for 0.5 s before they answer MCR or MCL
NEEDS_IMU: Final = frozenset({RM, B, R, L, TF, TB, MCR, MCL, SB})
"""Commands that need a working IMU.

With a dead IMU, the server may start the motors, or wait, without an answer. Only the controlled
turns (MCR, MCL) are answered, by a failure.
"""

HARMFUL_LATE: Final = frozenset({SL, SS, R, L, TF, TB, MCR, MCL, MCS, TIME})
"""Commands that do harm if a duplicate of them arrives after another motion has begun.

The next start, and its check of the IMU, wait until no duplicate can arrive.
"""

WHILE: Final[Mapping[Motion, State]] = {
    Motion.NONE: State.STILL,
    Motion.REFERENCE: State.DRIVING,
    Motion.REVERSE: State.REVERSING,
    Motion.SPIN: State.TURNING,
    Motion.STRAIGHT: State.MOVING,
    Motion.TURN: State.MOVING,
}
"""For each motion: the ``State`` that applies while the server executes the motion."""


def may_say(state: State, word: Word, motion: Motion) -> bool:
    """Return whether the command ``word`` may be sent in the state ``state``.

    ``motion``: the motion that is, or may be, in progress.
    """
    if word not in MAY_SAY[state]:
        return False
    if state in (State.STARTING, State.MOVING):
        return word in HALTS[motion]
    if state is State.STOPPING:
        return word in HALTS[motion] or word in LAST_HALTS[motion]
    return True
