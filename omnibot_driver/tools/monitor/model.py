# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The monitor's model of the robot: the latest values, their rates, and the robot's path.

NaN and infinity are kept. The model must not know ROS, terminals or the clock.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.readings import Vector3
from omnibot_driver.core.reporting.status import RUNNING, Level, Status
from omnibot_driver.tools.monitor.rates import Rate

IMU_TOPIC: Final = "imu/data_raw"
ODOM_TOPIC: Final = "odom"
DIAGNOSTICS_TOPIC: Final = "/diagnostics"
COMMAND_LIVES_S: Final = 0.5
"""Time in s for which a command is valid: the default of the driver's ``cmd_vel_timeout``."""
SILENT_S: Final = 3.0
"""Time in s without a message after which a driver is regarded as silent, and its diagnostics as
outdated."""
STEP_M: Final = 0.02
LONGEST_PATH: Final = 5000
JUMP_M: Final = 0.05
JUMP_MPS: Final = 2.0
"""``JUMP_M``, ``JUMP_MPS``: in t seconds, the pose may move by JUMP_M + JUMP_MPS · t, in m.

A larger motion between two messages is a reset of the odometry, and begins a new path.
"""


@dataclass(frozen=True, slots=True)
class Flow:
    """How often messages arrive on a topic.

    ``hz``: message rate.
    ``age_s``: time since the last message; None if it is above 2 s.
    ``history``: number of messages in each second of the last minute.
    """

    hz: float
    age_s: float | None
    history: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The values to show at one moment. An unknown or outdated value is None or empty.

    ``state``, ``estop``, ``pose`` and ``path`` are shown even if they are outdated.

    ``estop_asked``: whether the e-stop is requested, but not yet confirmed by the driver.

    ``releasable``: whether the driver's service that releases the e-stop is found.

    ``silent_s``: time since the driver's last message.

    ``steers``: whether another node receives the monitor's commands.

    ``said``: the reply to the user's last action.

    ``lacks``: those of ``imu``, ``start`` and ``pause`` that the board does not have.
    """

    driver: str
    state: str
    estop: bool | None
    estop_asked: bool
    releasable: bool
    silent_s: float
    imu: Flow
    odom: Flow
    pose: Pose | None
    measured: BodyTwist | None
    commanded: BodyTwist | None
    force_mps2: Vector3 | None
    rate_radps: Vector3 | None
    statuses: tuple[Status, ...]
    path: tuple[tuple[float, float], ...]
    steers: bool
    said: str
    lacks: frozenset[str] = frozenset()

    @property
    def silent(self) -> bool:
        """Whether the driver no longer sends messages."""
        return self.silent_s > SILENT_S

    @property
    def link(self) -> str:
        """The status of the link to the board, with the port; empty without diagnostics."""
        for status in self.statuses:
            if status.name == "Link":
                return f"{status.message}, {status.values.get('Port', '')}".rstrip(", ")
        return ""

    def missing(self, diagnostics: bool) -> list[str]:
        """Return the topics that the driver should publish in its present state, but does not.

        ``diagnostics``: whether the driver should publish /diagnostics.
        """
        wanted = {
            "state": bool(self.state),
            "estop_active": self.estop is not None,
            IMU_TOPIC: self.imu.age_s is not None
            or self.state not in RUNNING
            or "imu" in self.lacks,
            ODOM_TOPIC: self.odom.age_s is not None or self.state != "nominal",
            DIAGNOSTICS_TOPIC: bool(self.statuses) or not diagnostics,
        }
        return [name for name, heard in wanted.items() if not heard]

    def not_finite(self) -> list[str]:
        """Return the names of the values that are NaN or infinite."""
        return [name for name, value in self._numbers() if not math.isfinite(value)]

    def _numbers(self) -> Iterator[tuple[str, float]]:
        pose, force, rate = self.pose, self.force_mps2, self.rate_radps
        if pose:
            yield from (("pose x", pose.x_m), ("pose y", pose.y_m), ("yaw", pose.yaw_rad))
        for name, twist in (("measured", self.measured), ("commanded", self.commanded)):
            if twist:
                yield from ((f"{name} x", twist.vx_mps), (f"{name} y", twist.vy_mps))
                yield f"{name} turn", twist.yaw_rate_radps
        for name, vector in (("acceleration", force), ("angular velocity", rate)):
            for axis, value in zip("xyz", vector or (), strict=False):
                yield f"{name} {axis}", value


class Model:
    """The latest received values, which ``view`` returns as a View.

    All times are of one clock, in s.
    """

    def __init__(self, driver: str, now_s: float) -> None:
        self.said = ""
        self.estop_asked = False
        self._driver = driver
        self._state = ""
        self._estop: bool | None = None
        self._heard_s = now_s
        self._imu, self._odom = Rate(now_s), Rate(now_s)
        self._pose: Pose | None = None
        self._pose_s = now_s
        self._measured: BodyTwist | None = None
        self._commanded: tuple[BodyTwist, float] | None = None
        self._force: Vector3 | None = None
        self._rate: Vector3 | None = None
        self._statuses: tuple[Status, ...] = ()
        self._diagnosed_s = now_s
        self._path: deque[tuple[float, float]] = deque(maxlen=LONGEST_PATH)

    def state(self, state: str, now_s: float) -> None:
        """Store a message of ``~/state``."""
        self._state, self._heard_s = state, now_s

    def estop(self, active: bool, now_s: float) -> None:
        """Store a message of ``~/estop_active``."""
        self._estop, self._heard_s = active, now_s

    def imu(self, force_mps2: Vector3, rate_radps: Vector3, now_s: float) -> None:
        """Store a message of ``imu/data_raw``."""
        self._imu.arrived(now_s)
        self._force, self._rate, self._heard_s = force_mps2, rate_radps, now_s

    def odom(self, pose: Pose, twist: BodyTwist | None, now_s: float) -> None:
        """Store the values of an ``odom`` message; ``twist`` is None if it was not measured."""
        self._odom.arrived(now_s)
        self._follow(pose, now_s)
        self._pose, self._pose_s, self._measured, self._heard_s = pose, now_s, twist, now_s

    def commanded(self, twist: BodyTwist, now_s: float) -> None:
        """Store a message of ``cmd_vel``.

        Another node has sent this message, so its arrival does not show that the driver runs.
        """
        self._commanded = twist, now_s

    def diagnosed(self, statuses: tuple[Status, ...], now_s: float) -> None:
        """Store the driver's statuses from a message of ``/diagnostics``."""
        self._statuses, self._diagnosed_s, self._heard_s = statuses, now_s, now_s

    def view(
        self,
        now_s: float,
        *,
        releasable: bool = False,
        steers: bool = False,
        lacks: frozenset[str] = frozenset(),
    ) -> View:
        """Return the values to show now."""
        moves = self._commanded and now_s - self._commanded[1] < COMMAND_LIVES_S
        imu, odom = (
            Flow(rate.hz(now_s), rate.age_s(now_s), rate.history(now_s))
            for rate in (self._imu, self._odom)
        )
        return View(
            driver=self._driver,
            state=self._state,
            estop=self._estop,
            estop_asked=self.estop_asked,
            releasable=releasable,
            silent_s=now_s - self._heard_s,
            imu=imu,
            odom=odom,
            pose=self._pose,
            measured=self._measured if odom.age_s is not None else None,
            commanded=self._commanded[0] if self._commanded and moves else None,
            force_mps2=self._force if imu.age_s is not None else None,
            rate_radps=self._rate if imu.age_s is not None else None,
            statuses=self._statuses if now_s - self._diagnosed_s <= SILENT_S else (),
            path=tuple(self._path),
            steers=steers,
            said=self.said,
            lacks=lacks,
        )

    def _follow(self, pose: Pose, now_s: float) -> None:
        if not pose.finite:
            return
        before, here = self._pose, (pose.x_m, pose.y_m)
        if before and before.finite:
            reach_m = JUMP_M + JUMP_MPS * (now_s - self._pose_s)
            if math.dist((before.x_m, before.y_m), here) > reach_m:
                self._path.clear()
        if not self._path or math.dist(self._path[-1], here) >= STEP_M:
            self._path.append(here)


def level(byte: int) -> Level:
    """Return the level of a diagnostic_msgs/DiagnosticStatus; ERROR for an unknown value."""
    return Level(byte) if byte in tuple(Level) else Level.ERROR
