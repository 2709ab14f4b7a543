# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Saves a record of the LOIS ECU as a CSV file, completely or not at all.

This module knows neither ROS nor the board's lines.
"""

import csv
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import zip_longest
from pathlib import Path
from typing import Final

from omnibot_driver.core.lois_ecu import RecordKind
from omnibot_driver.core.lois_ecu.readings import RecordReading
from omnibot_driver.files import write_whole

SATURATED: Final = 0xFFFF
"""Timer count that the board reports if the time from one encoder tick to the next does not fit
into 16 bits."""

Row = tuple[object, ...]


def table(reading: RecordReading) -> Iterator[Row]:
    """Yield the header of the file, then one row for each sample.

    Headings are in degrees, clockwise from magnetic north. The scale of the torques is unknown.
    Unknown values are empty.
    """
    record = reading.record
    if record.kind is RecordKind.HEADING:
        yield "sample", "heading_deg"
        yield from enumerate(record.left)
        return
    pairs = enumerate(zip_longest(record.left, record.right, fillvalue=""))
    if record.kind is RecordKind.TORQUE:
        yield "sample", "left_adc_counts", "right_adc_counts"
        yield from ((number, left, right) for number, (left, right) in pairs)
        return
    yield (
        *("sample", "left_tick_s", "right_tick_s", "left_rpm", "right_rpm"),
        *("left_counts", "right_counts"),
    )
    for number, pair in pairs:
        ticks_s = [_tick_s(count, reading.count_s) for count in pair]
        rpms = [_rpm(tick_s, reading.ticks_per_revolution) for tick_s in ticks_s]
        yield (
            number,
            *("" if tick_s is None else f"{tick_s:.7f}" for tick_s in ticks_s),
            *rpms,
            *pair,
        )


def remark(reading: RecordReading) -> str:
    """Return a sentence that says what is missing in the file; empty if nothing is missing."""
    if reading.record.kind is not RecordKind.RPM:
        return ""
    if reading.count_s is None:
        return (
            "the record's file has only the board's timer counts, without times and speeds, because"
            " the driver does not know the unit of the board's clock yet"
        )
    slow = (*reading.record.left, *reading.record.right).count(SATURATED)
    if not slow:
        return ""
    longest_s = SATURATED * reading.count_s
    ticks = f"{slow} tick{'' if slow == 1 else 's'}"
    return (
        f"{ticks} of the record took longer than {longest_s:.4g} s, the longest time that the"
        " board can report"
    )


def file_name(kind: RecordKind, at_s: float) -> str:
    """Return the file name of a record that ended at ``at_s``, in s of UTC since 1970."""
    return f"{kind.value}_{datetime.fromtimestamp(at_s, UTC):%Y%m%dT%H%M%S_%f}.csv"


def save(reading: RecordReading, path: Path, wanted: Callable[[], bool] = lambda: True) -> bool:
    """Write the record to ``path``; return whether ``path`` was written. Raises OSError.

    ``wanted``: called before the file at ``path`` is replaced; if it returns False, that file
    stays.
    """
    rows = table(reading)
    return write_whole(
        path, lambda file: csv.writer(file, lineterminator="\n").writerows(rows), wanted=wanted
    )


def _tick_s(count: object, count_s: float | None) -> float | None:
    if count_s is None or not isinstance(count, int) or count in (0, SATURATED):
        return None
    return count * count_s


def _rpm(tick_s: float | None, ticks_per_revolution: int) -> str:
    return "" if tick_s is None else f"{60 / (tick_s * ticks_per_revolution):.2f}"
