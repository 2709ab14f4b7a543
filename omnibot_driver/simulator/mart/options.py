# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Command line options of a simulated MART controller, except its seed and its network.

This module knows options and their effects; it does not know which program runs the board.
"""

import argparse
from collections.abc import Callable
from math import inf, isnan
from typing import get_args

from omnibot_driver.simulator.mart.board import SimulatedMart
from omnibot_driver.simulator.mart.settings import QUIRKS, Firmware, MartSettings, Stuck

_DEFAULT = MartSettings()


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options to the parser."""
    parser.add_argument(
        "--firmware",
        choices=get_args(Firmware),
        default="firmware",
        help="behaviour of the server. documented: as in the manual. firmware (the default): as"
        " observed on the running public server. source: as in the source code of this server",
    )
    for name, number, metavar, effect in _NUMBERS:
        default = getattr(_DEFAULT, name)
        shown = "none" if default == inf else f"{default:g}"
        parser.add_argument(
            f"--{_WORDS.get(name, name).replace('_', '-')}",
            dest=name,
            type=number,
            default=default,
            metavar=metavar,
            help=f"{effect} (default {shown})",
        )
    parser.add_argument(
        "--stuck",
        choices=get_args(Stuck),
        default=_DEFAULT.stuck,
        help="motors that do not turn (default none)",
    )
    parser.add_argument(
        "--encoder-inverted",
        action="store_true",
        help="the encoder counts down when the robot drives forward",
    )
    parser.add_argument(
        "--motor-board-silent",
        action="store_true",
        help="the motor board neither answers nor obeys",
    )
    parser.add_argument(
        "--reference-start-fails",
        action="store_true",
        help="the server answers 'fail' to RM although the robot moves",
    )


def from_arguments(arguments: argparse.Namespace) -> SimulatedMart:
    """Return the board that the parsed options describe."""
    return SimulatedMart(
        MartSettings(
            quirks=QUIRKS[arguments.firmware],
            seed=arguments.seed,
            encoder_sign=-1 if arguments.encoder_inverted else 1,
            motor_board_silent=arguments.motor_board_silent,
            reference_start_fails=arguments.reference_start_fails,
            stuck=arguments.stuck,
            **{name: getattr(arguments, name) for name, *_ in _NUMBERS},
        )
    )


def _within(low: float, high: float) -> Callable[[str], float]:
    def number(text: str) -> float:
        value = float(text)
        if isnan(value) or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    return number


def _bits(text: str) -> int:
    value = int(text, 0)
    if not 0 <= value <= 255:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 255")
    return value


_WORDS = {
    "speed_mps_per_unit": "speed_per_unit",
    "dead_zone_units": "dead_zone",
    "track_m": "track",
    "gyro_bias_dps": "gyro_bias",
    "gyro_noise_dps": "gyro_noise",
    "imu_dies_s": "imu_dies",
    "imu_returns_s": "imu_returns",
    "front_m": "front",
    "rear_m": "rear",
    "dock_m": "dock",
}
_NUMBERS: tuple[tuple[str, Callable[[str], float], str, str], ...] = (
    (
        "speed_mps_per_unit",
        _within(0.0001, 1.0),
        "M/S",
        "wheel speed for one unit of motor speed, at 24 V",
    ),
    ("metres_per_count", _within(1e-6, 1.0), "M", "distance for one encoder count"),
    ("track_m", _within(0.01, 10.0), "M", "distance between the wheels"),
    ("volts", _within(0.0, 40.0), "V", "battery voltage; a higher voltage gives a higher speed"),
    (
        "dead_zone_units",
        _within(0.0, 127.0),
        "UNITS",
        "dead zone: a motor turns only if more than this number of units is commanded",
    ),
    (
        "motor_inequality",
        _within(-1.0, 1.0),
        "PART",
        "fraction by which the left motor is faster than the right motor",
    ),
    (
        "gyro_bias_dps",
        _within(-50.0, 50.0),
        "DEG/S",
        "bias of the gyro; the server does not know the bias before the command SB",
    ),
    ("gyro_noise_dps", _within(0.0, 50.0), "DEG/S", "noise of a gyro sample while the robot moves"),
    ("imu_dies_s", _within(0.0, inf), "SECONDS", "time after the start until the IMU fails"),
    (
        "imu_returns_s",
        _within(0.0, inf),
        "SECONDS",
        "time after the start until the IMU works again",
    ),
    ("front_m", _within(0.0, inf), "M", "distance from the start to a wall in front"),
    ("rear_m", _within(0.0, inf), "M", "distance from the start to a wall behind"),
    ("dock_m", _within(0.0, inf), "M", "distance from the start to the dock in front"),
    (
        "motor_status",
        _bits,
        "BITS",
        "sum of status bits in the reply to MCSTAT. Right motor: 4 tripped, 16 short circuit. Left"
        " motor: 8 tripped, 32 short circuit",
    ),
)
