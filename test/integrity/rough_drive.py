# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Simulated robots that obey their commands: on slopes, with slip, and touched by people.

They run in simulated time. The motion monitor must not stop them.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from random import Random
from typing import Final

from session_bench import TICK_S, Bench

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.errors import CommandRefused
from omnibot_driver.core.events import Notice
from omnibot_driver.core.packets import joined
from omnibot_driver.simulator.omnibot import BoardSettings
from omnibot_driver.simulator.omnibot.motors import MotorConstants, WheelGains

SLIP: Final = 0.05
STEEPEST_PWM: Final = 200.0
"""Greatest motor effort that a slope requires, in PWM steps: 5 % of the full effort."""
HARDEST_BUMP_PWM: Final = 600.0
HARDEST_PUSH_PWM: Final = 150.0
"""Greatest force of a person's push, in PWM steps. A motor effort of this size balances it."""
FASTEST_CARRY_MPS: Final = 0.5
"""Greatest speed in m/s at which people carry a robot away. The robot's motors are at rest then."""
SECONDS_BETWEEN_HANDS: Final = 20.0

HANDS: Final = ("push", "bump", "hold", "carry")
MANNERS: Final = ("steps", "steps", "smooth", "stick", "zeros", "silence", "turns", "reversal")

BEGUN_S: Final = 1000.0


@dataclass(slots=True)
class Outcome:
    """Result of a drive.

    ``seconds``: duration of the drive.

    ``trips``: time and cause of each stop by the motion monitor, as text.

    ``said``: counts of each warning of the driver, and of refused commands.

    ``happened``: counts of pushes, bumps, holds and carries.
    """

    seconds: float = 0.0
    trips: list[str] = field(default_factory=list)
    said: Counter[str] = field(default_factory=Counter)
    happened: Counter[str] = field(default_factory=Counter)

    def add(self, other: "Outcome") -> None:
        """Add the results of another robot's drive to this result."""
        self.seconds += other.seconds
        self.trips += other.trips
        self.said += other.said
        self.happened += other.happened


def some_robot(seed: int, delta_period_s: float) -> BoardSettings:
    """Return random settings of a robot.

    Its motors, controllers and scales vary as in real robots.
    """
    random = Random(f"robot {seed}")
    motors = [
        MotorConstants(
            pwm_per_count=46 * random.uniform(0.9, 1.1),
            time_constant_ticks=6 * random.uniform(0.8, 1.5),
            friction_pwm=40 * random.uniform(0.5, 1.5),
            delay_ticks=random.choice((0, 0, 1, 3)),
        )
        for _ in range(3)
    ]
    gains = WheelGains(
        feed_forward=40 * random.uniform(0.8, 1.1),
        proportional=10 * random.uniform(0.7, 1.2),
        integral=1.5 * random.uniform(0.6, 1.4),
    )
    unusual = random.random()
    if unusual < 0.1:
        gains = WheelGains(feed_forward=40, proportional=0, integral=0.3)
    elif unusual < 0.2:  # time constant 0.35 s
        gains = WheelGains(feed_forward=0, proportional=10, integral=1.5)
    return BoardSettings(
        seed=seed,
        running=True,
        delta_period_s=delta_period_s,
        frame=random.choice(("earth", "earth", "body", "wheel_counts")),
        slip=SLIP,
        slope_pwm=random.uniform(-STEEPEST_PWM, STEEPEST_PWM),
        linear_scale=70 * random.uniform(0.9, 1.1),
        angular_scale=500 * random.uniform(0.9, 1.1),
        motors=(motors[0], motors[1], motors[2]),
        wheel_gains=gains,
    )


class RoughDrive(Bench):
    """A simulated robot that is commanded and is touched by people, on a line with delays."""

    def __init__(self, seed: int, delta_period_s: float = 0.04) -> None:
        self._random = random = Random(f"drive {seed}")
        self._fastest_mps = random.choice((0.3, 0.5, 0.5, 0.8))
        super().__init__(
            some_robot(seed, delta_period_s),
            limits=SpeedLimits(
                linear_mps=self._fastest_mps,
                angular_radps=random.choice((0.5, 1.5)),
                linear_mps2=random.choice((0.0, 0.0, 0.5, 2.0)),
                angular_radps2=random.choice((0.0, 0.0, 1.0, 5.0)),
            ),
        )
        self.outcome = Outcome()
        self._out_late_s = random.choice((0.0, 0.0, 0.01, 0.03, 0.06))
        self._in_late_ticks = random.choice((1, 1, 2, 4))
        self._on_the_way: deque[tuple[float, bytes]] = deque()
        self._kept = b""
        self._by_wheel = seed % 4 == 3
        self._manner, self._manner_until = "silence", self.now
        self._target = self._last = self._smooth = (0.0, 0.0, 0.0)
        self._period_s, self._command_at = 0.1, self.now
        self._hands_at, self._hands_until = self.now, self.now
        self._last_hands, self._to_be_carried = "none", False

    def settle(self) -> None:
        """Count the session's notices, and carry the session's bytes over the line to the board.

        Each byte reaches the board after the delay of the simulated line.
        """
        for event in self.session.take_events():
            if isinstance(event, Notice):
                self._hear(event.text)
        if data := joined(self.session.take_output(self.now)):
            self._on_the_way.append((self.now + self._out_late_s, data))
        while self._on_the_way and self._on_the_way[0][0] <= self.now:
            self.board.receive(self._on_the_way.popleft()[1])

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now += TICK_S
            self._kept += self.board.step()
            if self.board.tick % self._in_late_ticks == 0:
                data, self._kept = self._kept, b""
                self.session.inbound.receive(data, self.now)
            if self.now >= self.session.wake_at:
                self.session.tick(self.now)
            self.settle()

    def go(self, seconds: float) -> Outcome:
        """Drive for ``seconds``, and return the outcome."""
        self.open()
        self.run(2.0)
        self._hands_at = self.now + self._random.expovariate(1 / SECONDS_BETWEEN_HANDS)
        end = self.now + seconds
        while self.now < end:
            self._command()
            self._lay_hands_on()
            self.run(TICK_S)
        self.outcome.seconds += seconds
        return self.outcome

    def _hear(self, text: str) -> None:
        if "robot stopped" in text:
            self.outcome.trips.append(
                f"robot {self.board.settings.seed} after {self.now - BEGUN_S:.2f} s, last: "
                f"{self._last_hands}: {text}"
            )
        elif "moving without a command" in text or "does not move" in text:
            self.outcome.said[text.split(":")[0]] += 1

    # The commander

    def _command(self) -> None:
        random = self._random
        if self.now >= self._manner_until:
            self._change_manners()
        if self._manner == "silence" or self.now < self._command_at:
            return
        self._command_at = self.now + self._period_s * random.uniform(0.8, 1.2)
        x, y, yaw = self._target
        if self._manner == "zeros":
            x = y = yaw = 0.0
        elif self._manner == "smooth":
            a, b, c = self._smooth
            self._smooth = x, y, yaw = a + 0.2 * (x - a), b + 0.2 * (y - b), c + 0.2 * (yaw - c)
        elif self._manner == "stick":
            x, y, yaw = (value + random.gauss(0.0, 0.05) for value in (x, y, yaw))
        self._last = x, y, yaw
        try:
            if self._by_wheel:
                self.turn_wheels(30 * x, 30 * y, 30 * yaw)
            else:
                self.drive(x, y, yaw)
        except CommandRefused:
            self.outcome.said["command refused"] += 1

    def _change_manners(self) -> None:
        random = self._random
        self._manner = random.choice(MANNERS)
        self._manner_until = self.now + random.uniform(0.2, 4.0)
        self._period_s = random.choice((0.02, 0.05, 0.1, 0.1, 0.2))
        angle = random.uniform(-math.pi, math.pi)
        speed = 0.0 if self._manner == "turns" else random.uniform(0.0, self._fastest_mps)
        turn = random.choice((0.0, random.uniform(-1.0, 1.0)))
        self._target = speed * math.cos(angle), speed * math.sin(angle), turn
        if self._manner == "reversal":
            x, y, yaw = self._last
            self._target = -x, -y, -yaw

    # The people

    def _lay_hands_on(self) -> None:
        random, board = self._random, self.board
        if self.now >= self._hands_until:
            board.push()
            board.let_go()
        if self.now < self._hands_at:
            return
        self._hands_at = self.now + 1.0 + random.expovariate(1 / SECONDS_BETWEEN_HANDS)
        what = "carry" if self._to_be_carried else random.choice(HANDS)
        self._to_be_carried = what == "carry" and not self._to_be_carried
        if self._to_be_carried:  # people wait until the robot is at rest
            self._manner, self._manner_until = random.choice(("silence", "zeros")), math.inf
            self._hands_at = self.now + 1.5
            return
        self._last_hands = what
        self.outcome.happened[what] += 1
        angle, part = random.uniform(-math.pi, math.pi), random.random()
        x, y, twist = part * math.cos(angle), part * math.sin(angle), random.uniform(-1.0, 1.0)
        if what == "push":
            force = HARDEST_PUSH_PWM
            board.push(force * x, force * y, 0.2 * force * part * twist)
            self._hands_until = self.now + random.uniform(0.2, 1.5)
        elif what == "bump":
            force = HARDEST_BUMP_PWM
            board.push(force * x, force * y, 0.3 * force * part * twist)
            self._hands_until = self.now + random.uniform(0.02, 0.06)
        elif what == "hold":
            board.grip()
            self._hands_until = self.now + random.uniform(0.1, 3.0)
        else:
            board.grip(FASTEST_CARRY_MPS * x, FASTEST_CARRY_MPS * y, twist)
            self._hands_until = self.now + random.uniform(0.2, 3.0)
            self._manner_until = self._hands_until + 1.0
