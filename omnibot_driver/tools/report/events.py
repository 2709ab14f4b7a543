# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judges what the driver reported: its states, the e-stop, and /diagnostics."""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from typing import Final

from omnibot_driver.tools.report.findings import Finding, Level, counted, span
from omnibot_driver.tools.report.log import Log, Span, Status

LEVELS: Final = ("OK", "WARN", "ERROR", "STALE")
FIRST_SECONDS: Final = 3.0
"""Length in s of the beginning of a log, in which the driver may still be connecting."""
OUT_OF_REACH: Final = ("disconnected", "connecting")
LONG_OUT_OF_REACH: Final = 0.1
SILENT_S: Final = 2.0
"""Time in s after the start of a log's last state. If /diagnostics shows the state even later, this
proves that the driver was running. Without this proof, a last state "disconnected" means that the
driver had ended."""


def judge(log: Log) -> Iterator[Finding]:
    """Judge what the driver reported: states, e-stop and diagnostics, in this order."""
    yield from _states(log)
    yield from _estop(log)
    yield from _diagnostics(log)


def _states(log: Log) -> Iterator[Finding]:
    if not log.states:
        return
    lengths: dict[str, float] = {}
    states = list(log.states)
    if len(states) > 1 and states[-1].what == "disconnected" and not _alive(log, states[-1]):
        yield Finding(Level.NOTE, "State", f"The driver ended at {states.pop().begin_s:.1f} s.")
    for state in states:
        lengths[state.what] = lengths.get(state.what, 0.0) + state.length_s
    told = ", ".join(f"{name} for {span(length)}" for name, length in lengths.items())
    lost = _lost(states)
    if lost:
        yield Finding(
            Level.BAD
            if sum(state.length_s for state in lost) > LONG_OUT_OF_REACH * log.duration_s
            else Level.WARN,
            "State",
            f"The board was out of reach {counted(len(lost), 'time')}, first at"
            f" {lost[0].begin_s:.1f} s. Time in each state: {told}.",
            "If you did not reset the board or pull its cable, check cable, hub and the board's"
            " power.",
        )
    elif "imu_only" in lengths:
        yield Finding(
            Level.WARN,
            "State",
            f"The board ran in IMU-only mode. Time in each state: {told}.",
            "To get odometry, set the board's own mode to nominal and reboot the board.",
        )
    else:
        yield Finding(Level.GOOD, "State", f"{told[:1].upper()}{told[1:]}.")


def _lost(states: list[Span]) -> list[Span]:
    """Return the spans of time in which the board was disconnected or connecting.

    Adjacent spans are joined. Spans that end in the first 3 s of the log (``FIRST_SECONDS``) are
    left out.
    """
    lost: list[Span] = []
    for state in states:
        if state.what in OUT_OF_REACH and state.end_s > FIRST_SECONDS:
            begin_s = state.begin_s
            if lost and lost[-1].end_s == begin_s:
                begin_s = lost.pop().begin_s
            lost.append(Span(begin_s, state.end_s, ""))
    return lost


def _alive(log: Log, state: Span) -> bool:
    """Return whether the driver was still running in ``state``, the last state in the log.

    It was running if /diagnostics shows this state more than 2 s (``SILENT_S``) after the state
    began.
    """
    return any(
        status.at_s > state.begin_s + SILENT_S and status.values.get("Mode") == state.what
        for status in log.diagnostics
    )


def _estop(log: Log) -> Iterator[Finding]:
    if not log.estops:
        return
    if not log.latched:
        yield Finding(Level.GOOD, "E-stop", "Never latched.")
        return
    length_s = sum(latched.length_s for latched in log.latched)
    still = " and still latched at the end" if log.estops[-1].what == "latched" else ""
    yield Finding(
        Level.NOTE,
        "E-stop",
        f"The e-stop was latched {counted(len(log.latched), 'time')}, {span(length_s)} in all,"
        f" first at {log.latched[0].begin_s:.1f} s{still}.",
        "Release the e-stop with the service ~/estop (data: false) when it is safe to drive."
        if still
        else "",
    )


def _diagnostics(log: Log) -> Iterator[Finding]:
    """Report how often each status was not OK, its worst level, and that level's usual message."""
    if log.diagnostics and not log.alone:
        ports = ", ".join(sorted({status.hardware_id for status in log.diagnostics}))
        yield Finding(
            Level.NOTE,
            "Diagnostics",
            f"/diagnostics has data of several robots, on {ports}; this report lists the data of"
            " all of them.",
        )
    not_ok = [status for status in log.diagnostics if status.level in (1, 2)]
    troubles = [status for status in not_ok if not _told_elsewhere(status)]
    for (port, name), group in groupby(sorted(troubles, key=_key), key=_key):
        statuses = list(group)
        worst = max(status.level for status in statuses)
        words = Counter(status.message for status in statuses if status.level == worst)
        ((message, times),) = words.most_common(1)
        yield Finding(
            Level.BAD if worst == 2 else Level.WARN,
            "Diagnostics",
            f"{name} ({port}) was not OK {counted(len(statuses), 'time')}, first at"
            f" {statuses[0].at_s:.0f} s. The worst level was {LEVELS[worst]}, most often with the"
            f" message “{message}” ({counted(times, 'time')}).",
            "docs/diagnostics.md explains each status.",
        )
    if log.diagnostics and not troubles:
        except_for = " except for the start, pauses and the e-stop" if not_ok else ""
        yield Finding(Level.GOOD, "Diagnostics", f"No warning and no error{except_for}.")


def _told_elsewhere(status: Status) -> bool:
    """Return whether the report of the diagnostics omits this status.

    It omits a status that another finding reports, and the board's status in the first 3 s
    (``FIRST_SECONDS``).
    """
    if status.name.endswith("Commands"):
        return "e-stop" in status.message
    return status.name.endswith("E-stop") or (
        status.name.endswith("Board")
        and (status.at_s < FIRST_SECONDS or status.values.get("Mode") in ("paused", "imu_only"))
    )


def _key(status: Status) -> tuple[str, str]:
    return status.hardware_id, status.name
