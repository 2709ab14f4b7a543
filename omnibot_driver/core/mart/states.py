# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What may be said to the MART controller in which state of motion, as data.

Some commands hang the real server for good in the wrong state, with the motors turning. So whatever
is sent is looked up here first. Knows words; no times but that of the network, no measurements.
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
    MCSTAT,
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
    """Of the robot's motion, as far as the replies tell."""

    UNKNOWN = "not known: the server may be moving the robot"
    STILL = "still"
    CHECKING = "still, while the IMU is proved"
    STARTING = "starting"
    DRIVING = "driving by RM"
    REVERSING = "driving by B"
    TURNING = "turning by R or L"
    MOVING = "controlled move by TF, TB, MCR or MCL"
    SERVING = "still, while the server is busy"
    STOPPING = "stopping"
    ASKING = "not known: the stop port was used, and the server is asked what is in progress"
    LOST = "lost: the server must be restarted"


class Motion(Enum):
    """What the server is, or may be, moving the robot by."""

    NONE = "none"
    REFERENCE = "RM"
    REVERSE = "B"
    SPIN = "R or L"
    STRAIGHT = "TF or TB"
    TURN = "MCR or MCL"
    UNKNOWN = "any"


QUICK: Final = frozenset({ENC, RMRA, VOLTS, MCSTAT, DOCKED, HELLO})
"""Answered at once, in any state in which the command port is free."""

MAY_SAY: Final[Mapping[State, frozenset[Word]]] = {
    State.UNKNOWN: frozenset({HELLO, SRM, SM}),
    State.STILL: QUICK
    | {SFC, SRC, TD, RESET, CHECK, SSP, RM, B, R, L, TF, TB, MCR, MCL, SRM, SM, SL, SS}
    | {SB, TIME, LOG, LAST_MOVE, LAST_TURN, EXIT},
    State.CHECKING: frozenset(),
    State.STARTING: frozenset({SRM, SM}),
    State.DRIVING: QUICK | {RMCS, SRM},
    State.REVERSING: QUICK | {CS, SM},
    State.TURNING: QUICK | {SM},
    State.MOVING: frozenset({SL, SS}),
    State.SERVING: frozenset(),
    State.STOPPING: frozenset({SRM, SM, SL, SS}),
    State.ASKING: frozenset({HELLO, ENC, RESET, SL, SS}),
    State.LOST: frozenset({HELLO, SRM, SM, SL, SS}),
}
"""All that start, and SB, besides only right after a proof of the IMU (RESET or CHECK)."""

HALTS: Final[Mapping[Motion, tuple[Word, ...]]] = {
    Motion.NONE: (),
    Motion.REFERENCE: (SRM,),
    Motion.REVERSE: (SM,),
    Motion.SPIN: (SM,),
    Motion.STRAIGHT: (SL,),
    Motion.TURN: (SS,),
    Motion.UNKNOWN: (SRM, SM),
}
"""What stops it. Any other word does nothing, or hangs the server."""

LAST_HALTS: Final[Mapping[Motion, tuple[Word, ...]]] = {
    Motion.NONE: (),
    Motion.REFERENCE: (SL,),
    Motion.REVERSE: (SL,),
    Motion.SPIN: (SS,),
    Motion.STRAIGHT: (SL,),
    Motion.TURN: (SS,),
    Motion.UNKNOWN: (SL, SS),
}
"""Where the command port is silent: it stops the motors, and may hang the server."""

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
"""What a word begins."""

NEEDS_IMU: Final = frozenset({RM, B, R, L, TF, TB, MCR, MCL, SB})
"""With a dead IMU these start the motors and never answer, or go on when it is back. MCR and MCL
find it out, but some servers turn the robot for half a second first.
"""

HARMFUL_LATE: Final = frozenset({SL, SS, R, L, TF, TB, MCR, MCL, TIME})
"""A copy of one of these that arrives late does something else than it was meant to do, once
another motion has begun: no motion begins, and no check is made for one, before no copy can come
any more."""

WHILE: Final[Mapping[Motion, State]] = {
    Motion.NONE: State.STILL,
    Motion.REFERENCE: State.DRIVING,
    Motion.REVERSE: State.REVERSING,
    Motion.SPIN: State.TURNING,
    Motion.STRAIGHT: State.MOVING,
    Motion.TURN: State.MOVING,
}
"""The state in which it is under way, once it has begun."""


def may_say(state: State, word: Word, motion: Motion) -> bool:
    """Whether the server can take it now. ``motion``: which is, or may be, under way."""
    if word not in MAY_SAY[state]:
        return False
    if state in (State.STARTING, State.MOVING):
        return word in HALTS[motion]
    if state is State.STOPPING:
        return word in HALTS[motion] or word in LAST_HALTS[motion]
    return True
