# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What stands in the driver's writes, read by the manual's layout alone.

Knows zeros, control frames and letters; none of the driver's code.
"""

from dataclasses import dataclass

Words = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Items:
    """Control frames (offset of the last byte, mode, words), letters by offset.

    moves, stops: whether there is a motion frame, or only other frames.
    """

    frames: tuple[tuple[int, int, Words], ...] = ()
    letters: tuple[tuple[int, int], ...] = ()
    moves: bool = False
    stops: bool = False


def is_motion(mode: int, words: Words) -> bool:
    """Zeros in mode 01 are motion too: with the board's switch on position they are a goal."""
    return mode == 0x01 or (mode == 0x02 and any(words))


def parse(data: bytes) -> Items:
    """Raises ValueError where a write has anything but zeros, whole frames and letters."""
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
