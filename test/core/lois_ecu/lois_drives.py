# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives of a simulated LOIS robot, with the odometry beside it, in simulated time."""

import math
from dataclasses import dataclass
from random import Random

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.lois_ecu.board import LoisEcu
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry
from omnibot_driver.core.lois_ecu.readings import LoisReading
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import QUIRKS, Firmware, LoisSettings, SimulatedLois

STOP = (0.0, 0.0)
REPEAT_S = 0.05

Program = list[tuple[float, tuple[float, float]]]
"""For so long, at these RPM left and right."""

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


@dataclass(frozen=True)
class Drive:
    """``true``: where the robot was at the last estimate, from where the estimates began."""

    true: Pose
    way_m: float
    turned_rad: float
    last: FusedOdometry
    driver: LoisEcu

    @property
    def error(self) -> Pose:
        """Estimated less true, in the odometry frame."""
        return self.last.pose - self.true

    @property
    def nees(self) -> float:
        """Normalised squared error of x, y, yaw: 3 on average for an honest covariance."""
        c, e = self.last.covariance, self.error
        rows = [
            [c.xx, c.xy, c.x_yaw, e.x_m],
            [c.xy, c.yy, c.y_yaw, e.y_m],
            [c.x_yaw, c.y_yaw, c.yaw_yaw, e.yaw_rad],
        ]
        for pivot in range(3):  # Gauss; the covariance is positive
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
        """The largest error of one axis in its standard deviations."""
        c, e = self.last.covariance, self.error
        pairs = ((e.x_m, c.xx), (e.y_m, c.yy), (e.yaw_rad, c.yaw_yaw))
        return max(abs(error) / math.sqrt(variance) for error, variance in pairs)


def nominal(firmware: Firmware, seed: int = 0) -> LoisSettings:
    """Wheels of the right size, on ground that takes a little."""
    return LoisSettings(quirks=QUIRKS[firmware], seed=seed, load_percent=1.0)


def wrong(firmware: Firmware, seed: int) -> LoisSettings:
    """Wheels that are off by 1 % (standard deviation) and slip."""
    random = Random(f"wrong {seed}")
    return LoisSettings(
        quirks=QUIRKS[firmware],
        seed=seed,
        load_percent=random.uniform(0.5, 3.0),
        slip=0.0035,
        wheel_radius_scale=(random.gauss(1.0, 0.01), random.gauss(1.0, 0.01)),
    )


class Rig:
    """A board that is driven; ``estimates`` are all that came, each with the truth beside it."""

    def __init__(
        self, settings: LoisSettings, ours: LoisEcuSettings | None = None, *, loss: float = 0.0
    ) -> None:
        self._loss, self._random = loss, Random(f"line {settings.seed}")
        self.board = SimulatedLois(settings)
        self.driver = LoisEcu(LoisEcuSettings() if ours is None else ours)
        self.estimates: list[tuple[FusedOdometry, Pose]] = []
        self.readings: list[LoisReading] = []
        self.way_m = self.turned_rad = 0.0

    @property
    def now(self) -> float:
        """Simulated."""
        return self.board.now_s

    @property
    def place(self) -> Pose:
        """Where the robot truly is."""
        truth = self.board.truth
        return Pose(truth.x_m, truth.y_m, truth.yaw_rad)

    def _arrived(self, data: bytes) -> bytes:
        if not self._loss:
            return data
        return bytes(byte for byte in data if self._random.random() >= self._loss)

    def say(self, data: bytes) -> None:
        """These go out now."""
        self.board.receive(self._arrived(data))
        self.driver.wrote(data, self.now)

    def run(self, seconds: float) -> None:
        """The driver writes what is due and reads what comes."""
        for _ in range(round(seconds / self.board.tick_s)):
            if self.now >= self.driver.wake_at:
                self.say(self.driver.due(self.now))
            before = self.place
            found = self.driver.receive(self._arrived(self.board.step()), self.now)
            found += self.driver.receive(b"", self.now)
            way = before.way_to(self.place)
            self.way_m += way.way_m
            self.turned_rad += abs(way.yaw_rad)
            self.readings += found
            for reading in found:
                if isinstance(reading, FusedOdometry):
                    self.estimates.append((reading, self.place))

    def order(self, left_rpm: float, right_rpm: float, seconds: float) -> None:
        """Repeated; zeros are a Stop."""
        for _ in range(round(seconds / REPEAT_S)):
            unit = math.tau / 60
            self.say(self.driver.wheels((left_rpm * unit, right_rpm * unit)))
            self.run(REPEAT_S)


def drive(settings: LoisSettings, program: Program, *, loss: float = 0.0) -> Drive:
    """Then stop. Each byte is lost with this chance, both ways."""
    rig = Rig(settings, loss=loss)
    rig.run(4.0)
    for seconds, (left, right) in [*program, (2.0, STOP)]:
        rig.order(left, right, seconds)
    last, true = rig.estimates[-1]
    return Drive(true, rig.way_m, rig.turned_rad, last, rig.driver)
