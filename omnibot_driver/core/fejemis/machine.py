# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Brush, lift and lights of the front board: their state, and the lines that control them.

The board does not acknowledge lines, so most lines are repeated. The line of a lift command is sent
once: it contains a run time, after which the lift stops.
"""

import math
from typing import Final

from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.fejemis.numerals import between
from omnibot_driver.core.fejemis.sums import robust

OFF: Final = (b"motv 0 0", b"brush 0")
TIMES: Final = 3
BETWEEN_S: Final = 0.1
BRUSH_AGAIN_S: Final = 1.0
"""Period in s at which ``brush 1`` is repeated while the brush is on, because a line may be lost.
"""
PACE_S: Final = 0.05
"""Shortest time in s between two lines for the lift, or between two lines for the lights.

Of several commands in this time, only the newest is sent. A stop of the lift is not delayed.
"""
MOST_VOLTS: Final = 12.0
LEAST_VOLTS: Final = 0.1
LEAST_PART: Final = 0.45
"""Smallest voltage that is sent to the lift, as a fraction of the commanded voltage.

The driver sends a lower voltage if the checksum cannot detect all damage to the commanded number.
"""
LEAST_TIME_S: Final = 0.04


class Machine:
    """State of brush, lift and lights.

    * ``volts``: voltage of the lift in V; 0 when its run time is over.
    * ``colour``: red, green and blue of the lights; None before the first command.
    """

    def __init__(self) -> None:
        self.brush = False
        self.volts = 0.0
        self.colour: tuple[int, int, int] | None = None
        self._lift_line = b""
        """The line for the lift that is still to be sent; empty if there is none."""
        self._lift_at = self._lift_again_at = self._lift_until = -math.inf
        """Times in s. ``_lift_at``: when to send the line for the lift. ``_lift_again_at``:
        earliest time for another line. ``_lift_until``: end of the lift's motion.
        """
        self._led_at, self._led_again_at = math.inf, -math.inf
        self._off_left = self._led_left = self._brush_left = 0
        self._next_at = math.inf

    @property
    def active(self) -> bool:
        """Whether brush or lift runs."""
        return self.brush or self.volts != 0.0

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        return min(
            self._next_at,
            self._led_at,
            self._lift_at if self._lift_line else math.inf,
            self._lift_until if self.volts else math.inf,
        )

    def set_brush(self, on: bool) -> None:
        """Switch the brush on or off."""
        self.brush = on
        self._brush_left = TIMES
        self._next_at = -math.inf

    def lift(self, volts: float, now: float, longest_s: float) -> None:
        """Move the lift at ``volts`` for at most ``longest_s``; a positive voltage raises it.

        0 V stops the lift at once. Raises CommandRefused for NaN or infinity.
        """
        if not math.isfinite(volts):
            raise CommandRefused(
                "lift_cmd rejected: contains NaN or infinity; fix the publishing node"
            )
        volts = max(-MOST_VOLTS, min(MOST_VOLTS, volts))
        self.volts = volts if abs(volts) >= LEAST_VOLTS else 0.0
        self._lift_line, seconds = lift_line(self.volts, longest_s)
        self._lift_at = max(now, self._lift_again_at) if self.volts else now
        self._lift_until = self._lift_at + seconds

    def set_colour(self, red: int, green: int, blue: int, now: float) -> None:
        """Set the colour of the LED strip; each part is in 0..255."""
        self.colour = red, green, blue
        self._led_left = TIMES
        self._led_at = max(now, self._led_again_at)

    def begin(self) -> None:
        """Switch off the brush and the lift, and send the colour again: a board has restarted."""
        self.off()
        if self.colour is not None:
            self._led_left, self._led_at = TIMES, -math.inf

    def off(self) -> None:
        """Switch off the brush and the lift."""
        self.brush, self.volts = False, 0.0
        self._lift_line = b""
        self._off_left, self._brush_left = TIMES, 0
        self._next_at = -math.inf

    def switch_off(self) -> list[bytes]:
        """Switch off the brush and the lift, and return the lines that do this.

        If the user has set the colour of the LED strip, the board's own lights return.
        """
        self.off()
        lights = [b"ledon 1", b"leds"] if self.colour else []
        return [*TIMES * OFF, *lights]

    def due(self, now: float) -> list[bytes]:
        """Return the lines to send now."""
        return [*self._lift_due(now), *self._off_due(now), *self._led_due(now)]

    def _lift_due(self, now: float) -> list[bytes]:
        if self.volts and now >= self._lift_until:
            self.volts, self._lift_line = 0.0, b""
            return [OFF[0]]
        if not self._lift_line or now < self._lift_at:
            return []
        text, self._lift_line = self._lift_line, b""
        self._lift_again_at = now + PACE_S
        return [text]

    def _off_due(self, now: float) -> list[bytes]:
        if now < self._next_at:
            return []
        texts: list[bytes] = []
        if self._off_left:
            self._off_left -= 1
            commanded = self.volts, self.brush  # commands since the call of ``off``
            texts += [text for text, on in zip(OFF, commanded, strict=True) if not on]
        elif self.brush or self._brush_left:
            self._brush_left = max(0, self._brush_left - 1)
            texts.append(b"brush 1" if self.brush else b"brush 0")
        rest_s = BRUSH_AGAIN_S if self.brush else math.inf
        self._next_at = now + (BETWEEN_S if self._off_left or self._brush_left else rest_s)
        return texts

    def _led_due(self, now: float) -> list[bytes]:
        if now < self._led_at or self.colour is None:
            return []
        self._led_left -= 1
        self._led_again_at = now + PACE_S
        self._led_at = now + BETWEEN_S if self._led_left > 0 else math.inf
        return [b"ledon %d" % any(self.colour), b"ledb %d %d %d" % self.colour]


def lift_line(volts: float, longest_s: float) -> tuple[bytes, float]:
    """Return the line that moves the lift (``motv``), and its run time in s.

    If the checksum cannot detect all damage to the number, the line contains a lower voltage, but
    at least ``LEAST_PART * volts``.
    """
    if not volts:
        return OFF[0], 0.0
    seconds, time_text = between(0.0, max(LEAST_TIME_S, longest_s), negative=True)[-1]
    most, sign = abs(volts), "-" if volts < 0.0 else ""
    texts = [text for _, text in between(LEAST_PART * most, most, negative=volts < 0.0)]
    lines = (f"motv {sign}{text} {time_text}".encode("ascii") for text in reversed(texts))
    return next(filter(robust, lines)), seconds
