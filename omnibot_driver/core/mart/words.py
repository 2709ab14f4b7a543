# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The table of all commands of the MART controller: port, replies and times of each.

A command is a case-sensitive ASCII datagram without a terminator. This module knows the commands;
it does not know in which state (see ``states``) or when (see ``conversation``) each may be sent.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

COMMAND, STOP = 0, 1
"""The channels: the command port P, and the stop port P+1, which never answers."""
LONGEST_REQUEST: Final = 49
"""Longest request in bytes. The shortest request has 1 byte, because an empty datagram shuts the
server down."""


class Form(Enum):
    """The kind of text that follows ``ok`` in a reply. The value of each form is an example."""

    NOTHING = "ok"
    NAME = "ok BBB"
    INTEGER = "ok 12"
    DECIMAL = "ok 1.23"
    TRUTH = "ok true"
    FILE = "ok name 1234"


class Kind(Enum):
    """What a command does."""

    QUERY = "asks"
    CHECK = "proves that the IMU is alive"
    START = "starts a motion, and answers when it has begun"
    CHANGE = "changes a motion"
    MOVE = "starts a controlled move, and answers when it is over"
    HALT = "stops a motion"
    SERVICE = (
        "keeps the server busy for some time; the driver sends it only while the robot is at rest"
    )


@dataclass(frozen=True, slots=True)
class Word:
    """One command of the server. Two commands are equal if their texts are equal.

    * ``forms``: the forms that a successful reply can have.
    * ``takes_s``, ``least_s``: longest and shortest time from the request to the reply, in s.
    * ``fails``: the texts that may follow ``fail`` in the reply. A text that no command lists in
      ``fails`` is accepted, too.
    """

    text: str
    kind: Kind = field(compare=False)
    forms: frozenset[Form] = field(compare=False)
    takes_s: float = field(compare=False)
    least_s: float = field(default=0.0, compare=False)
    channel: int = field(default=COMMAND, compare=False)
    fails: frozenset[str] = field(default_factory=frozenset, compare=False)

    def request(self, *arguments: object) -> "Request":
        """Return a request of this command with these arguments.

        Raises ValueError if the request is too long.
        """
        data = " ".join([self.text, *map(str, arguments)]).encode("ascii")
        if not 0 < len(data) <= LONGEST_REQUEST:
            raise ValueError(f"a request has 1 to {LONGEST_REQUEST} bytes, not {len(data)}")
        return Request(self, data)


@dataclass(frozen=True, slots=True)
class Request:
    """A datagram to send to the server, and the command that it contains."""

    word: Word
    data: bytes


CONFLICT: Final = "conflicting action in progress"
NO_MOTION: Final = "no motion"
NOT_IN_MOTION: Final = "no motion in progress"
UNSUPPORTED: Final = "command not supported"
IMU_LOST: Final = "MPU6050 connection lost"
OBSTACLES: Final = frozenset(
    {
        "Insufficient front clearance.",
        "Insufficient rear clearance.",
        "insufficent clearence",
        "insufficient clearance",
    }
)
"""The failure texts for an obstacle, in all the server's spellings."""
NO_START: Final = "start timedout"
STARTING: Final = frozenset({CONFLICT, UNSUPPORTED, "", NO_START})
SLOW_STOPS: Final = frozenset({"stop timedout", "stop time out"})
STOPPING: Final = SLOW_STOPS | {NO_START}
GYRO: Final = "excessive gyro correct"
MOVING: Final = STARTING | STOPPING | OBSTACLES | {IMU_LOST, GYRO}

_OK, _INTEGER, _DECIMAL = ({form} for form in (Form.NOTHING, Form.INTEGER, Form.DECIMAL))


def _word(
    text: str,
    kind: Kind,
    forms: set[Form],
    takes_s: float,
    fails: frozenset[str] | set[str] = frozenset(),
    *,
    least_s: float = 0.0,
    channel: int = COMMAND,
) -> Word:
    return Word(text, kind, frozenset(forms), takes_s, least_s, channel, frozenset(fails))


# ENC: the encoder count; RMRA: the relative heading; SFC, SRC: the front and rear sonar
HELLO = _word("HELLO", Kind.QUERY, {Form.NAME}, 0.05)
ENC = _word("ENC", Kind.QUERY, _INTEGER, 0.25, {"", UNSUPPORTED})
RMRA = _word("RMRA", Kind.QUERY, _DECIMAL, 0.05)
VOLTS = _word("VOLTS", Kind.QUERY, _DECIMAL, 0.05, {""})
MCSTAT = _word("MCSTAT", Kind.QUERY, _INTEGER, 0.25)
DOCKED = _word("DOCKED", Kind.QUERY, {Form.TRUTH}, 0.05)
SFC = _word("SFC", Kind.QUERY, _INTEGER, 0.15, least_s=0.03)
SRC = _word("SRC", Kind.QUERY, _INTEGER, 0.15, least_s=0.03)
TD = _word("TD", Kind.QUERY, _INTEGER, 0.05, {"in progress"})

NO_IMU: Final = "could not init"
RESET = _word("RST IMU", Kind.CHECK, _OK, 0.3, {NO_IMU, CONFLICT, UNSUPPORTED}, least_s=0.09)
"""The command that checks the IMU without a motion.

If the check fails, the server does not use the IMU until this command succeeds. So the driver
repeats the command.
"""
CHECK = _word("MCR SLOW", Kind.CHECK, _OK, 0.8, MOVING, least_s=0.32)
"""The command that checks the IMU on servers that do not know RST IMU: a turn by 0 degrees.

Some servers start the motors on this command.
"""
SSP = _word("SSP", Kind.SERVICE, _OK, 0.05, {"command missing parameter", UNSUPPORTED})

# MCS writes the speeds of both motors; MSM ends the effect of MCS
MCS = _word("MCS", Kind.SERVICE, _OK, 0.05, {CONFLICT, UNSUPPORTED})
MSM = _word("MSM", Kind.SERVICE, _OK, 0.05, {UNSUPPORTED})

# RM drives forward, B backward; R and L turn on the spot
RM = _word("RM", Kind.START, _OK, 1.2, STARTING | OBSTACLES | {"improper command format"})
B = _word("B", Kind.START, _OK, 1.5, STARTING | OBSTACLES)
R = _word("R", Kind.START, _OK, 1.2, STARTING)
L = _word("L", Kind.START, _OK, 1.2, STARTING)

# RMCS changes RM, CS changes B
RMCS = _word("RMCS", Kind.CHANGE, _DECIMAL, 0.05, {NOT_IN_MOTION, ""} | OBSTACLES)
CS = _word("CS", Kind.CHANGE, _OK, 0.05, {"", NOT_IN_MOTION})

# SRM stops RM; SM stops B, R and L; SL and SS use the stop port
SRM = _word("SRM", Kind.HALT, _OK, 2.2, STOPPING | OBSTACLES | {NOT_IN_MOTION})
SM = _word("SM", Kind.HALT, _OK | _INTEGER, 2.2, STOPPING | OBSTACLES | {NO_MOTION, GYRO})
SL = _word("SL", Kind.HALT, set(), 0.0, channel=STOP)
SS = _word("SS", Kind.HALT, set(), 0.0, channel=STOP)

# controlled moves of a given length: TF and TB drive, MCR and MCL turn
TF = _word("TF", Kind.MOVE, _INTEGER, 80.0, MOVING | {"bad distance value"}, least_s=0.32)
TB = _word("TB", Kind.MOVE, _INTEGER, 80.0, MOVING | {"bad distance value"}, least_s=0.32)
MCR = _word("MCR", Kind.MOVE, _OK, 30.0, MOVING, least_s=0.32)
MCL = _word("MCL", Kind.MOVE, _OK, 30.0, MOVING, least_s=0.32)

SB = _word("SB", Kind.SERVICE, _OK, 5.0, {CONFLICT, ""}, least_s=0.32)
TIME = _word("TIME", Kind.SERVICE, _OK, 2.0)
LOG = _word("LOG", Kind.SERVICE, _OK, 2.0, {""})
NO_FILE: Final = "no file available"
LAST_MOVE = _word("LAST MOVE", Kind.SERVICE, {Form.FILE}, 2.0, {NO_FILE, ""})
LAST_TURN = _word("LAST TURN", Kind.SERVICE, {Form.FILE}, 2.0, {NO_FILE, ""})
EXIT = _word("EXIT", Kind.SERVICE, {Form.FILE, Form.NOTHING}, 2.0)

WORDS: Final = (
    *(HELLO, ENC, RMRA, VOLTS, MCSTAT, DOCKED, SFC, SRC, TD, RESET, CHECK, SSP, MCS, MSM),
    *(RM, B, R, L, RMCS, CS),
    *(SRM, SM, SL, SS, TF, TB, MCR, MCL, SB, TIME, LOG, LAST_MOVE, LAST_TURN, EXIT),
)
"""All commands that are described by a ``Word``. The driver sends each of them, except TD."""
KNOWN_FAILS: Final = frozenset(text for word in WORDS for text in word.fails if text)

NEVER_SAID: Final = {
    "F": "the driver uses RM instead, which drives forward and can also turn",
    "SDR": "limits a move without a target distance; the driver never starts such a move",
    "TFSFC": "undocumented; changes the distance from an obstacle at which the robot stops",
    "MNLV": "undocumented; reports a speed from calibration files; the encoder gives a better one",
    "MD": "undocumented; reports a distance that the server computes from time",
    "MCF": "undocumented; like the command TF, but does not check the clearance",
    "MCB": "does the same as the command TB; undocumented",
    "MCD": "does the same as the command TD; undocumented",
    "PTF": "undocumented; like the command TF, but the request also has gains of the controller",
    "SLMP": "undocumented; sets acceleration and speed of F and B",
    "SLPP": "undocumented; sets the gains of F and B",
    "REC START": "undocumented; records the IMU into a file",
    "REC STOP": "undocumented",
    "RST MC": "undocumented",
    "SFR": "undocumented; a request without the number ends the server",
    "SRR": "undocumented; a request without the number ends the server",
    "SSR": "undocumented; stops SFR and SRR",
    "SMCST": "undocumented; a test that moves the motors",
    "STPMCST": "undocumented",
}
"""Commands of the server that the driver does not use, each with the reason."""
