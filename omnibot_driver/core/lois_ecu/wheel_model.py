# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""How a wheel should move by what was commanded, where the board does not tell.

A speed that nears the commanded one. Also keeps what the board's firmware makes of a command:
whether it counts this wheel's ticks now. Knows commands and times, no pose.

The public firmware counts ticks while the wheel's RPM target is positive. Duty leaves that target
as it was, but each tick under negative duty lowers it.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

LATENCY_S: Final = 0.06
"""From our writing to the controller's next step: half of 91 ms, the line, the reading."""
SPEEDING_UP_S: Final = 0.45
"""Time constant, as far as it is the same with any gains."""
COASTING_S: Final = 0.14
STEP_S: Final = 0.02

CommandKind = Literal["rpm", "duty"]


@dataclass(frozen=True, slots=True)
class Commanded:
    """From ``at_s`` on: in m/s of the rim."""

    at_s: float
    kind: CommandKind
    speed_mps: float


@dataclass(slots=True)
class Expected:
    """Of one wheel within an interval. ``blind_m``: rolled while no ticks were counted.

    ``blind_s``: for so long; ``unsteady_m``: part of it while the speed was changing.
    """

    way_m: float = 0.0
    blind_m: float = 0.0
    blind_s: float = 0.0
    unsteady_m: float = 0.0
    changes_mps: float = 0.0
    started: bool = False
    from_mps: float = 0.0


class WheelModel:
    """``rounding_mps``: the controller sees its speed without the fraction of an RPM, and makes up
    for that. ``gain_reverse``: speed over commanded speed besides, backwards.
    """

    def __init__(self, rounding_mps: float) -> None:
        self.speed_mps = 0.0
        self.gain_reverse = 1.0
        self.rounding_mps = rounding_mps
        self._commands: deque[Commanded] = deque(maxlen=64)
        self._now = Commanded(-math.inf, "rpm", 0.0)
        self._hidden_mps = 0.0
        """The RPM target that the firmware keeps in duty mode."""
        self.steady_since_s = -math.inf

    @property
    def target_mps(self) -> float:
        """What is carried out."""
        return self._now.speed_mps

    @property
    def final_mps(self) -> float:
        """What the speed nears."""
        return self._course()[0]

    @property
    def kind(self) -> CommandKind:
        """How it was said."""
        return self._now.kind

    @property
    def counting(self) -> bool:
        """Whether the public firmware counts this wheel's ticks."""
        return self._hidden_mps > 0.0

    @property
    def measuring(self) -> bool:
        """Whether the public firmware measures this wheel's speed."""
        return self._hidden_mps != 0.0

    def command(self, at_s: float, kind: CommandKind, speed_mps: float) -> None:
        """This was written then."""
        last = self._commands[-1] if self._commands else self._now
        if (last.kind, last.speed_mps) != (kind, speed_mps):
            self._commands.append(Commanded(at_s + LATENCY_S, kind, speed_mps))

    def advance(self, from_s: float, to_s: float) -> Expected:
        """What it should do from then to then."""
        expected = Expected(from_mps=self.speed_mps)
        at_s = from_s
        while at_s < to_s:
            while self._commands and self._commands[0].at_s <= at_s:
                self._carry_out(self._commands.popleft(), expected)
            end_s = min(at_s + STEP_S, to_s)
            if self._commands:
                end_s = max(min(end_s, self._commands[0].at_s), at_s + 1e-4)
            self._step(end_s - at_s, expected)
            at_s = end_s
        return expected

    def ahead(self, duration_s: float) -> float:
        """The way in the next while, if nothing else is commanded; changes nothing."""
        final, constant_s = self._course()
        part = constant_s * (1 - math.exp(-duration_s / constant_s))
        return final * duration_s + (self.speed_mps - final) * part

    def _carry_out(self, command: Commanded, expected: Expected) -> None:
        expected.changes_mps += abs(self._now.speed_mps - command.speed_mps)
        self._now = command
        self.steady_since_s = command.at_s
        if command.kind == "rpm":
            self._hidden_mps = command.speed_mps
        elif command.speed_mps < 0:
            self._hidden_mps = min(self._hidden_mps, -1e-3)

    def _course(self) -> tuple[float, float]:
        final = self._now.speed_mps
        if final < 0:
            final *= self.gain_reverse
        if final and self._now.kind == "rpm":
            final += math.copysign(self.rounding_mps, final)
        return final, SPEEDING_UP_S if final else COASTING_S

    def _step(self, duration_s: float, expected: Expected) -> None:
        final, constant_s = self._course()
        before = self.speed_mps
        expected.started |= not before and final != 0.0
        self.speed_mps += (final - before) * (1 - math.exp(-duration_s / constant_s))
        if not final and abs(self.speed_mps) < 0.01:
            self.speed_mps = 0.0
        way_m = (before + self.speed_mps) / 2 * duration_s
        expected.way_m += way_m
        if not self.counting:
            expected.blind_m += way_m
            expected.blind_s += duration_s if way_m else 0.0
            expected.unsteady_m += abs(final - self.speed_mps) * duration_s
