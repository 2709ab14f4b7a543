# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Judges a topic's timing: rate, even timestamps, missing messages, and delays of arrival."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from omnibot_driver.tools.report import clocks
from omnibot_driver.tools.report.findings import Finding, Level, counted, span
from omnibot_driver.tools.report.log import OTHER_CLOCK_S, Array, Log, Series, Span
from omnibot_driver.tools.report.streams import Stream

GAP: Final = 1.5
"""Step between two timestamps, in periods, above which a message may be missing."""
LONG_GAP_S: Final = 0.5
MANY_LOST: Final = 0.01
RATE_TOLERANCE: Final = 0.05
UNEVEN: Final = 0.1
"""Limit of the standard deviation of the steps between timestamps, in periods. Above this limit,
the timestamps are reported as uneven."""
LATE_S: Final = 0.005
EARLY_S: Final = 0.001
FEWEST: Final = 10
RECOVERY_S: Final = 0.75
"""Time in s within which short steps between timestamps compensate a long one.

A long step that is compensated is a jump of the timestamps. A long step that is not compensated
shows that messages are missing.
"""


@dataclass(frozen=True, slots=True)
class FrameSchedule:
    """The measured timing of a topic.

    A step is the time between the timestamps of two successive messages.

    ``at_s``, ``steps_s``: start and length of each step. ``period_s``: the median step.

    ``gap_at_s``, ``gap_s``: start and length of each gap that the driver's state does not explain.

    ``missing``: number of missing messages in each of these gaps.

    ``leap_at_s``, ``leap_s``: start and length of each long step that short steps compensate.

    ``arrived_s``: time of arrival of each message.

    ``late_s``: time from the timestamp of each message to its arrival.
    """

    at_s: Array
    steps_s: Array
    period_s: float
    gap_at_s: Array
    gap_s: Array
    missing: Array
    leap_at_s: Array
    leap_s: Array
    arrived_s: Array
    late_s: Array


def measure(log: Log, series: Series, stream: Stream) -> FrameSchedule:
    """Return the timing of a topic by its timestamps. Messages without a timestamp are left out."""
    stamped = series.only(np.isfinite(series.stamp_s))
    at_s, steps_s = stamped.stamp_s[:-1], np.diff(stamped.stamp_s)
    period_s = float(np.median(steps_s)) if len(steps_s) else 1.0 / stream.rate_hz
    wide = np.flatnonzero(steps_s > GAP * period_s)
    missing = np.array(
        [
            np.rint((steps_s[row:end] - period_s).sum() / period_s)
            for row, end in zip(wide, _ends(wide, int(RECOVERY_S / period_s)), strict=True)
        ]
    )
    leaps = wide[missing < 1.0]
    begun_s = at_s + stamped.other_clock_s
    told = [
        not log.interrupted(begun_s[row], begun_s[row] + steps_s[row], stream.running)
        for row in wide
    ]
    true = (missing >= 1.0) & np.array(told, dtype=bool)
    gap_at_s, gap_s, missing = at_s[wide[true]], steps_s[wide[true]], missing[true]
    if len(stamped) and (ended := _ended(log, stamped, stream)) is not None:
        gap_at_s = np.append(gap_at_s, stamped.stamp_s[-1])
        gap_s = np.append(gap_s, ended.length_s)
        missing = np.append(missing, np.rint(ended.length_s / period_s))
    return FrameSchedule(
        at_s=at_s,
        steps_s=steps_s,
        period_s=period_s,
        gap_at_s=gap_at_s,
        gap_s=gap_s,
        missing=missing,
        leap_at_s=at_s[leaps],
        leap_s=steps_s[leaps],
        arrived_s=stamped.arrived_s,
        late_s=stamped.arrived_s - stamped.stamp_s,
    )


def _ended(log: Log, stamped: Series, stream: Stream) -> Span | None:
    """Return the gap from the last message to the end of the log.

    Return None if the gap is short, or if the driver's state explains it.
    """
    rest = Span(float(stamped.arrived_s.max()), log.duration_s, "")
    if rest.length_s < LONG_GAP_S or log.interrupted(rest.begin_s, rest.end_s, stream.running):
        return None
    return rest


def _ends(wide: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """Return the ends of groups of steps. A group begins with a long step between two timestamps.

    A group ends before the next long step, or after ``most`` steps (at least one). Its end is the
    index after its last step. ``wide``: indices of the long steps.
    """
    ends: NDArray[np.intp] = wide + max(1, most)
    ends[:-1] = np.minimum(ends[:-1], wide[1:])
    return ends


def judge(log: Log, series: Series, stream: Stream) -> Iterator[Finding]:
    """Judge the timing of a topic: rate, uneven timestamps, gaps, and delays of arrival."""
    rhythm = measure(log, series, stream)
    stream = stream.promised(log)
    unstamped = int(np.isnan(series.stamp_s).sum())
    if unstamped:
        yield Finding(
            Level.BAD,
            "Timing",
            f"{counted(unstamped, 'message')} of {stream.name} without a stamp.",
            "Find out which node publishes such messages: this driver stamps all its messages.",
        )
    if len(rhythm.steps_s) < FEWEST:
        yield Finding(
            Level.BAD,
            "Timing",
            f"{counted(len(series), 'message')} of {stream.name}: too few to judge.",
            "Record for longer, while the state is nominal.",
        )
        return
    yield from _steps(rhythm, stream)
    yield from _gaps(log, rhythm, stream)
    if clocks.step(log) is None:
        yield from _arrival(rhythm, stream)


def _steps(rhythm: FrameSchedule, stream: Stream) -> Iterator[Finding]:
    back = int((rhythm.steps_s <= 0.0).sum())
    if back:
        yield Finding(
            Level.BAD,
            "Timing",
            f"{counted(back, 'stamp')} of {stream.name} did not increase.",
            "Was the computer's clock set back during the drive, or do two drivers publish?",
        )
    if len(rhythm.leap_s):
        yield Finding(
            Level.WARN,
            "Timing",
            f"Stamps of {stream.name} jumped {counted(len(rhythm.leap_s), 'time')}, by up to"
            f" {1e3 * (rhythm.leap_s.max() - rhythm.period_s):.0f} ms, first at"
            f" {rhythm.leap_at_s[0]:.1f} s. Later stamps were right again, so no message is"
            " missing.",
            "The driver could not read for a while: reduce the load of the computer.",
        )
    even = rhythm.steps_s[(rhythm.steps_s > 0.0) & (rhythm.steps_s <= GAP * rhythm.period_s)]
    if len(even) < FEWEST:
        return
    rate_hz, jitter_s = 1.0 / float(even.mean()), float(even.std())
    uneven = jitter_s > UNEVEN * rhythm.period_s
    yield _rate(rate_hz, stream)
    yield Finding(
        Level.WARN if uneven else Level.GOOD,
        "Timing",
        f"The steps between stamps of {stream.name} vary by {1e3 * jitter_s:.3f} ms rms.",
        "So some stamps are not the sampling times. The status “Time” in /diagnostics may name the"
        " cause; docs/internals/time.md explains how stamps are made."
        if uneven
        else "",
    )


def _rate(rate_hz: float, stream: Stream) -> Finding:
    figure = f"The rate of {stream.name} is {rate_hz:.2f} Hz"
    if math.isnan(stream.rate_hz):
        return Finding(
            Level.NOTE,
            "Timing",
            f"{figure}. The recording does not show the expected rate.",
            "Record /diagnostics too, while no other robot publishes on it.",
        )
    off = abs(rate_hz / stream.rate_hz - 1.0) > RATE_TOLERANCE
    return Finding(
        Level.WARN if off else Level.GOOD,
        "Timing",
        f"{figure}; it should be {stream.rate_hz:g} Hz.",
        "Possible causes are two publishers, a filter in between, or a recorder that drops many"
        " messages."
        if off
        else "",
    )


def _gaps(log: Log, rhythm: FrameSchedule, stream: Stream) -> Iterator[Finding]:
    if not len(rhythm.gap_s):
        yield Finding(
            Level.GOOD, "Gaps", f"{stream.name} has no gap in the states in which it is published."
        )
        return
    lost = int(rhythm.missing.sum())
    longest = int(rhythm.gap_s.argmax())
    share = lost / (lost + len(rhythm.steps_s))
    counted_lost = grown(log, stream.lost)
    if counted_lost is None:
        advice = (
            "Record /diagnostics too, while no other robot publishes on it. Its counts show"
            " whether the line or the recorder lost the messages."
        )
    elif counted_lost == 0:
        advice = (
            "The driver counts no loss, so the network, the recorder or a busy computer lost the"
            " messages: record on the robot."
        )
    else:
        advice = (
            f"The driver has counted {counted_lost} messages that were lost on the line or that it"
            " rejected: check the cable, the hub and the electrical ground."
        )
    yield Finding(
        Level.BAD if rhythm.gap_s[longest] > LONG_GAP_S or share > MANY_LOST else Level.WARN,
        "Gaps",
        f"{stream.name} has {counted(len(rhythm.gap_s), 'gap')}, {counted(lost, 'message')}"
        f" ({100 * share:.2g} %) missing. The longest gap lasts {span(rhythm.gap_s[longest])}, from"
        f" {rhythm.gap_at_s[longest]:.1f} s on.",
        advice,
    )


def _arrival(rhythm: FrameSchedule, stream: Stream) -> Iterator[Finding]:
    least_s, middle_s, mean_s = (
        float(figure)
        for figure in (rhythm.late_s.min(), np.median(rhythm.late_s), rhythm.late_s.mean())
    )
    if abs(middle_s) > OTHER_CLOCK_S or least_s < -EARLY_S:
        yield Finding(
            Level.WARN,
            "Timing",
            f"{stream.name} arrives {middle_s:.3g} s after its stamp (median), and never sooner"
            f" than {least_s:.3g} s.",
            "The clocks of recorder and driver differ: synchronise them (chrony), or record on the"
            " robot.",
        )
    over_s, most_s = mean_s - least_s, float(np.quantile(rhythm.late_s, 0.99)) - least_s
    late = over_s > LATE_S
    yield Finding(
        Level.WARN if late else Level.GOOD,
        "Timing",
        f"The delay of {stream.name} exceeds the smallest delay by {1e3 * over_s:.2f} ms on"
        f" average, and by less than {1e3 * most_s:.1f} ms in 99 of 100 cases.",
        "Set the adapter's latency_timer to 1 (udev/99-omnibot.rules), or reduce the load of the"
        " computer."
        if late
        else "",
    )


def grown(log: Log, keys: tuple[str, ...]) -> int | None:
    """Return by how much the counts ``keys`` in this robot's /diagnostics grew; None if unknown.

    If a count has decreased, the driver is assumed to have restarted, and to count from zero again.
    """
    if not log.alone:
        return None
    growth = [
        later - earlier if later >= earlier else later
        for key in keys
        for earlier, later in pairwise(
            int(status.values[key])
            for status in log.diagnostics
            if status.values.get(key, "").isdecimal()
        )
    ]
    return sum(growth) if growth else None
