# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands of the command port: how they are recognised and checked, and their replies.

The first row that fits a request is used. This module does not know how a motion proceeds.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from omnibot_driver.simulator.mart import moves, service_commands, wire
from omnibot_driver.simulator.mart.motion import CONFLICT, NOT_SUPPORTED, SPEEDS, Kind

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

Handler = Callable[["MartServer", str], str | None]
"""Function that executes a command.

It returns the reply, or None if the reply comes later or never.
"""

NEED_ALL = ("VOLTS", "RM ", "MCF", "MCB", "TF", "PTF", "TB", "R", "L", "MCR", "MCL")
"""Commands that crash a server that is still starting up."""
MISSNG, MISSING = "fail command missng parameter", "fail command missing parameter"
BAD_FORMAT = "fail improper command format"
BAD_DISTANCE = "fail bad distance value"


class Row(NamedTuple):
    """A command and its handler.

    * ``word``: the complete command, or its beginning if ``begins``.
    * ``moves``: whether a motion, a recording or direct control of the motors (MCS) blocks the
      command.
    """

    word: str
    handler: Handler
    begins: bool = True
    moves: bool = False


def execute(server: "MartServer", text: str) -> str | None:
    """Begin a command. Return its reply, or None if the reply comes later or never."""
    if not server.quirks.undocumented_commands and _is_undocumented(text):
        return NOT_SUPPORTED
    for word, handler, begins, is_motion in ROWS:
        if text.startswith(word) if begins else text == word:
            if is_motion and server.conflict:
                return CONFLICT
            if server.starts_up and server.quirks.crashes_early and word in NEED_ALL:
                server.end(f"{text} before all was ready")
                return None
            return handler(server, text)
    return NOT_SUPPORTED


def _is_undocumented(text: str) -> bool:
    return text.startswith(UNDOCUMENTED)


def _linear(server: "MartServer", text: str) -> str | None:
    word = text[2:] if text[1:2] == " " else ("NORMAL" if len(text) == 1 else "")
    if word not in SPEEDS:
        return NOT_SUPPORTED
    moves.start_linear(server, word, backward=text[0] == "B")
    return None


def _spin(server: "MartServer", text: str) -> str | None:
    if text[0] == "L" and _refuses_left_spin(server):
        return CONFLICT
    word = text[2:] if text[1:2] == " " else ("NORMAL" if len(text) == 1 else "")
    custom = word == "CUSTOM" and server.quirks.undocumented_commands
    if word not in ("NORMAL", "SLOW") and not custom:
        return NOT_SUPPORTED
    moves.start_spin(server, word, left=text[0] == "L")
    return None


def _refuses_left_spin(server: "MartServer") -> bool:
    """Return whether a motion, a recording or manual control (MCS) prevents the left spin (L).

    With the quirk ``left_spin_in_reference_move``, the forward drive RM does not prevent the spin.
    """
    if not server.quirks.left_spin_in_reference_move:
        return server.conflict
    others = [each for each in server.motions if each.kind is not Kind.REFERENCE]
    return server.manual or server.recording or any(each.running for each in others)


def _timed(server: "MartServer", text: str) -> str | None:
    """Start a straight controlled move (TF, TB) by a distance in inches.

    An optional speed word precedes the distance; without the quirk ``speed_word_first``, the word
    may also follow the distance.
    """
    server.motions[Kind.CONTROLLED_LINEAR].reported_in = 0.0
    behind = text[2:]
    word, no_clearance, docking = "NORMAL", False, False
    for head in (" NORMAL", " SLOW NCC", " SLOW", " DOCK"):
        if behind.startswith(head) and not (head == " DOCK" and text[1] == "B"):
            word = "NORMAL" if head == " NORMAL" else "SLOW"
            docking = head == " DOCK"
            no_clearance = docking or head == " SLOW NCC"
            behind = behind[len(head) :]
            break
    numbers = wire.fields(behind)
    if not numbers:
        return MISSNG
    inches = wire.integer(numbers[0])
    if inches < 0 or (inches == 0 and not server.quirks.zero_distance_is_unlimited):
        return BAD_DISTANCE
    if not server.quirks.speed_word_first and text.endswith((" SLOW", " DOCK")):
        word, docking = "SLOW", text.endswith(" DOCK")
        no_clearance = docking
    moves.start_controlled(
        server,
        inches,
        word,
        backward=text[1] == "B",
        docking=docking,
        no_clearance=no_clearance,
    )
    return None


def _controlled_spin(server: "MartServer", text: str) -> str | None:
    """Start a spin by an angle in degrees (MCR, MCL)."""
    slow = text[3:].startswith(" SLOW")
    numbers = wire.fields(text[8:] if slow else text)
    if not numbers:
        return MISSING
    if not server.quirks.speed_word_first:
        slow = slow or text.endswith(" SLOW")
        if numbers[0].startswith("NORMAL "):
            numbers = numbers[1:]
    angle_deg = wire.integer(numbers[0])
    word = "SLOW" if slow else "NORMAL"
    moves.start_controlled_spin(server, angle_deg, word, left=text[2] == "L")
    return None


def _reference(server: "MartServer", text: str) -> str | None:
    speed = wire.integer(text[3:])
    if not (server.quirks.reference_speed_wraps or 1 <= speed <= 127):
        return BAD_FORMAT
    moves.start_reference(server, speed)
    return None


def _change_reference(server: "MartServer", text: str) -> str | None:
    motion = server.motions[Kind.REFERENCE]
    if not motion.running:
        return "fail no motion in progress"
    numbers = wire.fields(text)
    if len(numbers) < 2:
        return BAD_FORMAT
    if moves.change_reference(server, wire.integer(numbers[0]), wire.integer(numbers[1])):
        return wire.degrees(server.heading_deg())
    return f"fail {motion.error}"


def _stop_reference(server: "MartServer", text: str) -> str | None:
    if not server.motions[Kind.REFERENCE].running:
        return "fail no motion in progress"
    moves.stop(server, Kind.REFERENCE)
    return None


def _stop(server: "MartServer", text: str) -> str | None:
    for kind in (Kind.LINEAR, Kind.SPIN):
        if server.motions[kind].running:
            moves.stop(server, kind)
            return None
    return "fail no motion"


def _change_linear(server: "MartServer", text: str) -> str | None:
    if not server.motions[Kind.LINEAR].running:
        return "fail"
    numbers = wire.fields(text)
    if len(numbers) < 2:
        return service_commands.missing(server, "CS with one number")
    changed = moves.change_linear(server, wire.integer(numbers[0]), wire.integer(numbers[1]))
    return "ok" if changed else "fail"


def _measured(server: "MartServer", text: str) -> str | None:
    """Start a move whose distance the server measures by the accelerometer (MCF, MCB).

    The move is simulated like TF or TB, a straight controlled move forward or backward.
    """
    numbers = wire.fields(text)
    if not numbers:
        return MISSNG if text[2] == "F" else MISSING
    inches = wire.integer(numbers[0])
    if inches <= 0 and not server.quirks.zero_distance_is_unlimited:
        return BAD_DISTANCE
    moves.start_controlled(
        server,
        inches,
        "NORMAL",
        kind=Kind.MEASURED_LINEAR,
        backward=text[2] == "B",
    )
    return None


def _tuned(server: "MartServer", text: str) -> str | None:
    """Start a straight move with gains (PTF). The request has a distance in inches and three gains.

    The gains have no effect in the simulation.
    """
    slow = text.startswith("PTF SLOW")
    behind = text[len("PTF SLOW") if slow else len("PTF") :].removeprefix(" NORMAL")
    numbers = wire.fields(behind)
    if len(numbers) < 4:
        return MISSNG
    word = "SLOW" if slow else "NORMAL"
    moves.start_controlled(server, wire.integer(numbers[0]), word, plain=True)
    return None


def _last_distance(server: "MartServer", text: str) -> str | None:
    if server.motions[Kind.CONTROLLED_LINEAR].running:
        return "fail in progress"
    return f"ok {moves.last_distance_in(server)}"


def _clearance(server: "MartServer", text: str) -> str | None:
    """Set the front clearance in inches (TFSFC).

    A wall that is nearer than the clearance stops the next forward move (TF).
    """
    server.motions[Kind.CONTROLLED_LINEAR].clearance_in = wire.integer(text[6:])
    return "ok"


def _parameters(name: str, wrong: str) -> Handler:
    """Return the handler of a command that stores an acceleration and a speed (SLMP, SSP)."""

    def handle(server: "MartServer", text: str) -> str | None:
        numbers = wire.fields(text)
        if len(numbers) < 2:
            return wrong
        server.custom[name] = (wire.integer(numbers[0]), wire.integer(numbers[1]))
        return "ok"

    return handle


def _gains(server: "MartServer", text: str) -> str | None:
    """Accept three gains (SLPP). They have no effect in the simulation."""
    return "ok" if len(wire.fields(text)) >= 3 else MISSNG


service = service_commands
ROWS = (
    Row("EXIT", service.leave, begins=False),
    Row("LAST MOVE", service.last_file("MOVE"), begins=False),
    Row("LAST TURN", service.last_file("TURN"), begins=False),
    Row("LAST IMU RCD", service.last_file("RECORD"), begins=False),
    Row("LAST SONAR RECORD", service.last_file("RECORD"), begins=False),
    Row("TIME ", service.set_time),
    Row("LOG", service.open_log, begins=False),
    Row("VOLTS", service.volts, begins=False),
    Row("MCSTAT", service.motor_status, begins=False),
    Row("ENC", service.encoder, begins=False),
    Row("RST ", service.reset, moves=True),
    Row("SB", service.take_bias, begins=False, moves=True),
    Row("RM ", _reference, moves=True),
    Row("RMCS ", _change_reference),
    Row("SRM", _stop_reference, begins=False),
    Row("RMRA", service.heading, begins=False),
    Row("SMCST", service.fine, begins=False, moves=True),
    Row("STPMCST", service.fine, begins=False),
    Row("REC START", service.start_record, begins=False, moves=True),
    Row("REC STOP", service.stop_record, begins=False),
    Row("F", _linear, moves=True),
    Row("SLMP", _parameters("linear", MISSNG)),
    Row("SLPP", _gains),
    Row("B", _linear, moves=True),
    Row("MCF", _measured, moves=True),
    Row("MCB", _measured, moves=True),
    Row("MCD", service.last_measured),
    Row("TFSFC", _clearance),
    Row("TF", _timed, moves=True),
    Row("PTF", _tuned, moves=True),
    Row("TB", _timed, moves=True),
    Row("TD", _last_distance),
    Row("R", _spin, moves=True),
    Row("L", _spin),
    Row("SSP", _parameters("spin", MISSING)),
    Row("MCR", _controlled_spin, moves=True),
    Row("MCL", _controlled_spin, moves=True),
    Row("SM", _stop, begins=False),
    Row("CS ", _change_linear),
    Row("MCS ", service.set_motors, moves=True),
    Row("MSM", service.stop_motors, begins=False),
    Row("SFC", service.sonar(backward=False), begins=False),
    Row("SRC", service.sonar(backward=True), begins=False),
    Row("SFR", service.record_sonar),
    Row("SRR", service.record_sonar),
    Row("SSR", service.fine, begins=False),
    Row("MNLV", service.bare_fail, begins=False),
    Row("MD", service.last_measured, begins=False),
    Row("MFC", service.fine),
    Row("DOCKED", service.docked, begins=False),
    Row("HELLO", service.hello, begins=False),
)
UNDOCUMENTED = (
    "LAST IMU RCD", "LAST SONAR RECORD", "RST ", "SMCST", "STPMCST", "REC ", "SLMP", "SLPP",
    "MCF", "MCB", "MCD", "TFSFC", "PTF", "SSP", "MCS ", "MSM", "SFR", "SRR", "SSR", "MNLV", "MD",
    "MFC",
)  # fmt: skip
