# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The interface that a new board must implement.

A ``Board`` does not know ROS or ports, and reads no clock. Every ``now`` is the host's steady time,
in s.
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
    """The mode of a board, which its data shows. Each value is the mode's public name."""

    UNKNOWN = "connecting"
    PAUSED = "paused"
    NOMINAL = "nominal"
    IMU_ONLY = "imu_only"

    running: bool
    """Whether the board sends data and obeys motion commands in this mode."""

    def __init__(self, name: str) -> None:
        self.running = name in ("nominal", "imu_only")


RateName = Literal["IMU", "Odometry", "Pose"]
"""Name of a kind of reading in the diagnostics."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardFigures:
    """Figures of a board for the diagnostics. Counters continue over all connections.

    * ``rates_hz``: expected rate of each kind of reading.
    * ``trouble``: why the robot cannot be driven, as a sentence; empty if it can.
    * ``faults``: number of framing faults.
    * ``saturated``: number of commands beyond the range of the board's encoding.
    * ``odom_hz``: rate of ``odom``; None: one message for each odometry reading.
    * ``own``: figures that only this kind of board has, by label.
    """

    rates_hz: Mapping[RateName, float] = field(default_factory=dict)
    trouble: str = ""
    faults: int = 0
    discarded_bytes: int = 0
    saturated: int = 0
    odom_hz: float | None = None
    own: Mapping[str, str] = field(default_factory=dict)


class ReadingClock(Protocol):
    """Computes the stamps of a board's readings, in s of the host's steady clock."""

    @property
    def skew_ppm(self) -> float:
        """Rate error of the board's clock, in ppm. It is positive if the clock is too fast."""

    def restart(self) -> None:
        """Forget all earlier readings, because the next reading begins a new stream."""

    def stamps(
        self, readings: Sequence[Reading], now: float, edge: SampleBoundary | None
    ) -> list[float]:
        """Return one stamp for each of ``readings``, which one call of the board returned.

        * ``now``: time that was passed to this call of ``Board.receive`` or ``Board.elapse``.
        * ``edge``: value of ``Board.edge`` after this call.
        """

    def stamp(self, reading: ImuReading, now: float, edge: SampleBoundary | None) -> float | None:
        """Return the stamp of a reading that arrived alone; faster than ``stamps``.

        If the stamp is uncertain, return None and change nothing; then call ``stamps``.
        """


class Board(Protocol):
    """One kind of board: the translator between its bytes and the rest of the driver.

    Implement each method that has only a docstring. Requests such as ``pause`` raise RequestRefused
    if the present mode forbids them.
    """

    traits: Traits
    """Capabilities of this kind of board."""

    settings: Any
    """Settings that the driver cannot learn from the board's data.

    The driver can replace the settings object at any time.
    """

    clock: ReadingClock | None = None
    """Clock for readings that carry the board's time.

    If None, the stamps are computed from the board's ticks or from the arrival times.
    """

    @property
    def mode(self) -> Mode:
        """Mode of the board, inferred from its data."""

    @property
    def edge(self) -> SampleBoundary | None:
        """Place in the stream of IMU samples at which the last read of the port ended.

        None if this place is uncertain, or is the same as after the previous read.
        """
        return None

    @property
    def figures(self) -> BoardFigures:
        """Counters and states for the diagnostics."""
        return BoardFigures()

    @property
    def advice(self) -> str | None:
        """Advice on settings that contradict the board's data; None without a contradiction."""
        return None

    @property
    def refusal(self) -> str:
        """Reason why motion is refused, with a remedy; empty if motion is allowed.

        While the board runs, commands to stand still are not refused for this reason.
        """
        return ""

    @property
    def own_motion(self) -> str:
        """Name of a motion that a service has begun, e.g. "docking"; empty if there is none."""
        return ""

    @property
    def reset_refusal(self) -> str:
        """Reason why a requested reset is refused, with a remedy; empty if a reset is allowed."""
        return ""

    @property
    def start_refusal(self) -> str:
        """Reason why ``start`` cannot start a paused board now, with a remedy; empty if it can."""
        return ""

    def gravity_advice(self, gravity_mps2: float) -> str:
        """Return advice on the IMU's settings if the measured gravity is wrong; otherwise empty.

        ``gravity_mps2``: specific force at rest, in m/s².
        """
        return ""

    def connect(self) -> None:
        """Begin a new connection: forget the mode, and everything from the old connection."""

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Decode bytes, update ``mode``, and return the readings in order.

        If a reading is certain only after later bytes, the call that receives these bytes returns
        the reading. ``now``: time of arrival.
        """

    def flush(self, now: float) -> list[Reading]:
        """Decode the bytes that are still held when the line is closed. Return their readings."""
        return []

    def discard(self) -> None:
        """Discard incomplete data, because a long silence has followed.

        Otherwise, later bytes could complete a reading, which would get a wrong arrival time.
        """
        return

    def silence(self) -> None:
        """Forget the mode, because the board has been silent for ``Traits.silence_s``."""

    def stalled(self) -> None:
        """Record that this process stalled, so its guard may have sent ``last_words``.

        ``last_words`` may also have switched off another motor, e.g. a brush.
        """
        return

    @property
    def wake_at(self) -> float:
        """Time at which ``due`` and ``elapse`` must be called again, in s; infinity if never."""
        return math.inf

    def due(self, now: float) -> Packets:
        """Return the packets to write now: subscriptions, polls and relayed values.

        The packets command no motion, and are always written. Called at ``wake_at``.
        """
        return NO_PACKETS

    def elapse(self, now: float) -> list[Reading]:
        """Return the readings that are due because time has passed. Called at ``wake_at``.

        The driver may have made OdometryReadings, NoticeReadings and results of requests itself.
        All other readings show that the board is alive.
        """
        return []

    def leave(self) -> None:
        """Prepare for the exit of the driver: now ``due`` returns only packets for the shutdown."""
        return

    def reset_odometry(self) -> None:
        """Make the robot's present pose the origin of the frame of the OdometryReadings."""

    @property
    def shows_standstill(self) -> bool:
        """Whether the board's displacements can currently prove that the robot stands still."""
        return True

    def actuator(self, proof: StopProof) -> Actuator:
        """Return the actuator, which encodes motion orders. The driver calls this method once.

        ``proof``: the object to which the actuator reports each stop and each motion.
        """

    def wake(self) -> Packets:
        """Return the packets that wake the board, end a partial command and stop the wheels.

        These packets must work in any state of the board.
        """

    def start_requested(self) -> None:
        """Record that the user has requested a start; a call of ``start`` may follow.

        The driver's own starts, e.g. after a reconnect, do not call this method.
        """
        return

    def start(self) -> Packets:
        """Return the packets that start the board from any mode. They may be sent repeatedly."""
        return NO_PACKETS

    def pause(self) -> Packets:
        """Return the packets that pause a running board.

        Raises RequestRefused if the board may already be paused, and these packets would then start
        the board again.
        """
        return NO_PACKETS

    def force_pause(self) -> Packets:
        """Return packets that pause the board in any mode.

        The packets must also work if earlier commands arrive after them.
        """
        return NO_PACKETS

    def reset(self) -> Packets:
        """Return the packets that reboot the board. The mode is then unknown until data arrives.

        The driver calls this method again if the board does not obey.
        """
        return NO_PACKETS

    def reset_given_up(self) -> None:
        """Record that the driver has given up the reset, so ``due`` must not repeat it."""
        return

    def stop(self) -> Packets:
        """Return the packets that stop the robot. The packets can depend on the robot's motion."""

    def emergency_stop(self) -> Packets:
        """Return the packets of the board's own emergency stop; empty if the board has none.

        They do not include the packets of ``stop``.
        """
        return NO_PACKETS

    def switch_off(self) -> Packets:
        """Return the packets that switch off devices other than the wheels. Sent after Stop."""
        return NO_PACKETS

    def last_words(self) -> tuple[Packets, Packets]:
        """Return the packets that the guard sends if this process hangs, in two versions.

        The first version is for a released e-stop, the second for a latched one. Called after each
        input and before each output.
        """
        stop = self.stop()
        return stop, self.emergency_stop() + stop
