# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What any motor board offers a driver: the seam at which further boards join.

Readings are what a board measured, in SI units, with no trace of its bytes. A ``Board`` turns bytes
into readings and requests into bytes, keeps the belief about the board's mode, and makes the
actuator that says orders. It knows no ROS, no port and no clock.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal, Protocol

from omnibot_driver.core.commands.actuator import Actuator
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.packets import NO_PACKETS, Packets
from omnibot_driver.core.readings import ImuReading, Reading, SampleBoundary
from omnibot_driver.core.traits import Traits


class Mode(Enum):
    """The mode of the board, as its data shows; the value is its public name."""

    UNKNOWN = "connecting"
    PAUSED = "paused"
    NOMINAL = "nominal"
    IMU_ONLY = "imu_only"

    running: bool
    """True in the modes in which the board sends data and obeys motion commands."""

    def __init__(self, name: str) -> None:
        self.running = name in ("nominal", "imu_only")


RateName = Literal["IMU", "Odometry", "Pose"]
"""A kind of reading, as it is called in diagnostics."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardFigures:
    """What a board's translator counts, since the driver began.

    ``rates_hz``: how often each kind of reading should come that the board sends; ``faults``: how
    often the framing was lost, with ``discarded_bytes``; ``saturated``: commands that did not fit;
    ``odom_hz``: how often ``odom`` goes out, where that is not with each odometry reading;
    ``own``: what only this board has to show (its version, voltage, progress), by names for people;
    ``trouble``: why the robot cannot be driven, in a sentence; empty if it can.
    """

    rates_hz: Mapping[RateName, float] = field(default_factory=dict)
    trouble: str = ""
    faults: int = 0
    discarded_bytes: int = 0
    saturated: int = 0
    odom_hz: float | None = None
    own: Mapping[str, str] = field(default_factory=dict)


class ReadingClock(Protocol):
    """What stamps the readings of a board, in s of the host's steady clock."""

    @property
    def skew_ppm(self) -> float:
        """How much faster the board's clock runs than ours."""

    def restart(self) -> None:
        """What the board does from here on has nothing to do with what it did before."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Of the readings that ``Board.receive`` or ``elapse`` has just told, in their order."""

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """``stamps`` of one that came alone; None, and nothing is changed, where it is not sure."""


class Board(Protocol):
    """One kind of board. Requests raise RequestRefused where the mode forbids them.

    What has a body here is what a board does that has nothing to say to it.
    """

    traits: Traits
    """What it has and can do."""

    settings: Any
    """What its wire does not tell, in values of its own kind; may be replaced at any time."""

    clock: ReadingClock | None = None
    """What stamps its readings, where they carry the board's time; None: ticks, or arrival."""

    @property
    def mode(self) -> Mode:
        """The present belief."""

    @property
    def edge(self) -> SampleBoundary | None:
        """The place where the last read ended.

        None while the framing is in doubt, or without news.
        """
        return None

    @property
    def figures(self) -> BoardFigures:
        """Counters for the person who maintains the line."""
        return BoardFigures()

    @property
    def advice(self) -> str | None:
        """Advice on settings that contradict the board's data; None if there is none."""
        return None

    @property
    def refusal(self) -> str:
        """The reason why motion is refused, with a remedy; empty if it is allowed."""
        return ""

    def gravity_advice(self, gravity_mps2: float) -> str:
        """Advice on the settings by a specific force at rest; empty if it is gravity."""
        return ""

    def connect(self) -> None:
        """Begin a new connection: forget all held bytes and beliefs."""

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Decode bytes; returns the readings that they complete, in order, and updates ``mode``."""

    def flush(self, now: float) -> list[Reading]:
        """The line is closed: return what the held bytes still prove."""
        return []

    def silence(self) -> None:
        """Forget the mode, as the board has been silent for too long."""

    def stalled(self) -> None:
        """This process did not run for a while: the guard may have switched off what turned."""
        return

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` must be called again; infinity if the board needs no calls."""
        return math.inf

    def due(self, now: float) -> Packets:
        """What keeps the board talking and is not a command: subscriptions, polls, relays.

        It counts as written.
        """
        return NO_PACKETS

    def elapse(self, now: float) -> list[Reading]:
        """The readings that follow from elapsed time; called when ``wake_at`` has come."""
        return []

    def leave(self) -> None:
        """The driver ends: from now on ``due`` has nothing that is not needed for a stop."""
        return

    def reset_odometry(self) -> None:
        """Begin the frame of the OdometryReadings at the robot's present pose."""

    @property
    def shows_standstill(self) -> bool:
        """Whether its displacements can currently prove a standstill."""
        return True

    def actuator(self, proof: StopProof) -> Actuator:
        """The part that encodes orders and reports stops and motions to ``proof``. Made once."""

    def wake(self) -> Packets:
        """The bytes that wake a board in any state, end a partial command and stop the wheels."""

    def start(self) -> Packets:
        """Make the board run, whatever its mode is; harmless to repeat."""
        return NO_PACKETS

    def pause(self) -> Packets:
        """Pause a running board. Refused when it is not known to run."""
        return NO_PACKETS

    def force_pause(self) -> Packets:
        """Pause, whatever it did before and whatever of ours is still on the way to it."""
        return NO_PACKETS

    def reset(self) -> Packets:
        """Reboot; the mode is unknown until the board is heard again."""
        return NO_PACKETS

    def stop(self) -> Packets:
        """Stand still. Where it depends on what the robot does: as it is now."""

    def emergency_stop(self) -> Packets:
        """The board's own emergency stop, and nothing else."""
        return NO_PACKETS

    def switch_off(self) -> Packets:
        """What else to switch off when the driver ends, behind Stop and what ``on_exit`` says."""
        return NO_PACKETS

    def last_words(self) -> tuple[Packets, Packets]:
        """What stops it now if this process cannot: as Stop, and as the emergency stop.

        Asked after each input and before each output, for a board where they follow its state.
        """
        stop = self.stop()
        return stop, self.emergency_stop() + stop
