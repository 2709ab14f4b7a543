# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives of a simulated LOIS robot, with its odometry and its true pose, in simulated time."""

import math
from dataclasses import dataclass, replace
from functools import cache
from random import Random

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.lois_ecu import Setting, Stream
from omnibot_driver.core.lois_ecu.conversation import LoisConversation
from omnibot_driver.core.lois_ecu.fused_odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.readings import LoisReading
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import QUIRKS, Firmware, LoisSettings, SimulatedLois

STOP = (0.0, 0.0)
USUAL_PERIODS_MS = {Stream.TICKS: 200, Stream.ODOMETRY: 200}
"""Periods of the reports in ms that the benches set, as docs/boards/lois_ecu.md recommends. If a
user sets no periods, the board keeps its own period of 400 ms (``test_lois_own_periods.py``)."""
HOST_GAINS = LoisEcuSettings(
    low_pass=0.1,
    written={
        Setting.LEFT_FEED_FORWARD: 2.0,
        Setting.LEFT_KP: 0.629402,
        Setting.LEFT_TN: 0.301907,
        Setting.LEFT_TD: 0.611789,
        Setting.RIGHT_FEED_FORWARD: 2.0,
        Setting.RIGHT_KP: 0.470583,
        Setting.RIGHT_TN: 0.232542,
        Setting.RIGHT_TD: 0.60868,
    },
)
"""Settings with the gains that the ECU's own host writes for the speed controllers of both wheels.

With the gains that the public firmware boots with, the right wheel's speed would oscillate.
"""
REPEAT_S = 0.05
LATE_READS_S = (0.05, 0.35)
"""Least and greatest time between two reads of a very busy computer, in s."""

Program = list[tuple[float, tuple[float, float]]]
"""Steps of a drive. Each has a duration in s and the set-points of left and right wheel in RPM."""

CLASSES: dict[str, Program] = {
    "straight": [(21.0, (20, 20))],
    "curve": [(21.0, (17, 22))],
    "in place": [(12.0, (-15, 15))],
    "reverse": [(20.0, (-20, -20))],
    "reverse curve": [(20.0, (-22, -18))],
    "mixed": [
        (6.0, (20, 24)),
        (1.5, STOP),
        (5.0, (-20, -20)),
        (1.5, STOP),
        (4.0, (15, -15)),
        (5.0, (30, 30)),
    ],
}


MOTIONS = ("straight", "curve", "in place", "reverse", "reverse curve", "jerky", "left", "right")
"""Names of motions in ``test/integrity/lois_odometry.py``. "left" and "right" are drives along
squares."""


VARIED = (
    "straight ahead",
    "curve left",
    "curve right",
    "place left",
    "place right",
    "straight back",
    "curve back",
)
"""Names of motions in ``test/integrity/lois_odometry.py``: drives of 5 m, and turns of 80° to 400°.

The seed of a motion sets its speed, and the curvature of a curve or the angle of a turn.
"""


def with_usual_periods(settings: LoisEcuSettings) -> LoisEcuSettings:
    """Return the settings, with ``USUAL_PERIODS_MS`` if they have no periods."""
    return replace(settings, periods_ms=settings.periods_ms or USUAL_PERIODS_MS)


def varied(name: str, seed: int) -> Program:
    """Return the program of one of the motions ``VARIED``. The seed sets its random values."""
    random = Random(f"varied {name} {seed}")
    if name.startswith("place"):
        rpm, angle_rad = random.uniform(7, 20), math.radians(random.uniform(80, 400))
        sign = 1 if name == "place left" else -1
        return [(angle_rad * 0.235 / 0.0136 / rpm, (-sign * rpm, sign * rpm))]
    rpm = random.uniform(10, 35)
    half = rpm * random.uniform(0.025, 0.175) * (1 if "left" in name else -1)
    if name.startswith("straight"):
        half = 0.0
    if name.endswith("back"):
        rpm, half = -rpm, half * random.choice((-1, 1))
    return [(5.0 / 0.0136 / abs(rpm), (rpm - half, rpm + half))]


def jerky(seed: int, seconds: float = 20.0) -> Program:
    """Return random set-points of up to 25 RPM in either direction, each for 0.2 to 1.2 s.

    About 15 % of them are Stop.
    """
    random, program, left_s = Random(f"jerky {seed}"), [], seconds
    while left_s > 0:
        duration_s = random.choice((0.2, 0.3, 0.5, 0.8, 1.2))
        pair = (random.uniform(-25, 25), random.uniform(-25, 25))
        program.append((duration_s, STOP if random.random() < 0.15 else pair))
        left_s -= duration_s
    return program


@dataclass(frozen=True)
class Drive:
    """The outcome of a drive.

    ``true``: true pose at the time of the last estimate.

    ``way_m``: true length of the path.

    ``turned_rad``: sum of the absolute values of all true turns.
    """

    true: Pose
    way_m: float
    turned_rad: float
    last: FusedOdometry
    driver: LoisConversation

    @property
    def error(self) -> Pose:
        """Estimated pose minus true pose, in the odometry frame."""
        return self.last.pose - self.true

    @property
    def nees(self) -> float:
        """Normalised squared error (NEES). Its mean over drives is 3 if the covariance is right."""
        c, e = self.last.covariance, self.error
        rows = [
            [c.xx, c.xy, c.x_yaw, e.x_m],
            [c.xy, c.yy, c.y_yaw, e.y_m],
            [c.x_yaw, c.y_yaw, c.yaw_yaw, e.yaw_rad],
        ]
        for pivot in range(3):  # Gaussian elimination; the covariance is positive definite
            for row in range(pivot + 1, 3):
                factor = rows[row][pivot] / rows[pivot][pivot]
                rows[row] = [a - factor * b for a, b in zip(rows[row], rows[pivot], strict=True)]
        solved = [0.0, 0.0, 0.0]
        for row in (2, 1, 0):
            rest = sum(rows[row][k] * solved[k] for k in range(row + 1, 3))
            solved[row] = (rows[row][3] - rest) / rows[row][row]
        return e.x_m * solved[0] + e.y_m * solved[1] + e.yaw_rad * solved[2]

    @property
    def sigmas(self) -> float:
        """Largest of the errors of x, y and yaw, each divided by its standard deviation."""
        c, e = self.last.covariance, self.error
        pairs = ((e.x_m, c.xx), (e.y_m, c.yy), (e.yaw_rad, c.yaw_yaw))
        return max(abs(error) / math.sqrt(variance) for error, variance in pairs)


def nominal(firmware: Firmware, seed: int = 0) -> LoisSettings:
    """Return settings of a simulated board: exact wheel sizes, a random load of 1 % duty."""
    return LoisSettings(quirks=QUIRKS[firmware], seed=seed, load_percent=1.0)


def wrong(firmware: Firmware, seed: int) -> LoisSettings:
    """Return settings of a simulated board with slip, load, and wheel sizes about 1 % off."""
    random = Random(f"wrong {seed}")
    return LoisSettings(
        quirks=QUIRKS[firmware],
        seed=seed,
        load_percent=random.uniform(0.5, 3.0),
        slip=0.0035,
        wheel_radius_scale=(random.gauss(1.0, 0.01), random.gauss(1.0, 0.01)),
    )


class Rig:
    """A simulated board and its driver.

    * ``ours``: the driver's settings; None means ``HOST_GAINS``.
    * ``estimates``: pairs of estimated odometry and true pose.
    * ``loss``: probability that a byte is lost.
    * ``reads_s``: least and greatest time between two reads, in s.
    * ``own_periods``: whether the board keeps its own report periods if ``ours`` has none.
    """

    def __init__(
        self,
        settings: LoisSettings,
        ours: LoisEcuSettings | None = None,
        *,
        own_periods: bool = False,
        loss: float = 0.0,
        reads_s: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._loss, self._random = loss, Random(f"line {settings.seed}")
        self._reads_s, self._unread, self._read_at_s = reads_s, b"", 0.0
        self.board = SimulatedLois(settings)
        ours = HOST_GAINS if ours is None else ours
        self.driver = LoisConversation(ours if own_periods else with_usual_periods(ours))
        self.estimates: list[tuple[FusedOdometry, Pose]] = []
        self.readings: list[LoisReading] = []
        self.way_m = self.turned_rad = 0.0

    @property
    def now(self) -> float:
        return self.board.now_s

    @property
    def place(self) -> Pose:
        """True pose of the robot."""
        truth = self.board.truth
        return Pose(truth.x_m, truth.y_m, truth.yaw_rad)

    def _arrived(self, data: bytes) -> bytes:
        if not self._loss:
            return data
        draw = self._random.random
        return bytes([byte for byte in data if draw() >= self._loss])

    def say(self, data: bytes) -> None:
        """Pass these bytes to the board, and inform the driver that they were written."""
        self.board.receive(self._arrived(data))
        self.driver.wrote(data, self.now)

    def run(self, seconds: float) -> None:
        """Run the board for ``seconds``. The driver writes what is due and reads what arrives."""
        place = self.place
        for _ in range(round(seconds / self.board.tick_s)):
            if self.now >= self.driver.wake_at:
                self.say(self.driver.due(self.now))
            self._unread += self._arrived(self.board.step())
            found = self._read()
            if (before := place) != (place := self.place):
                way = before.way_to(place)
                self.way_m += way.way_m
                self.turned_rad += abs(way.yaw_rad)
            self.readings += found
            for reading in found:
                if isinstance(reading, FusedOdometry):
                    self.estimates.append((reading, place))

    def _read(self) -> list[LoisReading]:
        if self.now < self._read_at_s:
            return self.driver.receive(b"", self.now) if self.now >= self.driver.held_until else []
        self._read_at_s = self.now + self._random.uniform(*self._reads_s)
        data, self._unread = self._unread, b""
        found = self.driver.receive(data, self.now) if data else []
        return found + self.driver.receive(b"", self.now)

    def order(self, left_rpm: float, right_rpm: float, seconds: float) -> None:
        """Send the set-points every ``REPEAT_S`` for ``seconds``. Two zeros are sent as Stop."""
        for _ in range(round(seconds / REPEAT_S)):
            unit = math.tau / 60
            self.say(self.driver.wheels((left_rpm * unit, right_rpm * unit)))
            self.run(REPEAT_S)

    def drive(self, program: Program) -> Drive:
        self.run(4.0)
        for seconds, (left, right) in [*program, (2.0, STOP)]:
            self.order(left, right, seconds)
        return self.outcome()

    def outcome(self) -> Drive:
        """Return the outcome so far: the last estimate, and the true pose at its time."""
        last, true = self.estimates[-1]
        return Drive(true, self.way_m, self.turned_rad, last, self.driver)

    def square(self, side_m: float, sign: int) -> None:
        """Drive a square that is steered by the true pose, with stops before and after each turn.

        ``sign``: 1 for turns to the left, −1 for turns to the right.
        """
        goal_rad = 0.0
        for _ in range(4):
            start = self.place
            while (
                math.cos(goal_rad) * (self.place.x_m - start.x_m)
                + math.sin(goal_rad) * (self.place.y_m - start.y_m)
                < side_m
            ):
                self._steer(0.3, max(-0.15, min(0.15, goal_rad - self.place.yaw_rad)))
            self.order(*STOP, 1.5)
            goal_rad += sign * math.pi / 2
            while abs(goal_rad - self.place.yaw_rad) > 0.15:
                self._steer(0.0, math.copysign(0.5, goal_rad - self.place.yaw_rad))
            self.order(*STOP, 1.5)

    def _steer(self, speed_mps: float, turning_radps: float) -> None:
        self.say(self.driver.velocity(BodyTwist(speed_mps, 0.0, turning_radps)))
        self.run(REPEAT_S)


def motion(
    settings: LoisSettings,
    name: str,
    ours: LoisEcuSettings | None = None,
    *,
    side_m: float = 5.0,
    loss: float = 0.0,
    reads_s: tuple[float, float] = (0.0, 0.0),
    own_periods: bool = False,
) -> Drive:
    """Drive one of the motions ``MOTIONS`` or ``VARIED``, and return the outcome.

    The encoders begin at random positions between two ticks. ``loss``, ``reads_s``,
    ``own_periods``: as in ``Rig``.
    """
    rig = Rig(settings, ours, loss=loss, reads_s=reads_s, own_periods=own_periods)
    random = Random(f"encoders {settings.seed}")
    for encoder in rig.board._vehicle.encoders:
        encoder._periods = random.random()
    if name in ("left", "right"):
        rig.run(4.0)
        rig.square(side_m, 1 if name == "left" else -1)
        rig.order(*STOP, 2.0)
        return rig.outcome()
    if name in VARIED:
        return rig.drive(varied(name, settings.seed))
    return rig.drive(jerky(settings.seed) if name == "jerky" else CLASSES[name])


def drive(settings: LoisSettings, program: Program, *, loss: float = 0.0) -> Drive:
    """Drive the steps of ``program``, stop, and return the outcome.

    Each byte is lost with probability ``loss``, in either direction.
    """
    return Rig(settings, loss=loss).drive(program)


@cache
def driven(firmware: Firmware, name: str, seed: int = 1) -> Drive:
    """Return the outcome of a drive with exact wheel sizes."""
    return drive(nominal(firmware, seed), CLASSES[name])


def off_m(one: Drive) -> float:
    """Return the distance in m between the estimated and the true position."""
    return math.hypot(one.error.x_m, one.error.y_m)
