# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Reports that a LOIS ECU sends during a drive, and the bytes that encode them, with times."""

import math
import struct
from functools import cache
from random import Random

from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    GpsDate,
    GpsPosition,
    GpsTime,
    Heading,
    LoisDecoder,
    Ticks,
    encode_report,
)
from omnibot_driver.core.lois_ecu.messages import Report

Piece = tuple[float, bytes]


def float32(number: float) -> float:
    """Return the number rounded to a 32-bit float, which is the precision of the board's lines."""
    (rounded,) = struct.unpack(">f", struct.pack(">f", number))
    return float(rounded)


@cache
def reports(seconds: float, *, firmware: bool) -> list[tuple[float, Report]]:
    """Return the reports of a drive along a curve at 0.5 m/s, with their times in s.

    Position, time and date come every 1.2 s.
    """
    said: list[tuple[float, Report]] = []
    for step in range(1, int(seconds / 0.4) + 1):
        at = 0.4 * step
        yaw = 0.2 * at
        x, y = 2.5 * math.sin(yaw), 2.5 * (1 - math.cos(yaw))
        dx, dy = 0.5 * math.cos(yaw), 0.5 * math.sin(yaw)
        time_counts = int(at * (960 if firmware else 1e9)) % 2**32
        numbers = [float32(number) for number in (x, y, yaw, dx, dy, 0.2)]
        said.append((at, Ticks(time_counts, int(33 * at), int(40 * at))))
        if firmware:
            said.append((at, BoardOdometry(*numbers, appended=True)))
        said.append((at, BoardOdometry(*numbers)))
        said.append((at, Heading(round(math.degrees(-yaw)) % 360 - 180)))
        if step % 3 == 0:
            said.append((at, GpsPosition(float32(48.1 + 1e-5 * x), float32(11.5 + 1e-5 * y))))
            said.append((at, GpsTime(12, 30 + int(at) // 60, int(at) % 60)))
            said.append((at, GpsDate(26, 11, 22)))
    return said


def pieces(said: list[tuple[float, Report]]) -> list[Piece]:
    """Return the bytes of each report with the report's time."""
    return [(at, encode_report(report)) for at, report in said]


def decoded(given: list[Piece], *, sum_required: bool = True) -> tuple[list[Report], LoisDecoder]:
    """Decode the pieces with a new decoder. Return all reports found, and the decoder."""
    decoder = LoisDecoder(sum_required=sum_required)
    found: list[Report] = []
    for at, data in given:
        found += decoder.feed(data, at)
    found += decoder.flush(given[-1][0] if given else 0.0)
    return found, decoder


def lossy(given: list[Piece], chance: float, random: Random) -> list[Piece]:
    """Return the pieces without the lost bytes. Each byte is lost with probability ``chance``."""
    draw = random.random
    return [(at, bytes([byte for byte in data if draw() >= chance])) for at, data in given]
