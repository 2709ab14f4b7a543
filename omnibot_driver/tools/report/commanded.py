# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Pairs the commands of a topic with the measurements of the motion that they command."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from omnibot_driver.tools.report.log import Log, Series

YAW_WEIGHT_M: Final = 0.143
WHEEL_WEIGHT_M: Final = 0.029
"""Factors in m that convert a yaw rate and a wheel's rate to the speed of the wheel's rim.

The OmniBot's factors are used for all robots. They are good enough to detect motion and to weight
the axes.
"""


@dataclass(frozen=True, slots=True)
class Pair:
    """A topic, its commands, and the measurements of the motion that they command.

    ``weights``: for each axis, the factor that converts a value to the speed of a wheel's rim in
    m/s.

    ``scales``: for each axis, the parameter that scales the commands; empty for a robot with two
    wheels.
    """

    topic: str
    axes: tuple[str, ...]
    units: tuple[str, ...]
    weights: tuple[float, ...]
    scales: tuple[str, ...]
    commands: Series
    measured: Series


def twists(log: Log) -> Pair:
    """Return the commands on cmd_vel and the twists in odom. Both contain only finite values."""
    odom = _sampled(log.odom)
    scales = () if log.two_wheels else ("linear_scale", "linear_scale", "angular_scale")
    return Pair(
        "cmd_vel",
        ("vx", "vy", "yaw rate"),
        ("m/s", "m/s", "rad/s"),
        (1.0, 1.0, YAW_WEIGHT_M),
        scales,
        log.cmd_vel.only(log.cmd_vel.finite),
        Series(odom.arrived_s, odom.stamp_s, odom.values[:, 3:]),
    )


def pairs(log: Log) -> list[Pair]:
    """Return the pairs of commands and measurements for cmd_vel and for wheel_cmd.

    A pair is left out if the log lacks its commands or its measurements. All values are finite.
    """
    count = len(log.wheels)
    wheels = Pair(
        "wheel_cmd",
        tuple(map(wheel_name, log.wheels)),
        ("rad/s",) * count,
        (WHEEL_WEIGHT_M,) * count,
        () if log.two_wheels else ("linear_scale",) * count,
        log.wheel_cmd.only(log.wheel_cmd.finite),
        _sampled(log.joint_states),
    )
    return [pair for pair in (twists(log), wheels) if len(pair.commands) and len(pair.measured) > 1]


def wheel_name(joint: str) -> str:
    """Return the name of a wheel as the report shows it, such as "wheel A" or "left wheel"."""
    words = joint.removesuffix("_joint").split("_")
    return " ".join(word.upper() if len(word) == 1 else word for word in words)


def shown(log: Log) -> list[Pair]:
    """Return what to draw: pairs of commands and measurements.

    If the log has no commands, the only pair consists of the measurements of odom alone.
    """
    return pairs(log) or [twists(log)]


def _sampled(series: Series) -> Series:
    """Return the rows with finite values and a timestamp, with timestamps by the recorder's clock.

    The recorder's clock is used because it also gives the times of commands, states and e-stops.
    """
    rows = series.only(series.finite & np.isfinite(series.stamp_s))
    return Series(rows.arrived_s, rows.stamp_s + series.other_clock_s, rows.values)
