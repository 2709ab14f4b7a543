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
    """Motion of the robot in a short time, in m and rad.

    * ``frame``: frame of ``dx_m`` and ``dy_m``: the board's earth frame, or the body's own axes.
    * ``duration_s``: duration of the motion, in s. None if unknown. The first displacement after a
      pause has no known duration, because it includes all motion during the pause.
    * ``lost``: number of displacements that are missing before this one.
    * ``restarted``: whether the board's counters seem to start again with this displacement. If
      they do, the board's earth frame starts again too.
    * ``measured``: False if the values are not a measurement of the motion. A board that cannot
      measure motion reports the commanded values instead.
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

    * ``lost``: number of lost displacements whose motion this pose includes. The next displacement
      does not count these losses again.
    * ``restarted``: whether the counter of the poses starts again with this pose. If it does, the
      counter of the displacements has started again before.
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
    """A notice for the user.

    * ``text``: the notice as a sentence; empty if the user already has it.
    * ``halt``: whether the robot must be stopped.
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
    """Where a read of the port ended in the stream of IMU samples.

    The clock that stamps the samples needs this position. The last byte of a sample can come late,
    so the first bytes of a sample show its time better.

    * ``ahead``: number of samples (0 or 1) of which at least a part came after the last ImuReading.
    * ``cut``: whether the sample counted in ``ahead`` is incomplete.
    * ``latest_s``: longest time, in s, from the read until the last sample is complete; 0 if it is
      complete already.
    * ``earliest_s``: shortest time, in s, from the read until the next sample can be complete. A
      sample that is incomplete is this next sample.
    """

    ahead: int
    latest_s: float
    earliest_s: float
    cut: bool = False
