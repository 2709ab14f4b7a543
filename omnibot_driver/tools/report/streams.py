# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The timing that the topics of a robot should have."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

from omnibot_driver.core.reporting.diagnosis import PUBLISHED_ODOMETRY
from omnibot_driver.core.reporting.status import RUNNING
from omnibot_driver.tools.report.log import Log, Status


@dataclass(frozen=True, slots=True)
class Stream:
    """The expected timing of a topic.

    ``running``: the states of the driver in which it publishes the topic.

    ``lost``: keys of those values in the driver's diagnostics that count lost messages.

    ``rates``: keys of the topic's rate in the driver's diagnostics; the first one with a value is
    used.
    """

    name: str
    rate_hz: float
    running: tuple[str, ...]
    lost: tuple[str, ...]
    rates: tuple[str, ...]

    def promised(self, log: Log) -> "Stream":
        """Return this stream with the expected rate from the driver's diagnostics.

        * One robot: the last rate in the diagnostics. If they have none: the rate of the OmniBot,
          or NaN if the robot has two driving wheels and so is another robot.
        * Several robots: their common rate; NaN if the known rates differ, or if none is known.
        """
        told = [rate_hz for status in log.diagnostics if (rate_hz := self._told(status))]
        if log.alone:
            told = told[-1:] or ([] if log.two_wheels else [self.rate_hz])
        return replace(self, rate_hz=told[0] if len({*told}) == 1 else math.nan)

    def _told(self, status: Status) -> float | None:
        """Return the expected rate of the topic, in Hz, according to a status in /diagnostics.

        Return None if the status contains no such rate.
        """
        for key in self.rates:
            with suppress(KeyError, ValueError):
                if (rate_hz := float(status.values[key].rpartition(" of ")[2])) > 0.0:
                    return rate_hz
        return None


IMU: Final = Stream(
    "imu/data_raw",
    100.0,
    RUNNING,
    lost=("IMU frames lost", "IMU readings refused"),
    rates=("IMU rate (Hz)",),
)
ODOMETRY: Final = Stream(
    "odom",
    25.0,
    ("nominal",),
    lost=("Odometry frames lost", "Odometry readings refused"),
    rates=(PUBLISHED_ODOMETRY, "Odometry rate (Hz)"),
)
"""The expected timing of the odometry.

The rate is that of an OmniBot.
"""
