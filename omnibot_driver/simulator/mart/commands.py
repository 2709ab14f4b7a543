# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The table of the command port's commands: how each is recognised, and what blocks it.

The first row that fits a request is used. This module does not know what a command does.
"""

from typing import TYPE_CHECKING, NamedTuple

from omnibot_driver.simulator.mart import motion_commands as motion
from omnibot_driver.simulator.mart import service_commands as service
from omnibot_driver.simulator.mart.motion import CONFLICT, NOT_SUPPORTED
from omnibot_driver.simulator.mart.service_commands import Handler

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

NEED_ALL = ("VOLTS", "RM ", "MCF", "MCB", "TF", "PTF", "TB", "R", "L", "MCR", "MCL")
"""Commands that crash a server that is still starting up."""


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
    if not server.quirks.undocumented_commands and text.startswith(UNDOCUMENTED):
        return NOT_SUPPORTED
    for word, handler, begins, is_motion in ROWS:
        if text.startswith(word) if begins else text == word:
            if is_motion and server.conflict:
                return CONFLICT
            if server.starts_up and server.quirks.crashes_early and word in NEED_ALL:
                server.end(f"{text} during start-up")
                return None
            return handler(server, text)
    return NOT_SUPPORTED


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
    Row("RM ", motion.reference, moves=True),
    Row("RMCS ", motion.change_reference),
    Row("SRM", motion.stop_reference, begins=False),
    Row("RMRA", service.heading, begins=False),
    Row("SMCST", service.fine, begins=False, moves=True),
    Row("STPMCST", service.fine, begins=False),
    Row("REC START", service.start_record, begins=False, moves=True),
    Row("REC STOP", service.stop_record, begins=False),
    Row("F", motion.linear, moves=True),
    Row("SLMP", motion.parameters("linear", motion.MISSNG)),
    Row("SLPP", motion.gains),
    Row("B", motion.linear, moves=True),
    Row("MCF", motion.measured, moves=True),
    Row("MCB", motion.measured, moves=True),
    Row("MCD", service.last_measured),
    Row("TFSFC", motion.clearance),
    Row("TF", motion.timed, moves=True),
    Row("PTF", motion.tuned, moves=True),
    Row("TB", motion.timed, moves=True),
    Row("TD", motion.last_distance),
    Row("R", motion.spin, moves=True),
    Row("L", motion.spin),
    Row("SSP", motion.parameters("spin", motion.MISSING)),
    Row("MCR", motion.controlled_spin, moves=True),
    Row("MCL", motion.controlled_spin, moves=True),
    Row("SM", motion.stop, begins=False),
    Row("CS ", motion.change_linear),
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
