# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The messages that the two boards send: one class for each kind of line.

Units are the boards': m, m/s, m/s², s, µT, V, A. Angles are in degrees or rad, as stated.
"""

from dataclasses import dataclass
from typing import Final

from omnibot_driver.core.values import value


@value(frozen=True, slots=True)
class Heartbeat:
    """``hbt``: the heartbeat of a board.

    ``state``: on the drive board, the source of the motion commands that it obeys (rcSource); -1
    while it ignores motion commands.
    """

    time_s: float
    identity: int
    version: int
    volts: float
    state: float


@value(frozen=True, slots=True)
class FrontAngle:
    """``fwl``: angle of the front wheel in degrees, positive to the left, and sensor flags."""

    angle_deg: float
    error: int
    diagnosis: int


@value(frozen=True, slots=True)
class BoardPose:
    """``pose``: the pose that the board computes from the motion of its wheels.

    ``decimals``: how many decimals x and y have in the line.
    """

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    decimals: int = 9


@value(frozen=True, slots=True)
class WheelSpeeds:
    """``vel``: rim speeds of both wheels.

    ``time_s``: the board's time; None if the line has no time.
    """

    left_mps: float
    right_mps: float
    time_s: float | None = None


@value(frozen=True, slots=True)
class Gyro:
    """``gyro``: turn rate in degrees per second."""

    x: float
    y: float
    z: float


@value(frozen=True, slots=True)
class Acceleration:
    """``acc``: specific force in m/s²; on some firmware in g."""

    x: float
    y: float
    z: float


@value(frozen=True, slots=True)
class Magnetic:
    """``mag``: magnetic field in µT."""

    x: float
    y: float
    z: float


@value(frozen=True, slots=True)
class Attitude:
    """``imupose``: the board's orientation, in rad."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float


@value(frozen=True, slots=True)
class Battery:
    """``bat``: voltage, current and number of cells."""

    volts: float
    amps: float
    cells: int


@value(frozen=True, slots=True)
class Distance:
    """``tofd`` or ``sr04``: distance in m, measured by time of flight or by sonar."""

    keyword: str
    distance_m: float


@value(frozen=True, slots=True)
class Infrared:
    """``ir``: distances that both sensors measure, and their calibration if the board sends it."""

    distances_m: tuple[float, float]
    calibration: tuple[float, ...] = ()


@value(frozen=True, slots=True)
class WheelConfiguration:
    """``conf``: wheel radii, gear, encoder ticks per revolution, track, and control period.

    ``digits``: for each number, the value of its last decimal place (0.01 for 1.23); empty if
    unknown.
    """

    left_radius_m: float
    right_radius_m: float
    gear: float
    ticks_per_revolution: float
    track_m: float
    period_s: float
    digits: tuple[float, ...] = ()

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers of this line that the driver can write to the board.

        The control period is left out, because the driver cannot write it.
        """
        return (
            self.left_radius_m,
            self.right_radius_m,
            self.gear,
            self.ticks_per_revolution,
            self.track_m,
        )


@value(frozen=True, slots=True)
class SteeringConfiguration:
    """Line ``confs``: the track, and the distance from the axle to the steered wheel, in m.

    * ``first_m``, ``second_m``: these two lengths in the line's order, which depends on the board.
    * ``digits``: for each number, the value of its last decimal place (0.01 for 1.23); empty if
      unknown.
    """

    first_m: float
    second_m: float
    digits: tuple[float, ...] = ()


@value(frozen=True, slots=True)
class FrontWheelOffset:
    """``fwo``: offset of the front wheel's angle in degrees, and whether the angle is inverted."""

    offset_deg: float
    inverted: bool


@value(frozen=True, slots=True)
class Status:
    """Numbers that are only shown in diagnostics, or that answer one request."""

    keyword: str
    numbers: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Words:
    """A keyword followed by text: a name, a version, or an answer."""

    keyword: str
    text: str


@dataclass(frozen=True, slots=True)
class Comment:
    """A line that begins with ``#`` or ``--``, such as a line of the board's help text."""

    text: str


Message = (
    Heartbeat
    | FrontAngle
    | BoardPose
    | WheelSpeeds
    | Gyro
    | Acceleration
    | Magnetic
    | Attitude
    | Battery
    | Distance
    | Infrared
    | WheelConfiguration
    | SteeringConfiguration
    | FrontWheelOffset
    | Status
    | Words
    | Comment
)

_KEYWORDS: Final[dict[type, str]] = {
    FrontAngle: "fwl",
    BoardPose: "pose",
    WheelSpeeds: "vel",
    Gyro: "gyro",
    Acceleration: "acc",
    Magnetic: "mag",
    Attitude: "imupose",
    Battery: "bat",
    Infrared: "ir",
    SteeringConfiguration: "confs",
}


def keyword_of(message: Message) -> str:
    """Return the keyword of the message's stream.

    The result is empty for a heartbeat, and for a message that belongs to no stream.
    """
    if isinstance(message, Distance):
        return message.keyword
    return _KEYWORDS.get(type(message), "")
