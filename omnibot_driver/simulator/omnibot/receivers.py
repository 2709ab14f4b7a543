# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The firmware's receiver: bytes in, the commands that they complete out.

The manual shows what a command looks like, not how the firmware finds it among the bytes. So there
are several receivers, and a driver has to be safe with each. Knows control frames, letters and the
time of a byte. Must not know modes or motion.

- A `Framing` is a pure function: what is held so far, one byte, and the pause before it go in; what
  is held now comes out, with the control frame that the byte completes, and whether the byte may
  belong to a frame.
- Letters count between control frames only, or anywhere: then each byte that is a letter acts, and
  the frame around it goes on.
- After power-up the receiver takes three arbitrary bytes for its wake-up. Bytes that arrive while
  the board still boots are lost, or count for it as well.
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
"""Serial Command: "Serial initialization: 3 arbitrary byte"."""
IDLE_GAP_S: Final = 0.005
"""The pause after which the receiver `idle_gap` gives up half a frame."""

FramingName = Literal["counting", "naive", "idle_gap", "window"]
LetterPlace = Literal["between", "anywhere"]
Command = StateLetter | ControlFrame
Step = tuple[bytes, ControlFrame | None, bool]
Framing = Callable[[bytes, int, float], Step]

_FIRST, _SECOND = COMMAND_HEADER
_NOTHING: Final[Step] = (b"", None, False)


def counting(held: bytes, byte: int, pause_s: float) -> Step:
    """A receiver that counts seven more bytes after FF FE, for ever; FF FF FE is a header."""
    if held == COMMAND_HEADER[:1] and byte != _SECOND:
        held = b""
    if not held and byte != _FIRST:
        return _NOTHING
    return _completed(held + bytes((byte,)))


def naive(held: bytes, byte: int, pause_s: float) -> Step:
    """A receiver like `counting` that drops the byte after FF unless it is FE."""
    if held == COMMAND_HEADER[:1] and byte != _SECOND:
        return b"", None, True
    return counting(held, byte, pause_s)


def idle_gap(held: bytes, byte: int, pause_s: float) -> Step:
    """A receiver like `counting` in which a pause ends an incomplete frame."""
    return counting(b"" if pause_s >= IDLE_GAP_S else held, byte, pause_s)


def window(held: bytes, byte: int, pause_s: float) -> Step:
    """It looks at the last nine bytes after each, and acts when they begin with FF FE.

    It forgets nothing, so an FF FE within a frame may begin another one. Any byte that stands less
    than nine bytes after an FF FE may belong to a frame.
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
    """Which firmware it is.

    framing: how control frames are found.
    letters: where a byte that is a letter acts: between control frames, or anywhere.
    wakes_while_booting: bytes that arrive during the boot count for the wake-up.
    """

    framing: FramingName = "counting"
    letters: LetterPlace = "between"
    wakes_while_booting: bool = False


COUNTING: Final = ReceiverKind()


class CommandReceiver:
    """The receiver of one power-up.

    held, last_at_s: what it keeps of the bytes so far, and when the last one came: all that its
        framing knows.
    to_swallow: how many bytes are missing for the wake-up.
    """

    def __init__(self, kind: ReceiverKind = COUNTING, *, awake: bool = False) -> None:
        self.held = b""
        self._framing = FRAMINGS[kind.framing]
        self._anywhere = kind.letters == "anywhere"
        self._wakes_while_booting = kind.wakes_while_booting
        self.to_swallow = 0 if awake else WAKE_UP_BYTES
        self.last_at_s = 0.0

    def boot(self) -> None:
        """Count a byte that arrives while the board boots."""
        if self._wakes_while_booting and self.to_swallow:
            self.to_swallow -= 1

    def feed(self, byte: int, at_s: float, *, control_frames: bool) -> tuple[Command, ...]:
        """Take the byte that arrives at `at_s`; return the commands that it completes, in order.

        A control frame is recognised only where the caller says so; elsewhere each byte of one is
        looked at for a state letter.
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
