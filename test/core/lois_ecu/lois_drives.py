# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Drives of a simulated LOIS robot, with the odometry beside it, in simulated time."""

import math
from dataclasses import dataclass
from random import Random

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.lois_ecu import (
    BoardOdometry,
    LoisDecoder,
    SetDuty,
    SetPeriod,
    SetRpm,
    Setting,
    Stream,
    Ticks,
    WriteSetting,
    encode_command,
)
from omnibot_driver.core.lois_ecu.messages import Command
from omnibot_driver.core.lois_ecu.odometry import FusedOdometry, LoisOdometry
from omnibot_driver.core.lois_ecu.settings import LoisEcuSettings
from omnibot_driver.simulator.lois_ecu import QUIRKS, Firmware, LoisSettings, SimulatedLois

STOP = SetDuty(0, 0)
REPEAT_S = 0.05

Program = list[tuple[float, SetRpm | SetDuty]]
"""For so long, so fast."""

CLASSES: dict[str, Program] = {
    "straight": [(21.0, SetRpm(20, 20))],
    "curve": [(21.0, SetRpm(17, 22))],
    "in place": [(12.0, SetRpm(-15, 15))],
    "reverse": [(20.0, SetRpm(-20, -20))],
    "reverse curve": [(20.0, SetRpm(-22, -18))],
    "mixed": [
        (6.0, SetRpm(20, 24)),
        (1.5, STOP),
        (5.0, SetRpm(-20, -20)),
        (1.5, STOP),
        (4.0, SetRpm(15, -15)),
        (5.0, SetRpm(30, 30)),
    ],
}


@dataclass(frozen=True)
class Drive:
    """``true``: where the robot was at the last estimate, from where the estimates began."""

    true: Pose
    way_m: float
    turned_rad: float
    last: FusedOdometry
    board: BoardOdometry | None
    odometry: LoisOdometry

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


def drive(settings: LoisSettings, program: Program, *, period_ms: int = 200) -> Drive:
    """Then stop; the set-points are repeated."""
    board, decoder = SimulatedLois(settings), LoisDecoder()
    odometry = LoisOdometry(LoisEcuSettings())
    estimates: list[FusedOdometry] = []
    heard: list[BoardOdometry] = []
    start: Pose | None = None

    def at() -> Pose:
        truth = board.truth
        return Pose(truth.x_m, truth.y_m, truth.yaw_rad)

    def say(command: Command) -> None:
        board.receive(encode_command(command))
        if isinstance(command, SetRpm | SetDuty):
            odometry.wrote(command, board.now_s)

    true = start = at()
    way_m = turned_rad = 0.0

    def run(seconds: float) -> None:
        nonlocal true, way_m, turned_rad
        for _ in range(round(seconds / board.tick_s)):
            before = board.truth
            reports = decoder.feed(board.step(), board.now_s)
            way_m += math.hypot(board.truth.x_m - before.x_m, board.truth.y_m - before.y_m)
            turned_rad += abs(board.truth.yaw_rad - before.yaw_rad)
            reports += decoder.feed(b"", board.now_s)
            for report in reports:
                found = None
                if isinstance(report, Ticks):
                    found = odometry.heard_ticks(report, board.now_s)
                elif isinstance(report, BoardOdometry):
                    heard.append(report)
                    found = odometry.heard_odometry(report, board.now_s)
                if found is not None:
                    estimates.append(found)
                    true = at()
            found = odometry.rest(board.now_s)
            if found is not None:
                estimates.append(found)
                true = at()

    run(2.1)
    for _ in range(4):
        for setting in (
            WriteSetting(Setting.RPM_LOW_PASS, 1.0),
            SetPeriod(Stream.TICKS, period_ms),
            SetPeriod(Stream.ODOMETRY, period_ms),
        ):
            say(setting)
            run(0.07)
    for seconds, command in [*program, (2.0, STOP)]:
        for _ in range(round(seconds / REPEAT_S)):
            say(command)
            run(REPEAT_S)
    return Drive(
        start.way_to(true) + Pose(0.0, 0.0, true.yaw_rad - start.way_to(true).yaw_rad),
        way_m,
        turned_rad,
        estimates[-1],
        heard[-1] if heard else None,
        odometry,
    )
