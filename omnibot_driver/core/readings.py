# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Readings: measurements and states that boards report, in SI units."""

import math
from dataclasses import dataclass
from typing import Final, Literal

from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.odometry.covariance import Covariance
from omnibot_driver.core.values import value

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Unstamped:
    """A reading whose ROS message has no stamp, such as a state or the result of a request.

    Since it needs no stamp, it is published even before simulated time has begun.
    """


@value(frozen=True, slots=True)
class ImuReading:
    """Specific force in m/s² and angular velocity in rad/s, in the sensor's own axes.

    * ``lost``: estimated number of missing ImuReadings before this one.
    """

    specific_force: Vector3
    angular_velocity: Vector3
    lost: int = 0


@value(frozen=True, slots=True)
class OrientedImuReading:
    """The board's orientation, with the turn rates and the specific force of the last IMU sample.

    * ``orientation``: quaternion x, y, z, w.
    * ``angular_velocity``: in rad/s. ``specific_force``: in m/s².
    """

    orientation: Quaternion
    angular_velocity: Vector3
    specific_force: Vector3


@value(frozen=True, slots=True)
class DisplacementReading:
    """Motion of the robot in a short time, in m and rad.

    * ``frame``: the axes of the motion: the board's earth frame, or the robot's body axes.
    * ``duration_s``: time in s in which the robot made this motion; None if unknown, e.g. after a
      pause.
    * ``lost``: number of missing displacements directly before this one.
    * ``restarted``: whether the board's counters and its earth frame seem to begin anew with this
      displacement.
    * ``doubtful``: whether ``restarted`` may be wrong; the restart is then not counted.
    * ``measured``: False if the values are not a measurement, but e.g. only the commanded values.
    * ``possible``: False if the robot cannot move so fast, e.g. if the board corrects its odometry.
    * ``up_s``: time in s from the restart of the board to this displacement; infinity if unknown.
    """

    dx_m: float
    dy_m: float
    dyaw_rad: float
    frame: Literal["earth", "body"]
    duration_s: float | None
    lost: int
    restarted: bool = False
    measured: bool = True
    possible: bool = True
    doubtful: bool = False
    up_s: float = math.inf


NOTHING_MEASURED: Final = DisplacementReading(0.0, 0.0, 0.0, "body", None, 0, measured=False)
"""Placeholder reading. It shows that the board is alive, although the board has not reported a
motion."""


@value(frozen=True, slots=True)
class PoseReading:
    """The board's own dead reckoning, in the earth frame that it has chosen itself.

    * ``lost``: number of lost displacements whose motion this pose includes. The next
      DisplacementReading does not count them again.
    * ``restarted``: whether this pose shows a restart of the board, or a new coordinate frame. An
      earlier displacement may have shown the same restart.
    * ``ambiguous``: whether the counters fit both a restart of the board in a gap before this pose,
      and the loss of all displacements in this gap.
    """

    x_m: float
    y_m: float
    yaw_rad: float
    lost: int = 0
    restarted: bool = False
    ambiguous: bool = False


@dataclass(frozen=True, slots=True)
class PausedReading:
    """The board reports that it is paused (or still initialising).

    * ``continues``: whether the board's previous report was a PausedReading too, and the board has
      not restarted between the two.
    """

    continues: bool = False


@value(frozen=True, slots=True)
class OdometryReading:
    """The board's own odometry.

    ``Board.reset_odometry`` moves the origin of the odometry's frame.

    * ``stamp_s``: time of measurement, in s of the host's steady clock.
    * ``twist``: in the board's body axes.
    * ``twist_variances``: variances of the linear and the angular speed, in m²/s² and rad²/s².
    * ``rolled``: sum of the tangents (twist x time) that the wheels have measured since the board
      object was made, in the board's body axes.
    * ``rolling``: present rate of change of ``rolled``, as a twist. None while the board does not
      report it.
    """

    stamp_s: float
    pose: Pose
    twist: BodyTwist
    covariance: Covariance
    twist_variances: tuple[float, float]
    rolled: Pose
    rolling: BodyTwist | None


@dataclass(frozen=True, slots=True)
class EStopButtonReading(Unstamped):
    """The emergency stop button on the robot was pressed or released."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class ResetReading:
    """The board shows that it has obeyed a reset.

    ``remark``: a sentence that says which part of the reset is not proved; empty if all is proved.
    """

    remark: str = ""


@dataclass(frozen=True, slots=True)
class NoticeReading:
    """A notice for the user.

    * ``text``: a sentence; empty if there is nothing new to report.
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
    """Place in the stream of IMU samples at which a read of the port ended.

    * ``ahead``: 1 if the last sample has arrived, at least in part, but was not returned as an
      ImuReading yet; else 0.
    * ``cut``: whether the end of this sample is missing.
    * ``latest_s``: latest time, in s from the read, of the arrival of the cut sample's end; 0
      without a cut sample.
    * ``earliest_s``: earliest time, in s from the read, of the arrival of the cut sample's end.
      Without a cut sample, the end of the next sample counts.
    """

    ahead: int
    latest_s: float
    earliest_s: float
    cut: bool = False
