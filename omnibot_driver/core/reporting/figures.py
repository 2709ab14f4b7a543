# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""All that is known of the link and the board at one moment: values only."""

from dataclasses import dataclass

from omnibot_driver.core.board import BoardFigures
from omnibot_driver.core.measurement.outlier_filter import Refused
from omnibot_driver.core.measurement.statistics import StreamStatistics
from omnibot_driver.core.readings import Vector3


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFigures:
    """``trouble``: why the port cannot be had, in a sentence; empty while it is open.

    ``overruns``: how often the kernel lost bytes since the port was opened; ``waited_s``: how long
    the reader was ready to run and did not; None where that is not counted.
    """

    port: str
    trouble: str = ""
    opened: int = 0
    received_bytes: int = 0
    sent_bytes: int = 0
    overruns: int | None = None
    waited_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandFigures:
    """``source``: the topic that commands, ``age_s`` old by now; None while there is none.

    ``monitored``: whether a robot that does not move as commanded is stopped;
    ``trips``: how often the motion monitor has stopped the robot; ``interlock``: what motion is
    refused until, in a sentence; empty while it is allowed.
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
    """``gravity_mps2`` and ``noise_radps`` are of the last standstill; None before the first.

    ``advice``: which parameter gravity contradicts, in a sentence.
    """

    bias_radps: Vector3
    gravity_mps2: float | None = None
    noise_radps: Vector3 | None = None
    advice: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionFigures:
    """``skew_ppm``: how much faster the board's clock runs than ours.

    ``task``: what is under way that takes the board long, and since when; empty where nothing is.
    """

    state: str
    tally: StreamStatistics
    board: BoardFigures
    refused: Refused
    skew_ppm: float
    commands: CommandFigures
    imu: ImuFigures
    task: str = ""
