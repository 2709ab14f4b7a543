# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a kind of board has and can do: chosen at construction, never asked for each frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.requests import Request


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """Constant for a board while the driver runs.

    ``channels``: names of the lines to it; one alone needs no name. ``imu_period_s``: from one
    ImuReading to the next, one for each tick of the board's clock; None for a board without an
    IMU, whose readings are stamped by their arrival. ``authorities``: who may command motion;
    ``requests``: what else can be asked of it; ``wheels``: names of those that ``wheel_cmd`` turns,
    in its order; ``unheard_s``: after this time without data a robot is not driven any further;
    ``silence_s``: after it a board that says nothing is not known to be there; ``own_odometry``:
    OdometryReadings say where the robot is, and displacements only whether it obeys;
    ``stands_after_s``: a robot whose displacements show no motion for this time stands;
    ``baudrate``: whether the speed of its line is to be set;
    ``calibrates_gyro``: it takes the bias off itself, so its profile has ``~/calibrate_gyro``;
    ``unproved_s``: how long Stop is repeated at most while that is not seen;
    ``stops_within_s``: how long a board that answers a stop takes to obey it; ``slack_mps``,
    ``slack_radps``: how far its displacements, or its wheels when they speed up, may be off what is
    commanded on top of what any robot may; ``advice``: what to check when the robot does not move
    as commanded, where that is more than on any board: the parameters of this one.
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
        """Whether it sends ImuReadings."""
        return self.imu_period_s is not None

    @property
    def to_check(self) -> str:
        """Things to check while no valid data arrives."""
        return "its power, cable and baudrate" if self.baudrate else "its power and cable"
