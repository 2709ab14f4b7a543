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
    * ``imu_period_s``: time between two ImuReadings, in s. The board sends one in each tick of its
      clock. None for a board without an IMU, whose readings are stamped on arrival.
    * ``authorities``: the topics that may command motion.
    * ``requests``: the requests that the board supports.
    * ``wheels``: names of the wheels that ``wheel_cmd`` turns, in the order of its values.
    * ``unheard_s``: time without data, in s, after which the robot is stopped.
    * ``silence_s``: time without data, in s, after which the mode of the board is unknown.
    * ``own_odometry``: whether OdometryReadings give the robot's pose. If they do, displacements
      only show whether the robot obeys. If not, the driver integrates the displacements.
    * ``stands_after_s``: time without motion in the displacements, in s, that proves a
      standstill.
    * ``unproved_s``: longest time, in s, for which Stop is repeated while the standstill is not
      shown.
    * ``baudrate``: whether the line has a baud rate to set.
    * ``calibrates_gyro``: whether the board subtracts the gyro's bias itself. If it does, the
      board's profile offers ``~/calibrate_gyro``.
    * ``stops_within_s``: longest time, in s, until a board that acknowledges stops obeys one. 0 for
      a board that does not acknowledge stops.
    * ``slack_mps``, ``slack_radps``: additional tolerance of the motion monitor for the difference
      between measured and commanded velocity, in m/s and rad/s. A board needs it if its
      displacements are coarse, or if its wheels lag while they speed up.
    * ``advice``: for each fault of the robot's motion, what to check. This text names the
      parameters of this board, and replaces the general advice.
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
    unproved_s: float = 5.0
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
