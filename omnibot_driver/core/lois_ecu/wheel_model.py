# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Model of one wheel's commands: when they take effect, and when the firmware counts ticks.

The public firmware counts ticks only while the RPM target is positive.

This module works on set-points and times.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

HEARD_S: Final = 0.008
"""Assumed time in s from the writing of a line until the board has read it."""
STEP_S: Final = 0.2
FIRMWARE_STEP_S: Final = 0.091
"""``STEP_S``, ``FIRMWARE_STEP_S``: period of the speed controller in s. ``STEP_S`` is the period in
the manual, ``FIRMWARE_STEP_S`` the period in the public firmware."""

CommandKind = Literal["rpm", "duty"]


@dataclass(frozen=True, slots=True)
class _Effect:
    """Effect that a command has on a wheel at the time ``at_s``.

    ``halts``: whether the RPM target becomes zero. In this case, ``kind`` and ``speed_mps`` have no
    meaning.
    """

    at_s: float
    halts: bool
    kind: CommandKind
    speed_mps: float


class WheelModel:
    """The commands of one wheel. Speeds are those of the wheel's rim.

    * ``kind``, ``target_mps``: the command that the motor follows now.
    * ``hidden_mps``: the RPM target that the firmware keeps, also while a duty is set. If this
      target is zero, a negative duty makes it negative. Ticks are counted only while this target is
      positive.
    """

    def __init__(self, step_s: float = STEP_S) -> None:
        self.kind: CommandKind = "rpm"
        self.target_mps = 0.0
        self.hidden_mps = 0.0
        self.step_s = step_s
        """Period of the speed controller in s. A command takes effect at the next step of the
        controller, after half a period on average."""
        self._effects: deque[_Effect] = deque(maxlen=128)
        self._heard: tuple[CommandKind, float] = ("rpm", 0.0)
        self._rpm_mps = 0.0

    @property
    def commanded_mps(self) -> float:
        """Speed of the last command, in m/s. The motor may not follow this command yet."""
        return self._heard[1]

    @property
    def counting(self) -> bool:
        """Whether the public firmware counts this wheel's ticks."""
        return self.hidden_mps > 0.0

    @property
    def measured_sign(self) -> int:
        """Sign of the speed that the public firmware measures for this wheel.

        0 if it measures none.
        """
        return (self.hidden_mps > 0.0) - (self.hidden_mps < 0.0)

    @property
    def unmeasured(self) -> bool:
        """Whether the public firmware does not measure this wheel's speed, because a duty is set.

        A stop is a duty too: the speed of a wheel that rolls out is not measured.
        """
        return self.kind == "duty" and not self.measured_sign

    def command(self, at_s: float, kind: CommandKind, speed_mps: float) -> None:
        """Record that a command was written at ``at_s``."""
        if (kind, speed_mps) == self._heard and not (kind == "rpm" and not speed_mps):
            return
        halts = kind == "rpm" and (not speed_mps or speed_mps * self._rpm_mps < 0)
        if kind == "rpm":
            self._rpm_mps = speed_mps
        if halts:
            self._effects.append(_Effect(at_s + HEARD_S, True, kind, 0.0))
        self._heard = (kind, speed_mps)
        self._effects.append(_Effect(at_s + HEARD_S + self.step_s / 2, False, kind, speed_mps))
        if halts:
            self._effects = deque(sorted(self._effects, key=_at), maxlen=128)

    def next_change_s(self) -> float:
        """Return the time in s at which the next command takes effect; infinity if none waits."""
        return self._effects[0].at_s if self._effects else math.inf

    def carry_out(self, now: float) -> tuple[bool, bool]:
        """Apply all effects of commands that are due at ``now``.

        Return two values: whether the firmware has cleared the speed that it measured last, and
        whether the motor now follows another command.
        """
        cleared = False
        before = self.kind, self.target_mps
        while self._effects and self._effects[0].at_s <= now:
            effect = self._effects.popleft()
            if effect.halts:
                self.hidden_mps, cleared = 0.0, True
                continue
            self.kind, self.target_mps = effect.kind, effect.speed_mps
            if effect.kind == "rpm":
                self.hidden_mps = effect.speed_mps
            elif effect.speed_mps < 0 and not self.hidden_mps:
                self.hidden_mps = -1e-3
        return cleared, before != (self.kind, self.target_mps)


def _at(effect: _Effect) -> float:
    return effect.at_s
