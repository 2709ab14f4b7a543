# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Parses one line of text into a message.

Extra fields are ignored, because newer firmware adds fields. The module does not know checksums.
"""

import re
from collections.abc import Callable
from typing import Final

from omnibot_driver.core.fejemis.messages import (
    Acceleration,
    Attitude,
    Battery,
    BoardPose,
    Comment,
    Distance,
    FrontAngle,
    FrontWheelOffset,
    Gyro,
    Heartbeat,
    Infrared,
    Magnetic,
    Message,
    Status,
    SteeringConfiguration,
    WheelConfiguration,
    WheelSpeeds,
    Words,
)

_NUMBER: Final = re.compile(
    r"[+-]?(?:[0-9]{1,10}\.?[0-9]{0,9}|\.[0-9]{1,9})(?:[eE][+-]?[0-9]{1,2})?"
)
_HEX: Final = re.compile(r"0[xX]([0-9a-fA-F]{1,8})")

LONGEST_TIME_S: Final = 1e7
FARTHEST_M: Final = 1e5
Range = tuple[float, float]
TURN: Final[Range] = (-180.0, 180.0)
"""Accepted range of an angle, in degrees."""
SPEED: Final[Range] = (-10.0, 10.0)
"""Accepted range of the speed of a wheel's rim, in m/s."""
RATE: Final[Range] = (-4000.0, 4000.0)
"""Accepted range of a turn rate, in degrees per second. The usual gyros do not measure more."""
FORCE: Final[Range] = (-320.0, 320.0)
"""Accepted range of the specific force, in m/s²; 320 m/s² are about 32 g."""
FIELD: Final[Range] = (-5000.0, 5000.0)
"""Accepted range of the magnetic field, in µT."""
ANGLE: Final[Range] = (-7.0, 7.0)
"""Accepted range of roll, pitch and yaw, in rad. It includes both -π..π and 0..2π."""
HEADING: Final[Range] = (-1e4, 1e4)
"""Accepted range of a pose's heading, in rad. It is wide, because a board may count full turns."""
VOLTS: Final[Range] = (-1.0, 60.0)
AMPS: Final[Range] = (-100.0, 100.0)
NEAR: Final[Range] = (-1.0, 100.0)
"""Accepted range of a measured distance, in m. A negative value reports a failed measurement."""
TIME: Final[Range] = (0.0, LONGEST_TIME_S)
PLACE: Final[Range] = (-FARTHEST_M, FARTHEST_M)
ANY: Final[Range] = (-1e10, 1e10)
LENGTH: Final[Range] = (1e-4, 100.0)

Parse = Callable[[list[str]], Message | None]


def parse(text: str) -> Message | None:
    """Return the message in ``text``; None if the text is damaged or its keyword is unknown."""
    if text.startswith("#") or text.startswith("--"):
        return Comment(text)
    words = text.split()  # splits at any white space, as the firmware does
    if not words:
        return None
    keyword, *fields = words
    parser = _PARSERS.get(keyword)
    return None if parser is None else parser(fields)


def decimals_of(field: str) -> int:
    """Return how many characters follow the decimal point; -1 if the field has no point."""
    _, point, after = field.partition(".")
    return len(after) if point else -1


def numbers(fields: list[str], *ranges: Range) -> list[float] | None:
    """Return one number for each range; None if a field is missing, malformed or out of range.

    Extra fields are ignored.
    """
    if len(fields) < len(ranges):
        return None
    found = []
    for field, (least, most) in zip(fields, ranges, strict=False):
        if not _NUMBER.fullmatch(field):
            return None
        number = float(field)
        if not least <= number <= most:
            return None
        found.append(number)
    return found


def _heartbeat(fields: list[str]) -> Message | None:
    found = numbers(fields, TIME, (0, 99999), (0, 99999), VOLTS, (-1, 1000))
    if found is None or not (found[1].is_integer() and found[2].is_integer()):
        return None
    time_s, identity, version, volts, state = found
    return Heartbeat(time_s, int(identity), int(version), volts, state)


def _front_angle(fields: list[str]) -> Message | None:
    found = numbers(fields, TURN)
    if found is None or len(fields) < 3:
        return None
    error, diagnosis = map(_HEX.fullmatch, fields[1:3])
    if error is None or diagnosis is None:
        return None
    return FrontAngle(found[0], int(error[1], 16), int(diagnosis[1], 16))


def _pose(fields: list[str]) -> Message | None:
    found = numbers(fields, TIME, PLACE, PLACE, HEADING)
    if found is None:
        return None
    time_s, x_m, y_m, yaw_rad = found
    decimals = max(0, min(map(decimals_of, fields[1:3])))
    return BoardPose(time_s, x_m, y_m, yaw_rad, decimals)


def _speeds(fields: list[str]) -> Message | None:
    if len(fields) == 2:
        found = numbers(fields, SPEED, SPEED)
        return None if found is None else WheelSpeeds(*found)
    found = numbers(fields, TIME, SPEED, SPEED)
    return None if found is None else WheelSpeeds(found[1], found[2], found[0])


def _battery(fields: list[str]) -> Message | None:
    found = numbers(fields, VOLTS, AMPS, (0, 20))
    if found is None or not found[2].is_integer():
        return None
    return Battery(found[0], found[1], int(found[2]))


def _infrared(fields: list[str]) -> Message | None:
    found = numbers(fields, NEAR, NEAR)
    if found is None:
        return None
    more = numbers(fields[-4:], *4 * [ANY]) if len(fields) >= 6 else None
    return Infrared((found[0], found[1]), tuple(more or ()))


def _offset(fields: list[str]) -> Message | None:
    found = numbers(fields, TURN, (0, 1))
    if found is None or not found[1].is_integer():
        return None
    return FrontWheelOffset(found[0], bool(found[1]))


def _vector(kind: type[Gyro | Acceleration | Magnetic | Attitude], span: Range) -> Parse:
    def parse_vector(fields: list[str]) -> Message | None:
        found = numbers(fields, span, span, span)
        return None if found is None else kind(*found)

    return parse_vector


def _distance(keyword: str) -> Parse:
    def parse_distance(fields: list[str]) -> Message | None:
        found = numbers(fields, NEAR)
        return None if found is None else Distance(keyword, found[0])

    return parse_distance


def _status(keyword: str, least: int) -> Parse:
    def parse_status(fields: list[str]) -> Message | None:
        found = []
        for field in fields:
            number = numbers([field], ANY)
            if number is None:
                break  # the remaining fields are text
            found += number
        return Status(keyword, tuple(found)) if len(found) >= least else None

    return parse_status


def _words(keyword: str) -> Parse:
    def parse_words(fields: list[str]) -> Message | None:
        text = " ".join(fields)
        return Words(keyword, text) if fields and text.isprintable() else None

    return parse_words


def _wheels(fields: list[str]) -> Message | None:
    found = numbers(fields, LENGTH, LENGTH, (1e-3, 1e4), (1, 1e6), LENGTH, (0, 10))
    if found is None:
        return None
    left_m, right_m, gear, ticks, track_m, period_s = found
    digits = _digits(fields[:6])
    return WheelConfiguration(left_m, right_m, gear, ticks, track_m, period_s, digits)


def _steering(fields: list[str]) -> Message | None:
    found = numbers(fields, LENGTH, LENGTH)
    return None if found is None else SteeringConfiguration(found[0], found[1], _digits(fields[:2]))


def _digits(fields: list[str]) -> tuple[float, ...]:
    """Return, for each field, the value of one step of its last digit: 0.001 for "0.420"."""
    return tuple(10.0 ** -max(0, decimals_of(field)) for field in fields)


STATUS: Final = {
    "adc": 1, "int": 1, "time": 1, "amp": 1, "cur": 1, "cvdrive": 1, "cpdrive": 1, "cvsteer": 1,
    "cpsteer": 1, "gyroo": 3, "acco": 3, "magw": 3, "mago": 3, "enc": 1, "mot": 1, "svp": 1,
    "svjt": 1, "tof1": 1, "gyroc": 1, "acccal2": 1, "brush": 1,
}  # fmt: skip
"""Smallest number of values in a valid status line or answer, by the keyword of the line."""
WORDS: Final = ("id", "ver", "log", "confirm")
_PARSERS: Final[dict[str, Parse]] = {
    "hbt": _heartbeat,
    "fwl": _front_angle,
    "pose": _pose,
    "vel": _speeds,
    "gyro": _vector(Gyro, RATE),
    "acc": _vector(Acceleration, FORCE),
    "mag": _vector(Magnetic, FIELD),
    "imupose": _vector(Attitude, ANGLE),
    "bat": _battery,
    "tofd": _distance("tofd"),
    "sr04": _distance("sr04"),
    "ir": _infrared,
    "irc": _infrared,
    "conf": _wheels,
    "confs": _steering,
    "fwo": _offset,
    **{keyword: _status(keyword, least) for keyword, least in STATUS.items()},
    **{keyword: _words(keyword) for keyword in WORDS},
}
