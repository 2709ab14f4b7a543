# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Parser of the driver's writes, by the layout in the manual alone, without code of the driver."""

from dataclasses import dataclass

Words = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Items:
    """The control frames and letters in a write.

    ``frames``: for each control frame, the offset of its last byte, its mode and its words.

    ``letters``: for each letter, its offset and its byte.

    ``moves``: whether any control frame is a motion. ``stops``: whether there are control frames,
    but no motion.
    """

    frames: tuple[tuple[int, int, Words], ...] = ()
    letters: tuple[tuple[int, int], ...] = ()
    moves: bool = False
    stops: bool = False


def is_motion(mode: int, words: Words) -> bool:
    """Return whether a control frame is a motion.

    A frame of mode 01 is always a motion, even with zeros: under position control, zeros are a
    goal.
    """
    return mode == 0x01 or (mode == 0x02 and any(words))


def parse(data: bytes) -> Items:
    """Parse a write. Raise ValueError at anything but zeros, complete frames and letters."""
    frames: list[tuple[int, int, Words]] = []
    letters: list[tuple[int, int]] = []
    at = 0
    while at < len(data):
        if data[at] == 0:
            at += 1
        elif data[at] in b"SPR":
            letters.append((at, data[at]))
            at += 1
        elif data[at : at + 2] == b"\xff\xfe" and len(data) >= at + 9:
            a, b, c = (
                int.from_bytes(data[n : n + 2], "big", signed=True)
                for n in (at + 3, at + 5, at + 7)
            )
            frames.append((at + 8, data[at + 2], (a, b, c)))
            at += 9
        else:
            raise ValueError(f"neither zeros, a frame nor a letter at {at}: {data.hex(' ')}")
    moves = any(is_motion(mode, words) for _, mode, words in frames)
    return Items(tuple(frames), tuple(letters), moves, bool(frames) and not moves)
