# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The judge of an outbound trial: it compares what the board understood with what the driver sent.

- The driver *drives* from a write with motion frames until the first frame of another kind.
- A *commanded* set-point is in the current or the previous write of the driver.
- An *uncommanded* set-point is in neither of these writes. It lasts until a commanded set-point, a
  pause or a reboot.
- A *stray* motion frame is one that the board understands while the driver does not drive.
- A *false* letter is a byte that the driver has sent as a part of a frame, and that the board takes
  for a letter. An *added* letter is a byte that faults of the line have added or changed.
"""

import math
from copy import copy
from dataclasses import dataclass, field, fields
from typing import Final

from outbound_words import Items, is_motion

from omnibot_driver.simulator.omnibot.wire import BYTE_S, ControlFrame, ControlMode

LONG_S: Final = 0.002
EXAMPLES: Final = 3
_LONGEST: Final = ("stray_s", "longest_s")


@dataclass(slots=True)
class Score:
    """Counts from trials, and times in s. Scores can be added. The module defines the terms.

    ``strayed``: number of trials with stray motion.

    ``stray_s``: duration of the longest stray motion.

    ``overdue``: number of trials in which the robot still drove when it had to be at rest.

    ``for_good``: number of trials in which the robot still drove at the end.

    ``driving_s``: total time for which the driver drove. ``frames``: number of control frames that
    the driver wrote in this time.

    ``uncommanded_s``: total time of the uncommanded set-points.

    ``long``: number of the uncommanded set-points of over 2 ms.

    ``longest_s``: duration of the longest uncommanded set-point.

    ``false_estops``: number of e-stops that the board understood, but the driver did not send.
    """

    trials: int = 0
    strayed: int = 0
    stray_s: float = 0.0
    overdue: int = 0
    for_good: int = 0
    driving_s: float = 0.0
    frames: int = 0
    uncommanded_s: float = 0.0
    uncommanded: int = 0
    long: int = 0
    longest_s: float = 0.0
    false_letters: int = 0
    added_letters: int = 0
    false_estops: int = 0
    examples: list[object] = field(default_factory=list)

    def __iadd__(self, other: "Score") -> "Score":
        for each in fields(self):
            mine, more = getattr(self, each.name), getattr(other, each.name)
            both = max(mine, more) if each.name in _LONGEST else mine + more
            setattr(self, each.name, both)
        del self.examples[EXAMPLES:]
        return self


class Judge:
    """The judge of one trial. It gets the driver's writes and what the board understands, in order.

    ``driving``: whether the driver's last write with control frames contained a motion frame.
    """

    def __init__(self) -> None:
        self.score = Score(trials=1)
        self.driving = self._strayed = False
        self._now, self._before = Items(), Items()
        self._driving_from_s = 0.0
        self._stands_from_s = -math.inf
        self._uncommanded_from_s: float | None = None
        self._stray_from_s: float | None = None

    @property
    def calm(self) -> bool:
        """Whether the board obeys neither a stray motion frame nor an uncommanded set-point."""
        return self._uncommanded_from_s is None and self._stray_from_s is None

    def branch(self, score: Score) -> "Judge":
        """Return a copy of this judge in its present state, for a further trial.

        The copy adds its counts to ``score``.
        """
        other = copy(self)
        other.score = score
        score.trials += 1
        return other

    def write(self, items: Items, start_s: float) -> None:
        """Record that the first byte of this write is on the line at ``start_s``."""
        self._before, self._now = self._now, items
        if items.moves and not self.driving:
            self.driving = True
            self._driving_from_s, self._stands_from_s = start_s, math.inf
        if self.driving:
            self.score.frames += len(items.frames)
            if items.stops:
                offset = items.frames[0][0]
                self._stands_from_s = start_s + (offset + 1) * BYTE_S
                self.score.driving_s += self._stands_from_s - self._driving_from_s
                self.driving = False

    def writes(self, last: Items, frames: int) -> None:
        """Record several writes that arrive undamaged and do not change what the board does.

        ``last``: the newest of these writes. ``frames``: the number of their control frames.
        """
        self._now = last
        if self.driving:
            self.score.frames += frames

    def frame(self, frame: ControlFrame, at_s: float) -> str:
        """Record a control frame that the board understands.

        Return the name of the error that this frame causes, such as "stray motion", or "".
        """
        if at_s > self._stands_from_s + BYTE_S / 2:
            self.no_setpoint(at_s)
            if not is_motion(frame.mode, frame.values):
                return ""
            self._stray_from_s = at_s
            self.score.strayed += not self._strayed
            self._strayed = True
            return "stray motion"
        for items in (self._now, self._before):
            for _, mode, words in items.frames:
                if mode == frame.mode and words == frame.values:
                    self.no_setpoint(at_s)
                    return ""
        self.score.false_estops += frame.mode == ControlMode.ESTOP
        if self._uncommanded_from_s is not None:
            return ""
        self._uncommanded_from_s = at_s
        return "uncommanded"

    def letter(self, letter: int, at: int) -> str:
        """Record a letter on which the board acts. Return "false letter" or "".

        A letter is false if the driver wrote this byte, but not as a letter.

        ``at``: position of the letter in the write; negative if faults of the line have added or
        changed the letter.
        """
        if at < 0:
            self.score.added_letters += 1
        elif (at, letter) not in self._now.letters:
            self.score.false_letters += 1
            return "false letter"
        return ""

    def no_setpoint(self, at_s: float) -> None:
        """End the active set-point at ``at_s``.

        If the set-point is uncommanded or stray, count its duration.
        """
        score = self.score
        if self._uncommanded_from_s is not None:
            lasted_s = at_s - self._uncommanded_from_s
            score.uncommanded_s += lasted_s
            score.uncommanded += 1
            score.long += lasted_s > LONG_S
            score.longest_s = max(score.longest_s, lasted_s)
            self._uncommanded_from_s = None
        if self._stray_from_s is not None:
            score.stray_s = max(score.stray_s, at_s - self._stray_from_s)
            self._stray_from_s = None

    def end(self, at_s: float, *, driven_when_due: bool = False, driven: bool = False) -> bool:
        """End the scene. Return whether the robot drove for too long.

        ``driven_when_due``: whether the robot still drove at the time at which it had to be at
        rest. ``driven``: whether it still drove at the end.
        """
        self.no_setpoint(at_s)
        if self.driving:
            self.score.driving_s += at_s - self._driving_from_s
        self.score.overdue += driven_when_due
        self.score.for_good += driven
        return driven_when_due or driven
