"""From a stream of bytes to frames: finding where a frame begins, and proving it.

The protocol has no checksum and its header words are the commonest readings of a gyro at rest, so
a header alone proves nothing. A frame is believed for what stands around it:

* *In step* (the byte before it ended a believed frame) a frame comes out with its last byte, unless
  what follows in hand is no beginning of a frame; then it lost or gained bytes, is dropped, and the
  decoder is out of step. One doubt is worth waiting for: a frame that ends in FF may have lost a
  byte and been completed by the FF of the next header, so it waits for one byte more.
* *Out of step* the decoder tries every place, and believes the first from which two whole plausible
  frames stand in a row with nothing after them that contradicts, or one whole text.

This module reads no clock and never raises on input. It holds at most ``HELD_BYTES`` between calls
and looks at each byte a bounded number of times.
"""

import math
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.omnibot.frames import (
    INCOMPLETE,
    NO_FRAME,
    ByteOrder,
    DeltaFrame,
    Frame,
    ImuFrame,
    PausedFrame,
    PoseFrame,
    Words,
    decode_measured,
    measure,
)

FRAMES_TO_STEP_IN: Final = 2
HELD_BYTES: Final = FRAMES_TO_STEP_IN * 15

IDLE_S: Final = 0.1
"""Longer than any adapter keeps a byte back (16 ms), and ten times the board's 10 ms tick."""
TICK_BYTES: Final = 14 + 9 + 15
"""All that one tick can bring. More at once after a pause means that we were late, not the line."""

FARTHEST_POSE: Final = 1e7
"""Poses are in mm and mrad: beyond 10 km, or 1600 turns, a pose is other bytes misread."""
IMU_HEADER_WORD: Final = -6
"""FF FA, read as a signed word."""
DEAD_SENSOR: Final = (0, 0, 0)
LARGEST_DELTA: Final = 4000
"""Deltas are in 0.1 mm and 0.1 mrad: 10 m/s or 10 rad/s."""


@dataclass(slots=True)
class DecoderStatistics:
    """Counts since the decoder was made."""

    frames: int = 0
    discarded_bytes: int = 0
    faults: int = 0
    """How often the decoder fell out of step."""


class FrameDecoder:
    """Feed it what the line brings, in any chunking; it returns the frames that were in it."""

    def __init__(
        self, pose_byte_order: ByteOrder = "big", accel_counts_per_g: float = 16384.0
    ) -> None:
        self.statistics = DecoderStatistics()
        self._pose_byte_order: ByteOrder = pose_byte_order
        self._half_g_counts = accel_counts_per_g / 2
        self._held = bytearray()
        self._in_step = False
        self._last_arrival_s: float | None = None

    def feed(self, data: bytes, now: float) -> list[Frame]:
        """The frames that are complete with these bytes, in the order of the line.

        ``now``: arrival time of ``data`` in seconds, of any steady clock.
        """
        if not data:
            return []
        found = self._settle_idle(len(data), now)
        self._last_arrival_s = now
        self._held += data
        at = 0
        while at < len(self._held):
            if not self._in_step:
                start, self._in_step = self._find_step(at)
                self.statistics.discarded_bytes += start - at
                at = start
                if not self._in_step:
                    break
            length = self._trusted_length(at)
            if length == INCOMPLETE:
                break
            if length == NO_FRAME:
                self._in_step = False
                self.statistics.faults += 1
                self.statistics.discarded_bytes += 1
                at += 1
            else:
                found.append(self._take(at, length))
                at += length
        del self._held[:at]
        return found

    def flush(self, now: float) -> list[Frame]:
        """The line is closed, or was silent: what can still be told from what is held."""
        self._last_arrival_s = now
        found: list[Frame] = []
        if self._in_step and self._held and measure(self._held, 0) == len(self._held):
            found.append(self._take(0, len(self._held)))
        elif self._held:
            self.statistics.discarded_bytes += len(self._held)
            self.statistics.faults += self._in_step
            self._in_step = False
        self._held.clear()
        return found

    @property
    def begun(self) -> bytes:
        """What has come of the next frame; nothing while out of step."""
        return bytes(self._held) if self._in_step else b""

    def _settle_idle(self, arrived: int, now: float) -> list[Frame]:
        """After a real silence nothing that is held can be continued by what comes now."""
        last = self._last_arrival_s
        if not self._held or last is None or now - last < IDLE_S or arrived > TICK_BYTES:
            return []
        return self.flush(now)

    def _trusted_length(self, at: int) -> int:
        """In step: length of the frame here, INCOMPLETE also while a doubt stands."""
        length = measure(self._held, at)
        end = at + length
        if length <= 0:
            return length
        if self._look_alike(self._decode(at, length)):
            return NO_FRAME
        if end < len(self._held):
            return length if measure(self._held, end) != NO_FRAME else NO_FRAME
        return INCOMPLETE if self._held[-1] == 0xFF else length

    def _find_step(self, at: int) -> tuple[int, bool]:
        """Out of step: the first place that is proved, or that may still come to be proved."""
        for start in range(at, len(self._held)):
            proof = self._proof(start)
            if proof is not False:
                return start, proof is True
        return len(self._held), False

    def _proof(self, start: int) -> bool | None:
        """Whether frames begin here; None while more bytes must tell."""
        at = start
        for _ in range(FRAMES_TO_STEP_IN):
            length = measure(self._held, at) if at < len(self._held) else INCOMPLETE
            if length == INCOMPLETE:
                return None
            if length == NO_FRAME:
                return False
            frame = self._decode(at, length)
            if isinstance(frame, PausedFrame):
                return True
            if not self._convincing(frame):
                return False
            at += length
        return at == len(self._held) or measure(self._held, at) != NO_FRAME

    def _look_alike(self, frame: Frame) -> bool:
        """Bytes of other frames that can only look like this one.

        In a run of IMU frames a gyro that reads -6 makes a second, shifted run. Its frames have no
        weight, since the gyro stands where the accelerometer should, and the true header in it.
        """
        match frame:
            case ImuFrame(accel, _):
                return IMU_HEADER_WORD in accel and self._weightless(accel)
            case PoseFrame(x, y, theta, _):
                return not all(abs(value) <= FARTHEST_POSE for value in (x, y, theta))
            case _:
                return False

    def _convincing(self, frame: Frame) -> bool:
        """Enough to step in with. In step, a shock, a free fall or a dead sensor is delivered."""
        match frame:
            case ImuFrame(accel, _):
                return not self._weightless(accel) or accel == DEAD_SENSOR
            case DeltaFrame(dx, dy, dtheta, _):
                return max(abs(dx), abs(dy), abs(dtheta)) <= LARGEST_DELTA
            case _:
                return not self._look_alike(frame)

    def _weightless(self, accel: Words) -> bool:
        return math.hypot(*accel) < self._half_g_counts

    def _take(self, at: int, length: int) -> Frame:
        self.statistics.frames += 1
        return self._decode(at, length)

    def _decode(self, at: int, length: int) -> Frame:
        return decode_measured(self._held[at : at + length], self._pose_byte_order)
