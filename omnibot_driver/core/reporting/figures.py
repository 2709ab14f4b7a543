# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The figures for the diagnostics: of the link, the board, its readings and the commands."""

from dataclasses import dataclass

from omnibot_driver.core.board import BoardFigures
from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.measurement.statistics import StreamStatistics
from omnibot_driver.core.readings import Vector3


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFigures:
    """The figures of the link to the board.

    * ``trouble``: why the port is not open, as a sentence; empty while the port is open.
    * ``opened``: how often the port was opened.
    * ``overruns``: how often the kernel lost bytes since the port was opened; None if not counted.
    * ``waited_s``: total time for which the reader thread waited for the processor, in s; None if
      not counted.
    """

    port: str
    trouble: str = ""
    opened: int = 0
    received_bytes: int = 0
    sent_bytes: int = 0
    overruns: int | None = None
    waited_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusals:
    """The number of commands that were refused, and the reason for the last one."""

    count: int = 0
    last: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandFigures:
    """The figures of the commands.

    * ``source``: the topic that commands the robot now, or None.
    * ``age_s``: age in s of the last command from that topic.
    * ``trips``: how often the motion monitor has stopped the robot.
    * ``interlock``: why motion is refused, with a remedy; empty if allowed.
    """

    source: str | None = None
    age_s: float = 0.0
    limited: int = 0
    estop: bool = False
    monitored: bool = True
    trips: int = 0
    interlock: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuFigures:
    """The figures of the IMU.

    * ``gravity_mps2``, ``noise_radps``: gravity and the gyro's noise, measured at the last
      standstill; None before the first standstill.
    * ``advice``: what to check if the measured gravity contradicts a parameter; otherwise empty.
    """

    bias_radps: Vector3
    gravity_mps2: float | None = None
    noise_radps: Vector3 | None = None
    advice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionFigures:
    """The figures of the board, its readings and its commands.

    * ``skew_ppm``: how much faster the board's clock runs than the host's.
    * ``task``: name, elapsed time and time limit of the long task; empty without a task.
    """

    state: str
    tally: StreamStatistics
    board: BoardFigures
    refused: Refused
    skew_ppm: float
    commands: CommandFigures
    imu: ImuFigures
    task: str = ""
