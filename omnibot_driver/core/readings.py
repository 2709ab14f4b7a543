# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What boards measure, in SI units, with no trace of their bytes: values only."""

from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.values import value

Vector3 = tuple[float, float, float]


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

    ``duration_s`` is None where it is unknown: the first after a pause holds all motion since.
    ``restarted``: the board's counters seem to begin anew here, and its earth frame with them.
    ``measured``: not so where the board is blind, and it is taken from what was commanded.
    """

    dx_m: float
    dy_m: float
    dyaw_rad: float
    frame: Literal["earth", "body"]
    duration_s: float | None
    lost: int
    restarted: bool = False
    measured: bool = True


NOTHING_MEASURED: Final = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, measured=False)
"""The board lives, and has told nothing of its motion."""


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


@value(frozen=True, slots=True)
class OdometryReading:
    """The board's own odometry, in a frame that begins where ``Board.reset_odometry`` was called.

    Pose and covariance in that frame at ``stamp_s``, twist in the body's axes with the variances
    of its speed and its turning. ``rolled``: what the wheels have made of the robot since the board
    was made, as one tangent; ``rolling`` its rate, None where the board does not tell.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist
    covariance: Covariance
    twist_variances: tuple[float, float]
    rolled: Pose
    rolling: BodyTwist | None


@dataclass(frozen=True, slots=True)
class EStopButtonReading:
    """The emergency stop button on the robot was pressed or released."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class ResetReading:
    """The board shows that it has obeyed a reset.

    ``remark``: what it does not show, in a sentence; empty where all is shown.
    """

    remark: str = ""


@dataclass(frozen=True, slots=True)
class NoticeReading:
    """A notice for the user; ``halt``: the robot is to be driven no further.

    An empty text: the user already has this notice.
    """

    text: str
    halt: bool


@dataclass(frozen=True, slots=True)
class ExtraReading:
    """Anything else that a board tells: a value of a kind of its own, passed on as it is."""

    content: object


Reading = (
    ImuReading
    | DisplacementReading
    | PoseReading
    | OdometryReading
    | PausedReading
    | EStopButtonReading
    | ResetReading
    | NoticeReading
    | ExtraReading
)


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
