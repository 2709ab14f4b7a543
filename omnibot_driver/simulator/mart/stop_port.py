# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The stop port. Its commands work while the command port is busy, and are never answered.

This module does not know the commands of the command port.
"""

from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart import wire
from omnibot_driver.simulator.mart.alarms import stop_motors
from omnibot_driver.simulator.mart.motion import Kind, Motion
from omnibot_driver.simulator.mart.state import STOP

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

DRIVES = (Kind.LINEAR, Kind.MEASURED_LINEAR, Kind.CONTROLLED_LINEAR, Kind.REFERENCE)
SPINS = (Kind.SPIN, Kind.CONTROLLED_SPIN)
CONTROLLED = (Kind.CONTROLLED_LINEAR, Kind.MEASURED_LINEAR, Kind.CONTROLLED_SPIN)


def obey(server: "MartServer", text: str) -> None:
    """Execute SL (stops a drive), SS (stops a spin) or SDR (limits a move)."""
    quirks = server.quirks
    if text == "SL":
        _stop_first(server, DRIVES)
    elif text == "SS":
        drives = (Kind.LINEAR, Kind.REFERENCE) if quirks.spin_stop_ends_drives else ()
        _stop_first(server, (*SPINS, *drives))
    elif text.startswith("SDR"):
        _limit(server, text)


def end_motion(server: "MartServer", motion: Motion) -> bool:
    """Stop a drive (F, B, RM) or a spin (R, L). Return whether to wait for the end of the motion.

    No motor is stopped if the motion is already stopping, or if ``alarms`` no longer watches the
    drive.
    """
    if motion.kind is Kind.SPIN:
        if motion.stopping:
            return False
    elif motion.stopping:
        return True
    elif not motion.watching:
        motion.posts = max(0, motion.posts - 1)
        return False
    motion.posts = max(0, motion.posts - 1)
    stop_motors(server, motion)
    return True


def _stop_first(server: "MartServer", kinds: tuple[Kind, ...]) -> None:
    quirks = server.quirks
    if not quirks.early_stop_is_ignored and server.starting in kinds:
        controlled = server.starting in CONTROLLED
        if not (controlled and server.alarm is server.starting):
            server.abort("ok 0" if controlled else "fail stopped")
            return
    motion = next((server.motions[kind] for kind in kinds if server.motions[kind].running), None)
    if motion is None:
        return
    kind = motion.kind
    if kind in CONTROLLED:
        if not motion.stopping:
            stop_motors(server, motion)
    elif quirks.stop_port_keeps_motion or kind is Kind.SPIN:
        if end_motion(server, motion):
            server.wait(STOP, kind, None)
    elif not motion.stopping and motion.watching:
        motion.released = True
        stop_motors(server, motion)


def _limit(server: "MartServer", text: str) -> None:
    """Execute SDR: give an unlimited move a limit.

    ``text``: the command with a distance in inches, which counts from the place where the move
    began.
    """
    motion = next(
        (each for each in server.motions if each.running and each.kind in DRIVES[1:3]), None
    )
    behind = wire.fields(text)
    if motion is None:
        return
    if behind:
        if not motion.limited:
            motion.limit(wire.integer(behind[0]))
    elif server.quirks.crashes_on_missing_numbers:
        server.end("SDR without a number")
