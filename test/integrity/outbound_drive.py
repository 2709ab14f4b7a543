# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver in an outbound trial: what the real session writes, and when.

When the driver ends, this module acts in place of the driver's link and guard.
"""

import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

from outbound_teller import TICK_S, Shown, Teller
from outbound_words import is_motion, parse

from omnibot_driver import guard
from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.commands.policy import CommandSettings
from omnibot_driver.core.commands.shaping import ControlMethod
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.odometry.estimate import OdometrySettings
from omnibot_driver.core.omnibot import OmniBot, OmniBotSettings
from omnibot_driver.core.packets import joined
from omnibot_driver.core.requests import OnExit
from omnibot_driver.core.session import Session, SessionSettings
from omnibot_driver.link import SILENCE_S, STANDS_WITHIN_S

READ_S: Final = 0.002
"""Time from a tick until the driver reads its bytes, in s."""
STANDS: Final = Shown("running", False)
CLOCK_S: Final = 1e-6
"""Smallest step of the simulated time to a wake-up, in s.

Time advances even if the wake-up is already due.
"""
History = tuple[tuple[int, Shown], ...]
"""The states that the board shows in a scene, each with the tick at which the state begins."""


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes that the driver or its guard writes."""

    at_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class Command:
    """A command or a request to the driver's session, at a time in s.

    The session may refuse it.
    """

    at_s: float
    do: Callable[[Session, float], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One script of what the driver does. All times are in s.

    ``kind``: name of the kind of scene, such as "timeout".

    ``wishes``: the commands and requests to the driver's session.

    ``faults_from_s``: the line has faults from this time on.

    ``still_by_s``: the robot must be at rest at this time.

    ``begins``: the state that the board shows at the beginning.

    ``run``: whether the driver starts the board.

    ``linear_scale``: the units (LSB) of a command that mean 1 m/s.

    ``exits_s``: time at which the driver ends on request. ``killed_s``: time at which it is killed.

    ``guard_after_s``: delay from the driver's end to the guard's action.
    """

    kind: str
    wishes: tuple[Command, ...]
    ends_s: float
    faults_from_s: float
    still_by_s: float
    begins: Shown = STANDS
    run: bool = True
    rate_hz: float = 20.0
    control: ControlMethod = "velocity"
    linear_scale: float = 70.0
    limits: SpeedLimits = field(default_factory=SpeedLimits)
    exits_s: float = math.inf
    killed_s: float = math.inf
    guard_after_s: float = 0.001
    on_exit: OnExit = "stop"


def rehearse(scene: Scene, history: History) -> list[Write]:
    """Run the driver's session through a scene, while the board shows the states in ``history``.

    Return all writes after the opening of the port.
    """
    return [write for write in _Rehearsal(scene).run(dict(history)) if write.at_s < scene.ends_s]


class _Rehearsal:
    """One run of the driver's session, on a simulated board that follows commands."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._bot = OmniBot(OmniBotSettings(linear_scale=scene.linear_scale))
        self._session = Session(
            self._bot,
            SessionSettings(
                limits=scene.limits,
                commands=CommandSettings(rate_hz=scene.rate_hz),
                odometry=OdometrySettings(),
            ),
            run=scene.run,
            control=scene.control,
        )
        self._teller = Teller(scene.linear_scale, goals=scene.control == "position")
        self._writes: list[Write] = []

    def run(self, changes: dict[int, Shown]) -> list[Write]:
        """Run the events in the order of their times, and return everything that was written."""
        scene, session = self._scene, self._session
        wishes = iter(sorted(scene.wishes, key=lambda wish: wish.at_s))
        wish = next(wishes, None)
        shown, tick, now = scene.begins, 0, 0.0
        session.opened(0.0)
        self._settle(0.0)
        while True:
            read_s = (tick + 1) * TICK_S + READ_S
            wish_s = wish.at_s if wish else math.inf
            now = min(read_s, wish_s, max(now + CLOCK_S, session.wake_at))
            if now >= min(scene.ends_s, scene.exits_s, scene.killed_s):
                break
            if wish and now == wish_s:
                with contextlib.suppress(CommandRefused, RequestRefused):
                    wish.do(session, now)
                wish = next(wishes, None)
            elif now == read_s:
                tick += 1
                shown = changes.get(tick, shown)
                session.inbound.receive(self._teller.step(shown), now)
            self._settle(now)
        if scene.exits_s < scene.ends_s:
            self._leave(changes, shown, tick)
        elif scene.killed_s < scene.ends_s:
            self._writes += self._guards_words(scene.killed_s)
        return self._writes

    def _settle(self, now: float) -> None:
        if now >= self._session.wake_at:
            self._session.tick(now)
        if data := joined(self._session.take_output(now)):
            self._writes.append(Write(now, data))
            for _, mode, words in parse(data).frames:
                if is_motion(mode, words):
                    self._teller.moves_as(mode, words)
        self._session.take_events()

    def _leave(self, changes: dict[int, Shown], shown: Shown, tick: int) -> None:
        """Act as the link does when the driver ends: send Stop until the robot is at rest.

        If the robot is not at rest in time, act as the guard: write its last words.
        """
        session, now = self._session, self._scene.exits_s
        session.shutdown.begin(now)
        self._settle(now)
        for patience_s in (STANDS_WITHIN_S, SILENCE_S):
            gives_up_s = now + patience_s
            while not session.shutdown.stands:
                read_s = (tick + 1) * TICK_S + READ_S
                now = min(read_s, max(now + CLOCK_S, session.wake_at), gives_up_s)
                if now == gives_up_s:
                    break
                if now == read_s:
                    tick += 1
                    shown = changes.get(tick, shown)
                    session.inbound.receive(self._teller.step(shown), now)
                self._settle(now)
            if not (session.shutdown.stands and session.shutdown.fall_silent(now)):
                break
        stands = session.shutdown.stands
        self._writes.append(Write(now, joined(session.shutdown.sequence(self._scene.on_exit, now))))
        if not stands:
            self._writes += self._guards_words(now)

    def _guards_words(self, now: float) -> Iterator[Write]:
        """Yield the guard's writes."""
        words = joined(self._bot.stop())
        if self._session.estop_active:
            words = joined(self._bot.emergency_stop()) + words
        begin_s = now + self._scene.guard_after_s
        for number in range(guard.TIMES):
            yield Write(begin_s + number * guard.PACE_S, words)
