# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is commanded, as the frame that says it now.

A ``Motion`` is one command. The stream asks it for its frame whenever one goes out, so a set-point
that nears its target by an acceleration limit needs no timer of its own. Whether it may be
commanded, and when a frame goes out, is others' business.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import Final, Protocol

from omnibot_driver.core.commands.limits import SpeedLimits
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist

LONGEST_STEP_S: Final = 0.05
"""A frame that goes out late does not make up for more time than this."""
AT_REST: Final = BodyTwist(0.0, 0.0, 0.0)

LEAVING_M: Final = 0.3
LEAVING_RAD: Final = 2.0
"""No controller that drives to a goal overshoots by so much."""


class Authority(Enum):
    """Who commands; the value is the topic's name. One at a time, the newest."""

    BASE = "cmd_vel"
    WHEELS = "wheel_cmd"
    POSE = "cmd_pose"


class Setpoint(Protocol):
    """One command, current until it expires or another takes its place."""

    @property
    def authority(self) -> Authority:
        """Whose command it is."""

    @property
    def stands(self) -> bool:
        """Whether it is a wish to stand still, which never waits and is no ramp's business."""

    @property
    def settled(self) -> bool:
        """False while each next frame is another one."""

    def frame(self, now: float) -> bytes:
        """The frame to write at this time."""

    def encode_anew(self, stop: bytes) -> None:
        """From now on by the board's present settings; what makes ``stop``, stands.

        Raises CommandRefused where they cannot say it.
        """


class BaseSetpoint:
    """A body velocity, approached by the acceleration limits from what was commanded before.

    ``encode`` makes a velocity a frame; what it makes ``stop`` of, stands.
    """

    authority: Final = Authority.BASE

    def __init__(
        self,
        wanted: BodyTwist,
        limits: SpeedLimits,
        encode: Callable[[BodyTwist], bytes],
        *,
        stop: bytes,
        before: Setpoint | None,
        since: float,
    ) -> None:
        self._wanted, self._limits, self._encode = wanted, limits, encode
        self._frame = encode(wanted)
        self.stands = self._frame == stop
        self._setpoint, self._reached_at = wanted, since
        self.settled = self.stands or not (limits.linear_mps2 or limits.angular_radps2)
        """Whether the set-point has arrived."""
        if not self.settled:
            self._setpoint = AT_REST
            if isinstance(before, BaseSetpoint):
                self._setpoint = before._setpoint
                self._reached_at = max(before._reached_at, since)

    def frame(self, now: float) -> bytes:
        """The set-point of this time; asking moves it."""
        if not self.settled:
            duration_s = min(now - self._reached_at, LONGEST_STEP_S)
            self._setpoint = self._limits.approach(self._setpoint, self._wanted, duration_s)
            self._frame = self._encode(self._setpoint)
            self.settled = self._setpoint == self._wanted
        self._reached_at = now
        return self._frame

    def encode_anew(self, stop: bytes) -> None:
        """The set-point; a ramp goes on."""
        self.stands = self._encode(self._wanted) == stop
        if self.stands:
            self._setpoint, self.settled = self._wanted, True
        self._frame = self._encode(self._setpoint)


class SteadySetpoint:
    """A command whose frame does not change, unless ``encode`` makes another one of it."""

    settled: Final = True

    def __init__(
        self,
        authority: Authority,
        frame: bytes,
        *,
        stands: bool,
        encode: Callable[[], bytes] | None = None,
    ) -> None:
        self.authority, self.stands = authority, stands
        self._frame, self._encode = frame, encode

    def frame(self, now: float) -> bytes:
        """Always the same."""
        return self._frame

    def encode_anew(self, stop: bytes) -> None:
        """By ``encode``."""
        if self._encode is not None:
            self._frame = self._encode()
            self.stands = self._frame == stop


class GoalSetpoint:
    """A pose to drive to: ``place`` in the odometry frame, as that lay at this ``alignment``.

    ``encode`` makes its frame.
    """

    authority: Final = Authority.POSE
    stands: Final = False
    settled: Final = True

    def __init__(self, place: Pose, encode: Callable[[], bytes], alignment: int) -> None:
        self.alignment = alignment
        self._place, self._encode = place, encode
        self._frame = encode()
        self._nearest_m = self._nearest_rad = math.inf

    def frame(self, now: float) -> bytes:
        """Always the same."""
        return self._frame

    def encode_anew(self, stop: bytes) -> None:
        """The same place in the board's frame."""
        self._frame = self._encode()

    def is_left_by(self, pose: Pose) -> bool:
        """Whether a robot that is here now has been plainly nearer before."""
        way = pose.way_to(self._place)
        self._nearest_m = min(self._nearest_m, way.way_m)
        self._nearest_rad = min(self._nearest_rad, abs(way.yaw_rad))
        return (
            way.way_m > self._nearest_m + LEAVING_M
            or abs(way.yaw_rad) > self._nearest_rad + LEAVING_RAD
        )
