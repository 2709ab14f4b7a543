# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings: measurements and states that boards report, in SI units."""

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

    ``lost``: number of ImuReadings that seem to be missing before this one, estimated from the
    readings received.
    """

    specific_force: Vector3
    angular_velocity: Vector3
    lost: int = 0


@value(frozen=True, slots=True)
class DisplacementReading:
    """Motion during the last ``duration_s``, in m and rad, in the board's earth or body frame.

    * ``duration_s``: None if unknown, as for the first displacement after a pause, which includes
      all motion during the pause.
    * ``lost``: number of displacements that are missing before this one.
    * ``restarted``: whether the board's counters, and with them its earth frame, seem to start
      again with this displacement.
    * ``measured``: False if the board cannot measure motion; the values are then the commanded
      ones.
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
"""Placeholder reading for a board that is alive, but has not reported its motion."""


@value(frozen=True, slots=True)
class PoseReading:
    """The board's own dead reckoning, in the earth frame that it has chosen itself.

    ``lost``: number of lost displacements whose motion this pose includes; the next displacement
    does not count these losses again. ``restarted``: whether the counter of the poses starts again
    with this pose; the counter of the displacements has then restarted earlier.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    lost: int = 0
    restarted: bool = False


@dataclass(frozen=True, slots=True)
class PausedReading:
    """The board reports that it is paused (or still initialising).

    ``continues``: whether the board was paused at the previous report too, and has not restarted
    since.
    """

    continues: bool = False


@value(frozen=True, slots=True)
class OdometryReading:
    """The board's own odometry, in a frame that begins where ``Board.reset_odometry`` was called.

    * ``pose``, ``covariance``: in that frame, at ``stamp_s``.
    * ``twist``: in the board's body axes.
    * ``twist_variances``: variances of linear and angular speed, in m²/s² and rad²/s².
    * ``rolled``: sum of all wheel motion, in body axes, since the board object was made.
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
    """A notice for the user; ``halt``: whether the robot must be stopped.

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

    The last byte of a sample may come late. The first bytes of a sample show its time better.

    * ``ahead``: number of samples (0 or 1) received, at least in part, after the last ImuReading.
    * ``cut``: whether the sample counted in ``ahead`` is incomplete.
    * ``latest_s``: longest time in s, after the read, until the line completes the last sample; 0
      if it is complete.
    * ``earliest_s``: the next sample, or the incomplete one, cannot be complete sooner than this
      time after the read.
    """

    ahead: int
    latest_s: float
    earliest_s: float
    cut: bool = False
