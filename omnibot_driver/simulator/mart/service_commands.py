# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The commands that do not start a motion: queries, clock, log, files, direct motor control.

This module does not know how the server recognises a command.
"""

import calendar
from collections.abc import Callable
from typing import TYPE_CHECKING

from omnibot_driver.simulator.mart import moves, wire
from omnibot_driver.simulator.mart.motion import (
    FRONT_CLEARANCE_IN,
    NOT_SUPPORTED,
    REAR_CLEARANCE_IN,
)

if TYPE_CHECKING:
    from omnibot_driver.simulator.mart.server import MartServer

BOARD_S, BOARD_SILENT_S = 0.005, 0.2
SONAR_S = 0.055
RESET_S, RESET_FAILS_S = 0.11, 0.13
BIAS_SAMPLES = 50
NO_READ = 255

Handler = Callable[["MartServer", str], str | None]
"""Function that executes a command.

It returns the reply, or None if the reply comes later or never.
"""


def missing(server: "MartServer", what: str) -> str | None:
    """Refuse a command that has too few numbers.

    With the quirk ``crashes_on_missing_numbers``, the server ends instead. ``what``: the cause,
    which the simulator records.
    """
    if not server.quirks.crashes_on_missing_numbers:
        return "fail improper command format"
    server.end(what)
    return None


def fine(server: "MartServer", text: str) -> str | None:
    """Accept a command that has no effect in the simulation (SMCST, STPMCST, SSR, MFC)."""
    return "ok"


def bare_fail(server: "MartServer", text: str) -> str | None:
    """Answer ``fail`` to MNLV, which needs calibration files that the server does not have."""
    return "fail"


def hello(server: "MartServer", text: str) -> str | None:
    """Answer with the server's name."""
    return "ok BBB"


def volts(server: "MartServer", text: str) -> str | None:
    """Answer with the voltage of the battery in V."""
    return f"ok {server.chassis.volts:.2f}"


def docked(server: "MartServer", text: str) -> str | None:
    """Answer whether the dock switch is pressed."""
    return "ok true" if server.docked else "ok false"


def heading(server: "MartServer", text: str) -> str | None:
    """Answer with the relative heading in degrees (RMRA)."""
    return wire.degrees(server.heading_deg())


def last_measured(server: "MartServer", text: str) -> str | None:
    """Answer 0 to MCD and MD. The distances that they report are not simulated."""
    return "ok 0"


def _ask_board(server: "MartServer", then: Callable[["MartServer"], None]) -> None:
    server.later(BOARD_SILENT_S if server.chassis.silent else BOARD_S, then)


def encoder(server: "MartServer", text: str) -> str | None:
    """Answer ENC with the encoder count, or with ``fail`` if the motor board is silent."""
    _ask_board(server, _tell_encoder)
    return None


def _tell_encoder(server: "MartServer") -> None:
    server.answer("fail" if server.chassis.silent else f"ok {server.chassis.encoder}")


def motor_status(server: "MartServer", text: str) -> str | None:
    """Answer MCSTAT with the status bits of the motor board. If the board is silent, answer 255."""
    _ask_board(server, _tell_status)
    return None


def _tell_status(server: "MartServer") -> None:
    chassis = server.chassis
    server.answer(f"ok {NO_READ if chassis.silent else chassis.error_bits}")


def sonar(*, backward: bool) -> Handler:
    """Return the handler of a sonar query (SFC: front, SRC: rear).

    The handler reads the sonar once, or three times if an obstacle is near.
    """

    def handle(server: "MartServer", text: str) -> str | None:
        least = REAR_CLEARANCE_IN if backward else FRONT_CLEARANCE_IN
        near = 0 < server.sonar_in(backward=backward) <= least
        readings = 3 if near else 1
        server.later(readings * SONAR_S, _tell_rear if backward else _tell_front)
        return None

    return handle


def _tell_front(server: "MartServer") -> None:
    server.answer(f"ok {server.sonar_in(backward=False)}")


def _tell_rear(server: "MartServer") -> None:
    server.answer(f"ok {server.sonar_in(backward=True)}")


def record_sonar(server: "MartServer", text: str) -> str | None:
    """Accept a recording of the sonar (SFR, SRR). Its file is not simulated."""
    return "ok" if wire.fields(text) else missing(server, f"{text} without a number")


def take_bias(server: "MartServer", text: str) -> str | None:
    """Measure the gyro bias (SB). An IMU that the server has stopped using is opened first.

    SB fails if this IMU does not answer.
    """
    imu = server.imu
    if imu.closed and not imu.plugged(server.now_s):
        server.later(RESET_FAILS_S, _fail)
        return None
    imu.closed = False
    server.later(BOARD_S, moves.take_bias, None, BIAS_SAMPLES, 0)
    return None


def _fail(server: "MartServer") -> None:
    server.answer("fail")


def reset(server: "MartServer", text: str) -> str | None:
    """Reset the IMU or the motor board (RST IMU, RST MC)."""
    if text == "RST IMU":
        plugged = server.imu.plugged(server.now_s)
        server.imu.closed = True
        server.later(RESET_S if plugged else RESET_FAILS_S, _reset_imu)
        return None
    if text == "RST MC":
        _ask_board(server, _reset_board)
        return None
    if not server.quirks.unknown_reset_repeats:
        return NOT_SUPPORTED
    if server.last_reply:
        return server.last_reply
    server.done()
    return None


def _reset_imu(server: "MartServer") -> None:
    server.imu.closed = not server.imu.plugged(server.now_s)
    server.answer("fail could not init" if server.imu.closed else "ok")


def _reset_board(server: "MartServer") -> None:
    chassis = server.chassis
    wrong = chassis.silent or chassis.error_bits
    server.answer("fail error condition" if wrong else "ok")


def set_time(server: "MartServer", text: str) -> str | None:
    """Set the clock in UTC (TIME m d yyyy h mi s). The seconds are ignored."""
    numbers = [wire.integer(word) for word in text.split(" ")[1:] if word]
    if len(numbers) < 6:
        return missing(server, "TIME with fewer than six numbers")
    month, day, year, hour, minute, _ = numbers[:6]
    before_s = server.clock_s
    if 1 <= month <= 12 and 1 <= day <= 31 and 1970 <= year <= 9999:
        wanted_s = calendar.timegm((year, month, day, hour, minute, 0))
        server.clock_offset_s += wanted_s - before_s
    if server.alarm is not None and server.quirks.clock_moves_heading:
        jump_s = server.clock_s - before_s
        server.imu.heading_deg += server.imu.rate_dps * jump_s
        server.motions[server.alarm].angle_deg += server.imu.rate_dps * jump_s
    return "ok"


def open_log(server: "MartServer", text: str) -> str | None:
    """Open the log (LOG). A log that is already open stays open."""
    if server.log is None:
        if server.quirks.log_deletes_files:
            server.files.clear()
        server.log_name = f"MotionController{int(server.clock_s)}.log"
        server.log = [f"{server.date} Motion controller log file opened"]
    return "ok"


def last_file(which: str) -> Handler:
    """Return the handler that sends the last file of a kind (LAST MOVE, LAST TURN)."""

    def handle(server: "MartServer", text: str) -> str | None:
        name = server.last_files.get(which)
        if name is None:
            return "fail no file available"
        note = server.files.get(name)
        if note is None:
            return "fail"
        for block in wire.blocks(name, note.content):
            server.send(block)
        server.last_reply = ""
        server.done()
        return None

    return handle


def leave(server: "MartServer", text: str) -> str | None:
    """End the program (EXIT). If a log is open, send the log first."""
    if server.log is not None:
        content = (
            "\n".join([*server.log, f"{server.date} UDP server shutting down"]) + "\n"
        ).encode("latin-1")
        server.log = None
        for block in wire.blocks(server.log_name, content):
            server.send(block)
    elif not server.quirks.exit_is_silent:
        server.send(wire.reply("ok"))
    server.end("EXIT")
    return None


def start_record(server: "MartServer", text: str) -> str | None:
    """Begin a recording (REC START). Its file is not simulated."""
    server.recording = True
    return "ok"


def stop_record(server: "MartServer", text: str) -> str | None:
    """End a recording (REC STOP)."""
    server.recording = False
    return "ok"


def set_motors(server: "MartServer", text: str) -> str | None:
    """Write two numbers to the motor registers, the right one first (MCS)."""
    numbers = wire.fields(text)
    if len(numbers) < 2:
        return missing(server, "MCS with one number")
    server.manual = True
    server.drive(wire.integer(numbers[0]), wire.integer(numbers[1]))
    return "ok"


def stop_motors(server: "MartServer", text: str) -> str | None:
    """Stop motors whose registers the command MCS has set (MSM)."""
    if server.manual:
        server.manual = False
        server.drive(128, 128)
    return "ok"
