# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The firmware's receiver: takes bytes, and returns the commands that they complete.

The manual does not say how commands are found, so there are several receivers. A driver must be
safe with each. This module must not know modes or motion.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.simulator.omnibot.wire import (
    COMMAND_HEADER,
    COMMAND_LENGTH,
    LETTERS,
    ControlFrame,
    StateLetter,
    control_frame,
)

WAKE_UP_BYTES: Final = 3
"""Number of bytes that wake the receiver (manual, Serial Command: "Serial initialization: 3
arbitrary byte")."""
IDLE_GAP_S: Final = 0.005
"""Time in s without a byte, after which the receiver ``idle_gap`` discards an incomplete frame."""

FramingName = Literal["counting", "naive", "idle_gap", "window"]
LetterPlace = Literal["between", "anywhere"]
Command = StateLetter | ControlFrame
# The bytes held now, the completed frame or None, and whether the byte may belong to a frame.
Step = tuple[bytes, ControlFrame | None, bool]
# A function that keeps no state. Arguments: the bytes held, a new byte, and the time in s since the
# byte before the new one.
Framing = Callable[[bytes, int, float], Step]

_FIRST, _SECOND = COMMAND_HEADER
_NOTHING: Final[Step] = (b"", None, False)


def counting(held: bytes, byte: int, pause_s: float) -> Step:
    """Find frames: FF FE and the seven bytes after it, without a timeout.

    In the bytes FF FF FE, the last two are a header.
    """
    if held == COMMAND_HEADER[:1] and byte != _SECOND:
        held = b""
    if not held and byte != _FIRST:
        return _NOTHING
    return _completed(held + bytes((byte,)))


def naive(held: bytes, byte: int, pause_s: float) -> Step:
    """Find frames as ``counting`` does, but discard an FF that is not followed by FE.

    The byte after this FF is discarded, too. So the header in the bytes FF FF FE is missed.
    """
    if held == COMMAND_HEADER[:1] and byte != _SECOND:
        return b"", None, True
    return counting(held, byte, pause_s)


def idle_gap(held: bytes, byte: int, pause_s: float) -> Step:
    """Find frames as ``counting`` does, but discard an incomplete frame after ``IDLE_GAP_S``."""
    return counting(b"" if pause_s >= IDLE_GAP_S else held, byte, pause_s)


def window(held: bytes, byte: int, pause_s: float) -> Step:
    """Accept the last nine bytes as a frame whenever they begin with FF FE.

    The bytes of an accepted frame are kept, so frames can overlap.
    """
    seen = held + bytes((byte,))
    held = seen[1 - COMMAND_LENGTH :]
    inside = COMMAND_HEADER in seen
    if len(seen) == COMMAND_LENGTH and seen.startswith(COMMAND_HEADER):
        return held, control_frame(seen), inside
    return held, None, inside


FRAMINGS: Final[dict[FramingName, Framing]] = {
    "counting": counting,
    "naive": naive,
    "idle_gap": idle_gap,
    "window": window,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverKind:
    """The behaviour of the receiver.

    * ``framing``: how the receiver finds control frames.
    * ``letters``: where state letters are obeyed: between control frames, or anywhere.
    * ``wakes_while_booting``: whether bytes that arrive during the boot wake the receiver.
    """

    framing: FramingName = "counting"
    letters: LetterPlace = "between"
    wakes_while_booting: bool = False


COUNTING: Final = ReceiverKind()


class CommandReceiver:
    """The receiver from one power-up to the next.

    * ``held``: received bytes that may be the beginning of a frame.
    * ``last_at_s``: arrival time of the last byte that came while control frames were accepted.
    * ``to_swallow``: number of bytes that are lost before the receiver is awake.
    """

    def __init__(self, kind: ReceiverKind = COUNTING, *, awake: bool = False) -> None:
        self.held = b""
        self._framing = FRAMINGS[kind.framing]
        self._anywhere = kind.letters == "anywhere"
        self._wakes_while_booting = kind.wakes_while_booting
        self.to_swallow = 0 if awake else WAKE_UP_BYTES
        self.last_at_s = 0.0

    def boot(self) -> None:
        """Process a byte that arrives during the boot: it is lost, or counts as a wake-up byte."""
        if self._wakes_while_booting and self.to_swallow:
            self.to_swallow -= 1

    def feed(self, byte: int, at_s: float, *, control_frames: bool) -> tuple[Command, ...]:
        """Process the byte that arrives at ``at_s``; return the commands it completes, in order.

        If ``control_frames`` is false, the receiver finds only state letters.
        """
        if self.to_swallow:
            self.to_swallow -= 1
            return ()
        frame, inside = None, False
        if control_frames:
            self.held, frame, inside = self._framing(self.held, byte, at_s - self.last_at_s)
            self.last_at_s = at_s
        letter = LETTERS.get(byte) if self._anywhere or not inside else None
        if frame is None:
            return () if letter is None else (letter,)
        return (frame,) if letter is None else (frame, letter)


def _completed(held: bytes) -> Step:
    if len(held) < COMMAND_LENGTH:
        return held, None, True
    return b"", control_frame(held), True
