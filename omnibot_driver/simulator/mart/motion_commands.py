# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands that start, change or stop a motion, or set what the next motion uses.

Each command is checked here, and its reply chosen. This module does not know how the server
recognises a command, or how a motion proceeds.
"""

from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart import moves, wire
from omnibot_driver.simulator.mart.motion import CONFLICT, NOT_SUPPORTED, SPEEDS, Kind
from omnibot_driver.simulator.mart.service_commands import Handler, missing

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

MISSNG, MISSING = "fail command missng parameter", "fail command missing parameter"
BAD_FORMAT = "fail improper command format"
BAD_DISTANCE = "fail bad distance value"


def _speed_word(text: str) -> str:
    """Return the speed word after the single letter of a command; empty if other text follows."""
    return text[2:] if text[1:2] == " " else ("NORMAL" if len(text) == 1 else "")


def linear(server: "MartServer", text: str) -> str | None:
    """Start an uncontrolled move (F, B), by a speed word or at the speed NORMAL."""
    word = _speed_word(text)
    if word not in SPEEDS:
        return NOT_SUPPORTED
    moves.start_linear(server, word, backward=text[0] == "B")
    return None


def spin(server: "MartServer", text: str) -> str | None:
    """Start an uncontrolled spin (R, L), by a speed word or at the speed NORMAL."""
    if text[0] == "L" and _refuses_left_spin(server):
        return CONFLICT
    word = _speed_word(text)
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


def timed(server: "MartServer", text: str) -> str | None:
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


def controlled_spin(server: "MartServer", text: str) -> str | None:
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


def reference(server: "MartServer", text: str) -> str | None:
    """Start a forward drive (RM) at a speed in motor units."""
    speed = wire.integer(text[3:])
    if not (server.quirks.reference_speed_wraps or 1 <= speed <= 127):
        return BAD_FORMAT
    moves.start_reference(server, speed)
    return None


def change_reference(server: "MartServer", text: str) -> str | None:
    """Change the motor speeds in a forward drive (RMCS). Reply with the relative heading."""
    motion = server.motions[Kind.REFERENCE]
    if not motion.running:
        return "fail no motion in progress"
    numbers = wire.fields(text)
    if len(numbers) < 2:
        return BAD_FORMAT
    if moves.change_reference(server, wire.integer(numbers[0]), wire.integer(numbers[1])):
        return wire.degrees(server.heading_deg())
    return f"fail {motion.error}"


def stop_reference(server: "MartServer", text: str) -> str | None:
    """Stop a forward drive (SRM)."""
    if not server.motions[Kind.REFERENCE].running:
        return "fail no motion in progress"
    moves.stop(server, Kind.REFERENCE)
    return None


def stop(server: "MartServer", text: str) -> str | None:
    """Stop an uncontrolled move or spin (SM)."""
    for kind in (Kind.LINEAR, Kind.SPIN):
        if server.motions[kind].running:
            moves.stop(server, kind)
            return None
    return "fail no motion"


def change_linear(server: "MartServer", text: str) -> str | None:
    """Change both motors in an uncontrolled move (CS)."""
    if not server.motions[Kind.LINEAR].running:
        return "fail"
    numbers = wire.fields(text)
    if len(numbers) < 2:
        return missing(server, "CS with one number")
    changed = moves.change_linear(server, wire.integer(numbers[0]), wire.integer(numbers[1]))
    return "ok" if changed else "fail"


def measured(server: "MartServer", text: str) -> str | None:
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


def tuned(server: "MartServer", text: str) -> str | None:
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


def last_distance(server: "MartServer", text: str) -> str | None:
    """Answer with the distance of the last straight controlled move, in inches (TD)."""
    if server.motions[Kind.CONTROLLED_LINEAR].running:
        return "fail in progress"
    return f"ok {moves.last_distance_in(server)}"


def clearance(server: "MartServer", text: str) -> str | None:
    """Set the front clearance in inches (TFSFC).

    A wall that is nearer than the clearance stops the next forward move (TF).
    """
    server.motions[Kind.CONTROLLED_LINEAR].clearance_in = wire.integer(text[6:])
    return "ok"


def parameters(name: str, wrong: str) -> Handler:
    """Return the handler of a command that stores an acceleration and a speed (SLMP, SSP)."""

    def handle(server: "MartServer", text: str) -> str | None:
        numbers = wire.fields(text)
        if len(numbers) < 2:
            return wrong
        server.custom[name] = (wire.integer(numbers[0]), wire.integer(numbers[1]))
        return "ok"

    return handle


def gains(server: "MartServer", text: str) -> str | None:
    """Accept three gains (SLPP). They have no effect in the simulation."""
    return "ok" if len(wire.fields(text)) >= 3 else MISSNG
