# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Integrity of the Fejemis's published values on lines with faults (``make integrity``).

The simulated boards share no code with the driver. The reference for values and odometry is a
session with undamaged lines.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import partial
from random import Random
from typing import Final

import pieces
from carriage import FAULTS, Fault

from omnibot_driver.boards import check_all, load
from omnibot_driver.core.events import Event, Extra
from omnibot_driver.core.fejemis import OrientedImuReading
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.imu.bias_correction import ImuEstimate
from omnibot_driver.core.odometry.estimate import OdometryEstimate
from omnibot_driver.core.session import Session
from omnibot_driver.parameters import session_settings
from omnibot_driver.simulator.fejemis import FejemisSettings, Firmware, SimulatedFejemis

TICKS: Final = 5
"""Number of ticks of the simulated boards between two reads."""
READ_S: Final = 0.01
SETTLED_S: Final = 3.0
STEER_EVERY_S: Final = 1.0
SUMS: Final = (True, False)
BOUNDS: Final = {"1 byte in 1,000 lost": (0.9, 0), "1 byte in 100 lost": (0.5, 10_000)}
"""Limits for each fault on lines with checksums.

Each element is the least share of values that must be published, and the number N in "at most one
value in N may be wrong" (0: no value).
"""
ASTRAY_M: Final = 0.02

Stream = list[dict[int, bytes]]
"""The bytes of all reads, in order. Each read is a dict of bytes by the number of the channel."""


@dataclass(slots=True)
class Score:
    """Counts of published values. Scores can be added.

    ``sent``: number of values that are published if the lines are undamaged.

    ``out``: number of values that are published if the lines are damaged.

    ``wrong``: number of wrong values among ``out``.

    ``odometry``: number of compared odometry messages.

    ``astray_m``: greatest error of the odometry, in m.
    """

    sent: int = 0
    out: int = 0
    wrong: int = 0
    odometry: int = 0
    astray_m: float = 0.0

    def __iadd__(self, other: "Score") -> "Score":
        for name in (field.name for field in fields(self)):
            join = max if name == "astray_m" else float.__add__
            mine, theirs = getattr(self, name), getattr(other, name)
            setattr(self, name, type(mine)(join(float(mine), float(theirs))))
        return self


def session() -> Session:
    """Make a session with the default values.

    Its motion monitor is off, because it could stop the robot.
    """
    values = check_all({"board": "fejemis", "motion_monitor": False})
    profile = load("fejemis")
    settings = session_settings(values, profile.kinematics(values))
    return Session(profile.make(values), settings, run=True)


def drive(sums: bool, seed: int, seconds: float) -> Stream:
    """Drive a pair of boards with a new twist each second, and return what the boards send."""
    random = Random(f"{sums} {seed}")
    firmware = Firmware(sums=sums)
    pair = SimulatedFejemis(FejemisSettings(firmware=firmware, seed=seed, front_m=4.0))
    ours, now, stream = session(), 1000.0, []
    ours.opened(now)
    twist = BodyTwist(0.0, 0.0, 0.0)
    for read in range(round(seconds / READ_S)):
        now += READ_S
        if read * READ_S > SETTLED_S and read % round(STEER_EVERY_S / READ_S) == 0:
            twist = BodyTwist(random.uniform(0.1, 0.4), 0.0, random.uniform(-0.4, 0.4))
        if read % 10 == 0 and ours.state == "nominal":
            ours.command_twist(twist, now)
        packets = [packet for _ in range(TICKS) for packet in pair.advance()]
        both = {channel: b"".join(d for c, d in packets if c == channel) for channel in (0, 1)}
        stream.append(both)
        for channel, data in both.items():
            if data:
                ours.inbound.receive(data, now, channel)
        if now >= ours.wake_at:
            ours.tick(now)
        for channel, data in ours.take_output(now):
            pair.receive(data, now, channel)
        ours.take_events()
    return stream


def play(stream: Stream) -> Iterator[Event]:
    """Let a session read a stream. Yield the events that the session publishes."""
    ours, now = session(), 1000.0
    ours.opened(now)
    for both in stream:
        now += READ_S
        for channel, data in both.items():
            if data:
                ours.inbound.receive(data, now, channel)
        if now >= ours.wake_at:
            ours.tick(now)
        ours.take_output(now)
        yield from ours.take_events()


def damaged(stream: Stream, fault: Fault, random: Random) -> Stream:
    """Damage the line of the drive board and the line of the front board independently."""
    drive, front = (
        pieces.damaged([both[channel] for both in stream], fault, random) for channel in (0, 1)
    )
    return [{0: ours, 1: other} for ours, other in zip(drive, front, strict=True)]


def value_of(event: Event) -> str | None:
    """Return the value of an event as text, without its timestamp.

    Return None for events that are not compared as text.
    """
    if isinstance(event, ImuEstimate):
        return f"imu {event.specific_force} {event.angular_velocity}"
    if isinstance(event, Extra) and isinstance(event.value, OrientedImuReading):
        return f"orientation {event.value.orientation}"  # the stamp is that of the last sample
    if isinstance(event, Extra):
        return repr(event.value)
    return None


def score(truth: list[Event], found: list[Event]) -> Score:
    """Compare events from damaged lines (``found``) with events from undamaged lines (``truth``).

    A value that ``found`` has more often than ``truth`` counts as wrong.
    """
    left = Counter(filter(None, map(value_of, truth)))
    result = Score(sent=sum(left.values()))
    for value in filter(None, map(value_of, found)):
        result.out += 1
        left[value] -= 1
        result.wrong += left[value] < 0
    places = [event for event in truth if isinstance(event, OdometryEstimate)]
    stamps = [place.stamp_s for place in places]
    for event in found:
        at = bisect_left(stamps, event.stamp_s) if isinstance(event, OdometryEstimate) else 0
        if isinstance(event, OdometryEstimate) and 0 < at < len(places):
            result.odometry += 1
            near = min(places[at - 1 : at + 1], key=lambda p: abs(p.stamp_s - event.stamp_s))
            a, b = near.pose, event.pose
            off_m = ((a.x_m - b.x_m) ** 2 + (a.y_m - b.y_m) ** 2) ** 0.5
            result.astray_m = max(result.astray_m, off_m)
    return result


def one(seconds: float, job: tuple[bool, int]) -> dict[tuple[str, bool], Score]:
    """Play one stream with each fault, and return the scores.

    The keys are the fault, and whether the lines have checksums.
    """
    sums, seed = job
    stream = drive(sums, seed, seconds)
    truth = list(play(stream))
    return {
        (fault, sums): score(
            truth, list(play(damaged(stream, line, Random(f"{sums} {seed} {fault}"))))
        )
        for fault, line in FAULTS.items()
        if not fault.startswith("none")
    }


def measure(seconds: float, seeds: range) -> tuple[list[str], bool]:
    """Return the rows of the table, and whether every bound holds."""
    jobs = [(sums, seed) for seed in seeds for sums in SUMS]
    total = pieces.scores_of(partial(one, seconds), jobs)
    lines = [
        f"{len(seeds)} drives of {seconds:g} s for each row, with checksums and without:",
        "",
        "| fault | lines | values delivered | values wrong | odometry off by at most | bound | |",
        "|---" * 7 + "|",
    ]
    all_hold = True
    for (fault, sums), found in total.items():
        least, one_in = BOUNDS.get(fault, (0.0, 0)) if sums else (0.0, 0)
        delivered = (found.out - found.wrong) / max(1, found.sent)
        few = found.wrong * one_in <= found.out if one_in else not found.wrong
        holds = not least or (few and delivered >= least and found.astray_m < ASTRAY_M)
        all_hold &= holds
        most = f"1 wrong in {one_in:,}" if one_in else "none wrong"
        bound = f"{most}, {least:.0%} delivered, {1e3 * ASTRAY_M:g} mm" if least else "none"
        wrong = f"1 in {found.out / found.wrong:,.0f}" if found.wrong else f"0 of {found.out:,}"
        with_sums = "with checksums" if sums else "without checksums"
        lines.append(
            f"| {fault} | {with_sums} | {delivered:.2%} | {wrong} | {1e3 * found.astray_m:.0f} mm |"
            f" {bound} | {'holds' if holds else '**missed**'} |"
        )
    return lines, all_hold
