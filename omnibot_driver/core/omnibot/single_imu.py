# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The fast path for the most frequent read: exactly one IMU frame, from bytes to reading.

A test checks that the results are the same as on the normal path. A frame may arrive in several
reads (pieces). If the fast path rejects the frame, the decoder gets each piece with its arrival
time.
"""

import struct
from typing import Any, Final

from omnibot_driver.core.omnibot.cost_model import Context
from omnibot_driver.core.omnibot.decoder import FrameDecoder
from omnibot_driver.core.omnibot.fast_path import UnfrozenImu
from omnibot_driver.core.omnibot.frames import IMU_HEADER, IMU_LENGTH, LENT, ImuFrame
from omnibot_driver.core.omnibot.gaps import NORMAL_PAUSE_S
from omnibot_driver.core.omnibot.late_reads import GAP_S
from omnibot_driver.core.omnibot.translation import Translation
from omnibot_driver.core.readings import ImuReading

_WORDS: Final = struct.Struct(">H6h").unpack
_HEADER: Final = int.from_bytes(IMU_HEADER, "big")


Piece = tuple[bytes, float]
"""Bytes, and their arrival time in s."""


def is_begun(
    pieces: list[Piece], data: bytes, now: float, decoder: FrameDecoder, translation: Translation
) -> bool:
    """Return whether ``pieces`` and ``data`` together are the beginning of a due IMU frame.

    ``pieces``: earlier reads of this frame, if any. ``data``: the newest read. The result is False
    if ``GAP_S`` has passed since the first piece.
    """
    if pieces:
        data = joined(pieces) + data
        # Only the decoder can judge a pause within a frame.
        prompt = now - pieces[0][1] < GAP_S
    else:
        prompt = (
            translation.singles_to_come > 0
            and decoder.at_rest
            and now - decoder.last_arrival_s <= NORMAL_PAUSE_S
        )
    return prompt and 0 < len(data) < IMU_LENGTH and IMU_HEADER.startswith(data[:2])


def joined(pieces: list[Piece]) -> bytes:
    """Return the bytes of ``pieces``, joined in order."""
    return b"".join([piece for piece, _ in pieces])


def take_pieces(
    pieces: list[Piece], data: bytes, now: float, decoder: FrameDecoder, translation: Translation
) -> ImuReading | None:
    """Return the reading of the IMU frame that consists of ``pieces`` and ``data``.

    Return None and change nothing if only the decoder can judge the frame. ``pieces``: the earlier
    reads, at least one. ``data``: the newest read.
    """
    first, came_at = pieces[0]
    last = decoder.context.imu
    if now - came_at >= GAP_S or last is None:
        return None
    if data[-1] in LENT and (
        not decoder.calm
        or decoder.expectation.more_is_due(last, decoder.context)
        or not decoder.pauses.stands_out(came_at - decoder.last_arrival_s, len(first))
    ):
        return None
    reading = take_single(joined(pieces) + data, came_at, decoder, translation, first=len(first))
    if reading is not None:
        decoder.last_arrival_s = translation.heard_s = now
    return reading


def take_single(
    data: bytes,
    now: float,
    decoder: FrameDecoder,
    translation: Translation,
    *,
    first: int = IMU_LENGTH,
) -> ImuReading | None:
    """Return the reading of one usual, due IMU frame; else return None and change nothing.

    ``first``, ``now``: length and arrival time of the frame's first read. If the frame came in
    several reads, its last byte must not begin the next header.
    """
    pause_s = now - decoder.last_arrival_s
    if (
        not translation.singles_to_come
        or not decoder.at_rest
        or len(data) != IMU_LENGTH
        or pause_s > NORMAL_PAUSE_S
    ):
        return None
    x: int  # types for compiled code, as in ``fast_path``
    y: int
    z: int
    u: int
    v: int
    w: int
    header, x, y, z, u, v, w = _WORDS(data)
    last, seq, pose, imus, deltas, _, turned = decoder.context
    if header != _HEADER or last is None:
        return None
    expectation = decoder.expectation
    lightest, heaviest, far, fast = expectation.calm
    px, py, pz = last.accel
    pu, pv, pw = last.gyro
    if not (
        lightest < x * x + y * y + z * z < heaviest
        and -far < x - px < far
        and -far < y - py < far
        and -far < z - pz < far
        and -fast < u - pu < fast
        and -fast < v - pv < fast
        and -fast < w - pw < fast
    ):
        return None
    frame: Any = UnfrozenImu()
    frame.accel = accel = x, y, z
    frame.gyro = gyro = u, v, w
    frame.__class__ = ImuFrame
    if not imus & 3:
        expectation.learn(frame, last)
    decoder.context = tuple.__new__(Context, (frame, seq, pose, imus + 1, deltas, False, turned))
    decoder.last_arrival_s = translation.heard_s = now
    decoder.statistics.frames += 1
    if not decoder.pauses.certain:
        decoder.pauses.stood_between(pause_s, first)
    translation.singles_to_come -= 1
    scale = translation.settings.imu
    return ImuReading(scale.specific_force(accel), scale.angular_velocity(gyro))
