# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The LOIS ECU's own parameters. This module does not use ROS.

A parameter whose value the board stores is unset by default; the driver then writes no value.
"""

from collections.abc import Mapping
from typing import Any, Final

from omnibot_driver.core.errors import ParameterError
from omnibot_driver.core.lois_ecu import Setting, Stream
from omnibot_driver.core.lois_ecu.messages import MOST_SAMPLES
from omnibot_driver.parameters import Parameter

SHORTEST_PERIOD_S: Final = 0.05
LONGEST_PERIOD_S: Final = 60.0
MOST_TERMINAL_RATE_HZ: Final = 25.0
"""Largest rate of commands in a terminal mode, in Hz. In such a mode, the board forwards each
command to a sensor; the compass' line carries at most 34 commands a second.
"""

WHEELS: Final = (
    Parameter(
        "wheel_radius",
        0.13,
        "m",
        "Radius of a wheel.",
        low=0.001,
        high=1.0,
        calibrated=True,
    ),
    Parameter(
        "track",
        0.47,
        "m",
        "Distance between the wheels.",
        low=0.01,
        high=10.0,
        calibrated=True,
    ),
    Parameter(
        "ticks_per_revolution",
        60,
        "ticks",
        "Encoder ticks of one turn of a wheel.",
        low=1,
        high=1_000_000,
    ),
    Parameter(
        "inverted",
        False,
        "",
        "True if the board's left wheel is the robot's right wheel, and vice versa.",
        fixed=True,
        calibrated=True,
    ),
)

DRIVING: Final = (
    Parameter(
        "drive_mode",
        "rpm",
        "",
        "What the driver commands: rpm (wheel speeds, which the board controls) or duty (motor"
        " duty, without speed control). Only duty mode accepts duty_cmd. The driver stops the"
        " robot before it changes the mode.",
        choices=("rpm", "duty"),
    ),
    Parameter(
        "duty_scale",
        130.0,
        "%/(m/s)",
        "Motor duty at which a wheel's rim moves at 1 m/s. In duty mode, the driver converts"
        " cmd_vel and wheel_cmd to motor duty with this value.",
        low=1.0,
        high=10_000.0,
        calibrated=True,
    ),
    Parameter(
        "max_duty",
        100,
        "%",
        "Largest motor duty that the driver commands in duty mode.",
        low=1,
        high=100,
    ),
    Parameter(
        "low_pass",
        1.0,
        "",
        "Low-pass filter of the commanded RPM (0x23): the part of a change that takes effect in"
        " each step of the speed controller. 1 turns the filter off. With 0, the default of the"
        " public firmware, the wheels never turn. So the driver always writes this parameter.",
        low=0.001,
        high=1.0,
    ),
    Parameter(
        "odom_rate",
        20.0,
        "Hz",
        "Rate at which odom and its transform are published. The driver predicts them between two"
        " messages of the board.",
        low=1.0,
        high=50.0,
    ),
    Parameter(
        "magnetic_declination",
        0.0,
        "rad",
        "Magnetic declination, for imu/heading: the angle from true north to magnetic north,"
        " positive to the east.",
        low=-3.15,
        high=3.15,
    ),
    Parameter(
        "heading_stddev",
        0.1,
        "rad",
        "Standard deviation of the compass heading, for the covariance of imu/heading.",
        low=1e-6,
        high=10.0,
    ),
    Parameter(
        "terminal_mode",
        "host",
        "",
        "What the board sends (0x11). host: its own messages; gps or compass: the text lines of"
        " this sensor. The driver publishes these lines on ~/terminal. The driver stops the robot"
        " before it changes the mode, and refuses motion in every mode except host.",
        choices=("host", "gps", "compass"),
    ),
    Parameter(
        "record_samples",
        200,
        "",
        "Length of a record: samples of each wheel (~/record_rpm, ~/record_torque), or headings"
        " (~/record_heading). The limit is 1024, because the board never completes a longer"
        " record.",
        low=1,
        high=MOST_SAMPLES,
    ),
    Parameter(
        "record_directory",
        "~/.ros/lois_ecu_records",
        "",
        "Folder in which the driver saves records as CSV files.",
    ),
    Parameter(
        "checksum",
        True,
        "",
        "Whether the board verifies checksums (0x11). This parameter cannot change while the driver"
        " runs, because the stop command of the guard process depends on the parameter.",
        fixed=True,
    ),
)


_RANGES: Final = {
    "kp": (0.0, 1000.0),
    "tn": (0.001, 1000.0),
    "td": (0.0, 1000.0),
    "short_correction": (0.1, 10.0),
    "long_correction": (0.1, 10.0),
    "feed_forward": (0.0, 1000.0),
}
"""Lower and upper limit of each kind of setting. A negative gain would make the control unstable.
The board divides by Tn, so Tn must not be 0."""


_UNITS: Final = {"tn": "s", "td": "s"}


def _setting(name: str, what: str) -> Parameter:
    low, high = _RANGES[name.partition("_")[2]]
    return Parameter(
        name,
        1.0,
        _UNITS.get(name.partition("_")[2], ""),
        f"{what}. Unset: the board keeps its own value.",
        low=low,
        high=high,
        unset=True,
        calibrated=True,
    )


SETTINGS: Final[Mapping[str, Setting]] = {
    f"{setting.name.lower()}": setting for setting in Setting if setting != Setting.RPM_LOW_PASS
}
"""Settings that the board stores, by the name of their parameter."""
_WORDS: Final = {
    "kp": "Gain Kp of the {} wheel's speed controller",
    "tn": "Integral time Tn of the {} wheel's speed controller",
    "td": "Time constant Td of the {} wheel's speed controller",
    "short_correction": (
        "Factor by which the board multiplies the measured duration of each short level of the {}"
        " encoder's signal. Short and long levels alternate. `calibrate step` finds the factors"
        " that make them equal"
    ),
    "long_correction": (
        "Factor by which the board multiplies the measured duration of each long level of the {}"
        " encoder's signal. Short and long levels alternate. `calibrate step` finds the factors"
        " that make them equal"
    ),
    "feed_forward": "Feed-forward of the {} wheel's speed controller",
}
WRITTEN: Final = tuple(
    _setting(name, _WORDS[name.partition("_")[2]].format(name.partition("_")[0]))
    for name in SETTINGS
)

PERIODS: Final[Mapping[str, Stream]] = {
    "ticks_period": Stream.TICKS,
    "odometry_period": Stream.ODOMETRY,
    "heading_period": Stream.HEADING,
    "position_period": Stream.GPS_POSITION,
    "time_period": Stream.GPS_TIME,
    "date_period": Stream.GPS_DATE,
}
"""Messages that the board sends periodically, by the name of the parameter that sets the period."""


def _period(
    name: str, what: str, low_s: float = 0.0, high_s: float = LONGEST_PERIOD_S
) -> Parameter:
    off = "" if low_s else "; 0 turns it off"
    return Parameter(
        name,
        low_s,
        "s",
        f"Period of the {what}{off}. The board cannot receive while it sends, so"
        " with a shorter period the board misses more commands. Unset: the board keeps its own"
        " value.",
        low=low_s,
        high=high_s,
        unset=True,
    )


SENT: Final = (
    _period(
        "ticks_period",
        "message with the ticks (0x12). Without the ticks the driver has no odometry and cannot"
        " confirm a stop",
        SHORTEST_PERIOD_S,
        0.5,
    ),
    _period("odometry_period", "message with the board's own odometry (0x20)"),
    _period("heading_period", "heading (0x10)"),
    _period("position_period", "GPS position (0x0d)"),
    _period("time_period", "GPS time (0x0e)"),
    _period("date_period", "GPS date (0x0f)"),
)


def require_checksum_in_terminal_mode(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if a terminal mode is chosen and checksums are off.

    In a terminal mode, the board would ignore a stop without a checksum.
    """
    if values["terminal_mode"] != "host" and not values["checksum"]:
        raise ParameterError(
            "parameter 'terminal_mode' must be host while 'checksum' is false: in the modes gps"
            " and compass, the board expects checksums and would ignore a stop without one"
        )


def require_slow_commands_in_terminal_mode(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if the command rate would delay Stop in a terminal mode.

    In such a mode, the board forwards each Stop to a sensor at 4800 or 9600 baud.
    """
    if values["terminal_mode"] != "host" and values["command_rate"] > MOST_TERMINAL_RATE_HZ:
        raise ParameterError(
            f"parameter 'command_rate' must be at most {MOST_TERMINAL_RATE_HZ:g} Hz while"
            f" 'terminal_mode' is {values['terminal_mode']}, not {values['command_rate']:g}: in"
            " this mode the board reads commands slowly; at a higher rate, it would receive a stop"
            " late or never"
        )


def require_possible_periods(values: Mapping[str, Any]) -> None:
    """Raise ParameterError if the period of a message is too short for the board.

    With a period near 0, the public firmware sends all the time and misses all commands.
    """
    for name in PERIODS:
        period_s = values[name]
        if period_s and period_s < SHORTEST_PERIOD_S:
            raise ParameterError(
                f"parameter '{name}' must be 0 (off) or {SHORTEST_PERIOD_S} to"
                f" {LONGEST_PERIOD_S:g} s, not {period_s:g}"
            )
