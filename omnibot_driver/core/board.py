# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What any motor board offers a driver: the seam at which further boards join.

Readings are what a board measured, in SI units, with no trace of its bytes. A ``Board`` turns bytes
into readings and wishes into bytes, and keeps the belief about the board's mode; it never decides
when something is sent. It knows no ROS, no port and no clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, Protocol

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.traits import Traits
from omnibot_driver.core.values import value

Vector3 = tuple[float, float, float]


class Mode(Enum):
    """What we believe of the board, from nothing but what it sent; the value is its public name."""

    UNKNOWN = "connecting"
    PAUSED = "paused"
    NOMINAL = "nominal"
    IMU_ONLY = "imu_only"

    running: bool
    """True in the modes in which the board sends data and obeys motion commands."""

    def __init__(self, name: str) -> None:
        self.running = name in ("nominal", "imu_only")


@value(frozen=True, slots=True)
class ImuReading:
    """Specific force in m/s² and angular velocity in rad/s, in the sensor's own axes.

    ``lost`` readings of this kind seem to be missing before it, by what was received of them.
    """

    specific_force: Vector3
    angular_velocity: Vector3
    lost: int = 0


@value(frozen=True, slots=True)
class DisplacementReading:
    """Motion during the last ``duration_s``; ``lost`` frames of this kind are missing before it.

    ``duration_s`` is None where nobody knows it: the first after a pause holds all motion since.
    ``restarted``: the board's counters seem to begin anew here, and its earth frame with them.
    """

    dx_m: float
    dy_m: float
    dyaw_rad: float
    frame: Literal["earth", "body"]
    duration_s: float | None
    lost: int
    restarted: bool = False


@value(frozen=True, slots=True)
class PoseReading:
    """The board's own dead reckoning, in the earth frame it has chosen for itself.

    ``lost`` displacements that it includes are known to be missing before it; they are not counted
    again by the next displacement. ``restarted``: its counter begins anew, and so did the
    displacements' some time before.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    lost: int = 0
    restarted: bool = False


@dataclass(frozen=True, slots=True)
class PausedReading:
    """The board said that it is paused (or still initialising).

    ``continues``: it has said so just before, so it has not restarted meanwhile.
    """

    continues: bool = False


Reading = ImuReading | DisplacementReading | PoseReading | PausedReading


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardFigures:
    """What a board's translator counts, since the driver began.

    ``rates_hz``: of IMU readings, displacements and poses, as they should be; ``faults``: how often
    the framing was lost, with ``discarded_bytes``; ``saturated``: commands that did not fit.
    """

    rates_hz: Vector3
    faults: int = 0
    discarded_bytes: int = 0
    saturated: int = 0


@value(frozen=True, slots=True)
class SampleBoundary:
    """Where a read ended among the samples.

    The beginning of one tells when it was taken better than an end that is delivered late, and what
    was not there yet tells too. ``ahead``: how many samples after the last ImuReading were in hand
    (0, 1), the last of them whole or ``cut``. It was to be whole ``latest_s`` after the read, or
    before; the next one, or the one that was cut, not before ``earliest_s`` after it.
    """

    ahead: int
    latest_s: float
    earliest_s: float
    cut: bool = False


class Board(Protocol):
    """One kind of board. Request methods raise RequestRefused where the mode forbids them."""

    traits: Traits
    """What it has and can do."""

    settings: Any
    """What its wire does not tell, in values of its own kind; may be replaced at any time."""

    @property
    def mode(self) -> Mode:
        """The present belief."""

    @property
    def tick_s(self) -> float:
        """The nominal time from one ImuReading to the next."""

    @property
    def edge(self) -> SampleBoundary | None:
        """Where the last read ended. None while the framing is in doubt, or it told nothing new."""

    @property
    def figures(self) -> BoardFigures:
        """For whoever looks after the line."""

    def gravity_advice(self, gravity_mps2: float) -> str:
        """What such a specific force at rest says of the settings; empty where it is gravity."""

    @property
    def advice(self) -> str | None:
        """What a user should set otherwise, by what the board sends; None while all is well."""

    def connect(self) -> None:
        """The line is new: nothing that was held or believed is worth anything any more."""

    def receive(self, data: bytes, now: float) -> list[Reading]:
        """What these bytes complete, in the order of the line; ``mode`` follows."""

    def flush(self, now: float) -> list[Reading]:
        """The line is closed: what can still be told from what was held."""

    def silence(self) -> None:
        """Nothing was understood for so long that the mode is unknown again."""

    def wake(self) -> bytes:
        """What makes a board in any state listen, ends any half command, and stops the wheels."""

    def start(self) -> bytes:
        """Run, whatever it did before; harmless to repeat."""

    def pause(self) -> bytes:
        """Pause a running board. Refused when it is not known to run."""

    def force_pause(self) -> bytes:
        """Pause, whatever it did before and whatever of ours is still on the way to it."""

    def reset(self) -> bytes:
        """Reboot; the mode is unknown until the board is heard again."""

    def stop(self) -> bytes:
        """Stand still."""

    def emergency_stop(self) -> bytes:
        """The board's own emergency stop."""

    def velocity(self, twist: BodyTwist) -> bytes:
        """Drive with this body velocity, already within the limits."""

    def wheels(self, rates_radps: Sequence[float]) -> bytes:
        """Turn the wheels at these rates, in their order, already within the limits."""

    def meaning(self, data: bytes) -> BodyTwist:
        """The body velocity that the last frame in these bytes commands, in the board's own axes.

        Of ``velocity`` and ``wheels``, as rounded; at rest for every other.
        """

    def drive_to(self, pose: Pose) -> bytes:
        """Go to this pose in the board's own earth frame, and stay.

        Raises CommandRefused where the line cannot say it.
        """
