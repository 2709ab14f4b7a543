# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART controller as a board of the driver: its pilot, in the words of the seam.

Nothing streams. Whatever is known was asked for, so the pilot's polls are the board's voice, and a
controlled move is a silence that is expected.
"""

import math
from typing import Final

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.actuator import Wanted
from omnibot_driver.core.commands.orders import Drive, GoTo, Order
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.pilot import Pilot
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import State
from omnibot_driver.core.mart.stops import SLOWEST_MPS, SLOWEST_RADPS
from omnibot_driver.core.packets import Packets
from omnibot_driver.core.readings import NOTHING_MEASURED, Reading
from omnibot_driver.core.traits import Traits

TRAITS: Final = Traits(
    channels=("command", "stop"),
    imu_period_s=None,
    authorities=frozenset({Authority.BASE, Authority.POSE}),
    requests=frozenset(),
    wheels=("left", "right"),
    unheard_s=1.5,
    silence_s=3.0,
    own_odometry=True,
    stands_after_s=0.3,
    unproved_s=6.0,
    stops_within_s=1.0,
    slack_mps=0.15,
    slack_radps=0.6,
)
UNREAD_S: Final = 0.5
"""A robot that drives is measured more often."""
EXPECTED_EVERY_S: Final = 0.2


class MartBoard(Board):
    """One controller. ``settings`` may be replaced at any time."""

    traits = TRAITS

    def __init__(self, settings: MartSettings) -> None:
        self._pilot = Pilot(settings)
        self._mode = Mode.UNKNOWN
        self._told_s = self._expected_s = self._read_s = -math.inf

    @property
    def settings(self) -> MartSettings:
        """What the wire does not tell."""
        return self._pilot.settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        if settings != self._pilot.settings:
            self._pilot.settings = settings

    @property
    def mode(self) -> Mode:
        """Nominal once the server has answered to its name and to the first stop."""
        return self._mode

    @property
    def figures(self) -> BoardFigures:
        """With the motor board's state by name."""
        pilot = self._pilot
        return BoardFigures(
            rates_hz={},
            faults=pilot.decoder.foreign,
            own={
                "Motion": pilot.state.value,
                "Motor board": pilot.health.bits,
                "Battery (V)": "unknown"
                if pilot.health.volts is None
                else f"{pilot.health.volts:.2f}",
                "Late replies": str(pilot.conversation.discarded),
                "Job": pilot.jobs.progress(pilot.now_s),
                "Goal": pilot.goal_progress,
            },
            trouble=pilot.refusal,
        )

    @property
    def refusal(self) -> str:
        """Why the robot is not to be driven."""
        return self._pilot.refusal

    # Inbound

    def connect(self) -> None:
        """Begin a new connection."""
        self._pilot.connect()
        self._mode = Mode.UNKNOWN

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """What a datagram tells."""
        if channel == words.COMMAND:
            self._pilot.hear(data, now)
        readings = self._pilot.take()
        if self._pilot.ready:
            self._mode = Mode.NOMINAL
            unread = not readings and now >= self._read_s + UNREAD_S
            if unread and self._pilot.heard_s == now:
                readings.append(NOTHING_MEASURED)
        if readings:
            self._read_s = now
        return readings

    def silence(self) -> None:
        """The server has not answered for long: it may have been started again."""
        self._mode = Mode.UNKNOWN
        self._pilot.fell_silent()

    def elapse(self, now: float) -> list[Reading]:
        """Odometry, and that a silence is expected."""
        readings = self._pilot.take()
        pilot = self._pilot
        if self._mode is not Mode.NOMINAL:
            return readings
        if now >= self._told_s + 1.0 / self.settings.odom_rate_hz:
            period_s = 1.0 / self.settings.odom_rate_hz
            self._told_s = max(self._told_s + period_s, now - period_s / 2)
            readings.append(pilot.told(now))
        if pilot.busy(now) and now >= self._expected_s + EXPECTED_EVERY_S:
            self._expected_s = now
            readings.append(NOTHING_MEASURED)
        return readings

    def reset_odometry(self) -> None:
        """The frame begins where the robot stands."""
        self._pilot.odometry.reset()

    # Outbound

    @property
    def wake_at(self) -> float:
        """When ``due`` or ``elapse`` have something."""
        if self._pilot.readings or self._pilot.jobs.done:
            return -math.inf
        times = [self._pilot.wake_at]
        if self._mode is Mode.NOMINAL:
            times.append(self._told_s + 1.0 / self.settings.odom_rate_hz)
            if self._pilot.busy(self._expected_s + EXPECTED_EVERY_S):
                times.append(self._expected_s + EXPECTED_EVERY_S)
        return min(times)

    def actuator(self, proof: StopProof) -> "Conductor":
        """What is wanted, as what the pilot says."""
        self._pilot.proof = proof
        return Conductor(self._pilot)

    def wake(self) -> Packets:
        """Stop; the pilot says it again, and awaits the reply before anything else."""
        return self.stop()

    def stop(self) -> Packets:
        """What stops the present state of motion."""
        said = self._pilot.stop_words
        return tuple((word.channel, word.request().data) for word in said)

    def emergency_stop(self) -> Packets:
        """The same: the controller has no emergency stop."""
        return self.stop()

    # What only this board has

    def ask(self, job: Job, token: object, now: float, *arguments: object) -> None:
        """Begin a job; a JobDone answers. Raises RequestRefused."""
        self._pilot.jobs.ask(job, token, now, *arguments)

    @property
    def resting(self) -> bool:
        """Whether the robot is proved to stand, and the server is free."""
        return self._pilot.state is State.STILL and self._pilot.proof.proved


class Conductor:
    """The actuator: the policy's wish for the pilot, which says one thing at a time."""

    rate_hz = 20.0

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot

    @property
    def commanded(self) -> BodyTwist | None:
        """By the motors' last command; None in a controlled move."""
        return self._pilot.commanded

    @property
    def wake_at(self) -> float:
        """When the pilot has something to say."""
        return self._pilot.wake_at

    def is_zero(self, order: Order) -> bool:
        """What is slower than the controller can drive stands still."""
        if isinstance(order, GoTo):
            return False
        return not isinstance(order, Drive) or not (
            abs(order.twist.vx_mps) >= SLOWEST_MPS
            or abs(order.twist.yaw_rate_radps) >= SLOWEST_RADPS
        )

    def connect(self) -> None:
        """``MartBoard.connect`` has done it."""

    def apply(self, wanted: Wanted, now: float) -> None:
        """This is wanted from now on."""
        self._pilot.apply(wanted, now)

    def wrote(self, packets: Packets, now: float) -> None:
        """No other client writes."""

    def due(self, now: float) -> Packets:
        """What to write now."""
        return self._pilot.due(now)
