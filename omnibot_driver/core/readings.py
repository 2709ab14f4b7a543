# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings: what boards measure, in SI units, without a trace of their bytes."""

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

    ``lost``: number of ImuReadings that seem to be missing before this one, judged by those
    received.
    """

    specific_force: Vector3
    angular_velocity: Vector3
    lost: int = 0


@value(frozen=True, slots=True)
class DisplacementReading:
    """Motion during the last ``duration_s``, in m and rad, in the board's earth or body frame.

    * ``duration_s``: None if unknown: the first displacement after a pause holds all motion since.
    * ``lost``: number of displacements that are missing before this one.
    * ``restarted``: the board's counters seem to start again here, and its earth frame with them.
    * ``measured``: False if the board cannot measure its motion, and this is the commanded one.
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
"""Placeholder of a board that is alive, but has not reported its motion."""


@value(frozen=True, slots=True)
class PoseReading:
    """The board's own dead reckoning, in the earth frame that it has chosen itself.

    ``lost``: number of displacements that are missing before it although it includes them; the next
    displacement does not report them again. ``restarted``: the counter of the poses starts again
    here; that of the displacements did so some time before.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    lost: int = 0
    restarted: bool = False


@dataclass(frozen=True, slots=True)
class PausedReading:
    """The board reports that it is paused (or still initialising).

    ``continues``: it reported so just before, so it has not restarted in between.
    """

    continues: bool = False


@value(frozen=True, slots=True)
class OdometryReading:
    """The board's own odometry, in a frame that begins where ``Board.reset_odometry`` was called.

    * ``pose``, ``covariance``: in that frame, at ``stamp_s``.
    * ``twist``: in the board's body axes.
    * ``twist_variances``: variances of linear and angular speed, in m²/s² and rad²/s².
    * ``rolled``: all motion by the wheels since the board object was made, as one tangent.
    * ``rolling``: rate of ``rolled``; None while the board does not report it.
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

    ``remark``: what remains unproved, as a sentence; empty if everything is proved.
    """

    remark: str = ""


@dataclass(frozen=True, slots=True)
class NoticeReading:
    """A notice for the user; ``halt``: the robot must be stopped.

    An empty text means that the user already has this notice.
    """

    text: str
    halt: bool


@dataclass(frozen=True, slots=True)
class ExtraReading:
    """Any other data of a board: a value of a board-specific type, passed on unchanged."""

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
    """Where a read of the port ended in the stream of IMU samples, for the clock that stamps them.

    The first bytes of a sample show its time better than its delayed last byte, and so does a
    sample that has not arrived yet.

    * ``ahead``: number of samples (0 or 1) received after the last ImuReading.
    * ``cut``: that sample is incomplete; otherwise it is complete.
    * ``latest_s``: the last sample was due to be complete within this time after the read.
    * ``earliest_s``: the next sample, or the incomplete one, cannot be complete sooner than this
      time after the read.
    """

    ahead: int
    latest_s: float
    earliest_s: float
    cut: bool = False
