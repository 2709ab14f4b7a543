# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The capabilities of a kind of board, which are fixed when the board object is made."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.requests import Request


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """The capabilities of a board, constant while the driver runs.

    * ``channels``: names of the lines to the board; a single line needs no name.
    * ``imu_period_s``: time between two ImuReadings, one per tick, in s; None without an IMU.
    * ``authorities``: the topics that may command motion.
    * ``requests``: the requests that the board supports.
    * ``wheels``: names of the wheels, in the order of ``wheel_cmd``.
    * ``unheard_s``: time without data, in s, after which the robot is stopped.
    * ``silence_s``: time without data, in s, after which the mode is unknown.
    * ``own_odometry``: whether OdometryReadings give the pose. If not, the driver integrates
      displacements.
    * ``stands_after_s``: time without motion, in s, that proves a standstill.
    * ``baudrate``: whether the line has a baud rate.
    * ``calibrates_gyro``: whether the board itself subtracts the gyro's bias. If so, its profile
      offers ``~/calibrate_gyro``.
    * ``stops_within_s``: longest time, in s, until the board obeys a stop that it has acknowledged;
      0 if it does not acknowledge stops.
    * ``slack_mps``, ``slack_radps``: extra tolerance of the motion monitor, for coarse
      displacements or lagging wheels.
    * ``advice``: what to check at each motion fault; replaces the general advice.
    """

    channels: tuple[str, ...] = ("",)
    imu_period_s: float | None
    authorities: frozenset[Authority]
    requests: frozenset[Request]
    wheels: tuple[str, ...] = ()
    unheard_s: float
    silence_s: float
    own_odometry: bool = False
    stands_after_s: float = 0.1
    baudrate: bool = True
    calibrates_gyro: bool = False
    stops_within_s: float = 0.0
    slack_mps: float = 0.0
    slack_radps: float = 0.0
    advice: Mapping[Fault, str] = field(default_factory=dict)

    @property
    def imu(self) -> bool:
        """Whether the board sends ImuReadings."""
        return self.imu_period_s is not None

    @property
    def to_check(self) -> str:
        """What a user should check while no valid data arrives."""
        return "its power, cable and baudrate" if self.baudrate else "its power and cable"
