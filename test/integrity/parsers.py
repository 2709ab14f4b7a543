# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The two parsers under test, with one interface: the driver's, and a plain one without checks."""

import struct

from judge import Feed
from truth import Key

from omnibot_driver.core.omnibot import DeltaFrame, FrameDecoder, ImuFrame, PoseFrame
from omnibot_driver.core.omnibot.frames import Frame


def key_of(frame: Frame) -> Key:
    """Return the kind and the content of a frame, for a comparison with the sent frames."""
    match frame:
        case ImuFrame(accel, gyro):
            return ("imu", accel, gyro)
        case DeltaFrame(dx, dy, dtheta, seq):
            return ("delta", dx, dy, dtheta, seq)
        case PoseFrame(x, y, theta, seq):
            return ("pose", x, y, theta, seq)
        case _:
            return ("text", frame.count)


def driver() -> tuple[Feed, Feed]:
    """Make the driver's decoder. Return the functions that feed and flush it."""
    decoder = FrameDecoder()
    return (
        lambda data, now: [key_of(frame) for frame in decoder.feed(data, now)],
        lambda data, now: [key_of(frame) for frame in decoder.flush(now)],
    )


def plain() -> tuple[Feed, Feed]:
    """Make a parser without checks. Return the functions that feed and flush it.

    The two header bytes alone determine the kind and the length of a frame.
    """
    held = bytearray()

    def feed(data: bytes, now: float) -> list[Key]:
        held.extend(data)
        found: list[Key] = []
        at = 0
        while at + 1 < len(held):
            length = {0xFA: 14, 0xFB: 9, 0xFC: 15}.get(held[at + 1], 0) if held[at] == 0xFF else 0
            if not length:
                at += 1
                continue
            if at + length > len(held):
                break
            body = bytes(held[at + 2 : at + length])
            at += length
            if length == 14:
                words = struct.unpack(">6h", body)
                found.append(("imu", words[:3], words[3:]))
            elif length == 9:
                found.append(("delta", *struct.unpack(">3hB", body)))
            else:
                found.append(("pose", *struct.unpack(">3fB", body)))
        del held[:at]
        return found

    return feed, lambda data, now: []
