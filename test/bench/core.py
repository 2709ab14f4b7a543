# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Measurements of the core alone: the time to decode a stream, and memory.

The decoding time is compared with the time of a minimal decoder, which does not check the frames.
"""

import gc
import os
import struct
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from statistics import median

from carriage import FAULTS, receive
from ratios import Figure, alternate, short
from truth import SCENARIOS, generate

from omnibot_driver import boards, parameters
from omnibot_driver.boards import omnibot
from omnibot_driver.core.omnibot import DeltaFrame, FrameDecoder, ImuFrame, PoseFrame
from omnibot_driver.core.omnibot.frames import Frame
from omnibot_driver.core.session import Session
from omnibot_driver.simulator.omnibot import BoardSettings, SimulatedBoard

BYTES_PER_S = 1700.0
CHUNKS = (1, 14, 64, 4096)
SECONDS = 120.0
SETTLED = 400
"""Number of simulated ticks before a measurement begins, so that the decoder has settled."""
OTHERS_BYTES = 24 << 20
"""Number of bytes to overwrite before a measurement with cold caches. They fill the caches."""
FAULTY = "1 byte in 100 lost"
STREAMS = (("clean", ""), (FAULTY, FAULTY))
GOALS = {"clean": 1.5, FAULTY: 4.0}

_IMU, _DELTA, _POSE = (struct.Struct(form).unpack_from for form in (">6h", ">3hB", ">3fB"))


def trust(data: bytes) -> list[Frame]:
    """Decode frames without checks: all bytes that look like a header begin a frame."""
    frames: list[Frame] = []
    at, size = 0, len(data) - 15
    while at < size:
        kind = data[at + 1]
        if kind == 0xFA:
            ax, ay, az, gx, gy, gz = _IMU(data, at + 2)
            frames.append(ImuFrame((ax, ay, az), (gx, gy, gz)))
            at += 14
        elif kind == 0xFB:
            frames.append(DeltaFrame(*_DELTA(data, at + 2)))
            at += 9
        elif kind == 0xFC:
            frames.append(PoseFrame(*_POSE(data, at + 2)))
            at += 15
        else:
            at += 1
    return frames


def trust_all(blocks: Sequence[bytes]) -> int:
    """Decode all blocks; return the number of frames in them.

    The frames are not kept, because keeping them costs time.
    """
    return sum(len(trust(block)) for block in blocks)


def decode(chunks: Sequence[bytes]) -> int:
    """Decode chunks as if the line had no pauses between them, and return the number of frames."""
    decoder, now, frames = FrameDecoder(), 0.0, 0
    for chunk in chunks:
        now += len(chunk) / BYTES_PER_S
        frames += len(decoder.feed(chunk, now))
    return frames


def stream(seconds: float, fault: str = "") -> bytes:
    """Return the byte stream of a driving robot, damaged by ``fault`` if one is given."""
    truth = generate(SCENARIOS["driving"], 1, seconds)
    return receive(truth, FAULTS[fault], Random(1)).data if fault else bytes(truth.data)


def decoding(times: int) -> list[Figure]:
    """Measure the decoding time of a frame, for clean and damaged streams and all chunk sizes."""
    figures = []
    for name, fault in STREAMS:
        data = stream(SECONDS if not fault else SECONDS / 4, fault)
        blocks = _cut(data, CHUNKS[-1])
        frames = trust_all(blocks)
        for size in CHUNKS:
            figures.append(
                alternate(
                    f"decoding one frame, {name}, {size} byte{'s' * (size > 1)} at a time",
                    "µs",
                    partial(_us_per_frame, decode, _cut(data, size), frames),
                    partial(_us_per_frame, trust_all, blocks, frames),
                    times=times,
                    goal=GOALS[name] if size == CHUNKS[-1] else None,
                )
            )
    return figures


def linearity() -> list[str]:
    """Return the rows of a table: the decoding time per MB, for streams of up to 2.7 hours."""
    rows = ["| stream | 1 MB | 4 MB | 16 MB |", "|---|---|---|---|"]
    for name, fault in STREAMS:
        block = stream(600.0, fault)[: 1 << 20]
        cells = []
        for megabytes in (1, 4, 16):
            chunks = _cut(block, CHUNKS[-1]) * megabytes
            cells.append(f"{_seconds(decode, chunks) / megabytes:.3f} s/MB")
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return rows


def cold(ticks: int) -> str:
    """Measure the time from an IMU frame's bytes to its reading, with warm and with cold caches.

    In every second tick, the caches are overwritten first.
    """
    session, board = _session(), SimulatedBoard(BoardSettings(seed=1, running=True))
    other = bytearray(OTHERS_BYTES)
    taken: dict[bool, list[float]] = {False: [], True: []}
    for tick in range(SETTLED + ticks):
        data, now = board.step(), tick * 0.01
        forgotten = tick % 2 == 0
        if forgotten and tick >= SETTLED:
            other[:] = bytes(OTHERS_BYTES)
        begun = time.perf_counter()
        session.inbound.hear(data, now)
        passed = time.perf_counter() - begun
        session.inbound.process(now)
        session.take_output(now)
        session.take_events()
        if tick >= SETTLED and len(data) == 14:
            taken[forgotten].append(passed)
    hot_us, cold_us = (1e6 * median(taken[forgotten]) for forgotten in (False, True))
    return (
        f"One IMU frame takes {short(hot_us)} µs from its bytes to its reading if another"
        f" IMU frame was processed just before, and {short(cold_us)} µs if other code has used the"
        " processor's caches before."
    )


def memory(hours: float = 1.0) -> str:
    """Give a session the stream of ``hours`` of driving as fast as possible.

    Return a sentence about the memory in use.
    """
    session = _session()
    data, now, events = stream(SECONDS), 0.0, 0
    resident_mb = []
    ends = [*range(38, len(data), 38), len(data)]
    begun = time.perf_counter()
    while now < hours * 3600:
        if now >= len(resident_mb) * hours * 600:
            gc.collect()
            resident_mb.append(_resident_mb())
        start = 0
        for end in ends:
            now += (end - start) / BYTES_PER_S
            session.inbound.receive(data[start:end], now)
            session.take_output(now)
            events += len(session.take_events())
            start = end
    resident_mb.append(_resident_mb())
    figures = ", ".join(f"{each:.1f}" for each in resident_mb)
    return (
        f"Core: {short(hours)} hour of stream ({events:,} events) went through decoder and"
        f" session in {time.perf_counter() - begun:.0f} s. Resident memory at the start and after"
        f" each sixth: {figures} MB."
    )


def _session() -> Session:
    settings = boards.check_all({})
    session = Session(
        omnibot.make(settings),
        parameters.session_settings(settings, omnibot.kinematics(settings)),
        run=True,
    )
    session.opened(0.0)
    return session


def _cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def _us_per_frame(work: object, data: object, frames: int) -> float:
    return 1e6 * _seconds(work, data) / frames


def _seconds(work: object, data: object) -> float:
    assert callable(work)
    gc.collect()
    begun = time.process_time()
    work(data)
    return time.process_time() - begun


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
