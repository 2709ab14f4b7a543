# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The MART controller as a ``Board`` of the driver. A ``Pilot`` decides what is sent.

The controller sends only replies to commands. It is silent during a controlled move.
"""

import math
from typing import Final

from omnibot_driver.core.board import Board, BoardFigures, Mode
from omnibot_driver.core.commands.set_points import Authority
from omnibot_driver.core.commands.stop_proof import StopProof
from omnibot_driver.core.mart import words
from omnibot_driver.core.mart.actuator import Conductor
from omnibot_driver.core.mart.jobs import Job
from omnibot_driver.core.mart.pilot import Pilot
from omnibot_driver.core.mart.settings import MartSettings
from omnibot_driver.core.mart.states import State
from omnibot_driver.core.motion_monitor.monitor import Fault
from omnibot_driver.core.packets import Packets
from omnibot_driver.core.readings import NOTHING_MEASURED, NoticeReading, Reading
from omnibot_driver.core.requests import LEAVING
from omnibot_driver.core.traits import Traits

TRAITS: Final = Traits(
    channels=("command", "stop"),
    imu_period_s=None,
    authorities=frozenset({Authority.BASE, Authority.POSE}),
    requests=frozenset(),
    wheels=("left", "right"),
    unheard_s=1.5,
    silence_s=1.5,
    own_odometry=True,
    stands_after_s=0.3,
    baudrate=False,
    stops_within_s=1.0,
    slack_mps=0.15,
    slack_radps=0.6,
    advice={
        Fault.WRONG_WAY: "check `encoder_inverted`, and the wiring of motors and encoder",
        Fault.WRONG_TURN: "check `heading_inverted`, and the wiring of the motors",
        Fault.TOO_FAST: "check `metres_per_count` and `heading_inverted`",
        Fault.TURNS_TOO_FAST: "check `track`, `metres_per_count` and `spin_speed`",
        Fault.BEYOND_LIMITS: "check `metres_per_count` and `track`",
    },
)
ANSWERED: Final = NoticeReading("", halt=False)
"""A reading that only shows that the server answers, and has no other effect. NOTHING_MEASURED is
not used for this, because it makes the motion monitor forget its earlier measurements."""
EXPECTED_EVERY_S: Final = 0.2
SILENT: Final = "the server no longer answers; check its power and the network, then call again"


class MartBoard(Board):
    """A MART controller, as a board of the driver.

    ``settings`` may be replaced at any time.
    """

    traits = TRAITS

    def __init__(self, settings: MartSettings) -> None:
        self._pilot = Pilot(settings)
        self._mode = Mode.UNKNOWN
        self._told_s = self._expected_s = -math.inf

    @property
    def settings(self) -> MartSettings:
        """The sizes and scales that the controller does not report."""
        return self._pilot.settings

    @settings.setter
    def settings(self, settings: MartSettings) -> None:
        if settings != self._pilot.settings:
            self._pilot.settings = settings

    @property
    def mode(self) -> Mode:
        """The mode of the board.

        The mode becomes nominal when the server has answered the first stop of the connection. It
        stays unknown while the server is lost, or is not a motion controller.
        """
        return self._mode

    @property
    def own_motion(self) -> str:
        """The name of the docking job from its request to its end; empty at other times."""
        return Job.DOCK.value if self._pilot.jobs.job is Job.DOCK else ""

    @property
    def figures(self) -> BoardFigures:
        """The counters and states for diagnostics."""
        pilot = self._pilot
        return BoardFigures(
            rates_hz={},
            faults=pilot.decoder.foreign,
            odom_hz=self.settings.odom_rate_hz,
            own={
                "Motion": pilot.state.value,
                "Motor board": pilot.health.bits,
                "Battery (V)": "unknown"
                if pilot.health.volts is None
                else f"{pilot.health.volts:.2f}",
                "Unmatched replies": str(pilot.conversation.discarded),
                "Job": pilot.jobs.progress(pilot.now_s),
                "Goal": pilot.goal_progress,
                "Motor balance": pilot.motor_balance,
            },
            trouble=pilot.refusal or pilot.imu.trouble,
        )

    @property
    def refusal(self) -> str:
        """Why the driver refuses motion, with a remedy; empty while motion is allowed."""
        return self._pilot.refusal

    # Inbound

    def connect(self) -> None:
        """Begin a new connection."""
        self._pilot.connect()
        self._mode = Mode.UNKNOWN

    def receive(self, data: bytes, now: float, channel: int = 0) -> list[Reading]:
        """Return the readings that follow from a datagram of this channel.

        Once the mode is nominal, a reply that gives no other reading gives ANSWERED.
        """
        if channel == words.COMMAND:
            self._pilot.hear(data, now)
        readings = self._pilot.take()
        if self._pilot.ready:
            self._mode = Mode.NOMINAL
            if not readings and self._pilot.heard_s == now:
                readings.append(ANSWERED)
        return readings

    def silence(self) -> None:
        """Set the mode to unknown and cancel the job: the silent server may have been restarted."""
        self._mode = Mode.UNKNOWN
        self._pilot.jobs.cancel(SILENT)
        self._pilot.fell_silent()

    def flush(self, now: float) -> list[Reading]:
        """End the current job, such as a download, because the port has closed.

        Return all readings that were not taken yet, among them the result of the job.
        """
        self._pilot.jobs.cancel("the port was lost during the request; call again once it is back")
        return self._pilot.take()

    def elapse(self, now: float) -> list[Reading]:
        """Return the readings that are due without a datagram, such as odometry or a job's result.

        While the server is busy, NOTHING_MEASURED comes every ``EXPECTED_EVERY_S``, so that the
        driver does not regard the silent server as lost.
        """
        readings = self._pilot.take()
        pilot = self._pilot
        if self._mode is not Mode.NOMINAL:
            return readings
        period_s = 1.0 / self.settings.odom_rate_hz
        if now >= self._told_s + period_s:
            self._told_s = max(self._told_s + period_s, now - period_s / 2)
            readings.append(pilot.told(now))
        if pilot.busy(now) and now >= self._expected_s + EXPECTED_EVERY_S:
            self._expected_s = now
            readings.append(NOTHING_MEASURED)
        return readings

    def leave(self) -> None:
        """End the current job, because the driver shuts down."""
        self._pilot.jobs.cancel(LEAVING)

    def reset_odometry(self) -> None:
        """Move the origin of the odometry frame to the robot's current pose."""
        self._pilot.odometry.reset()

    # Outbound

    @property
    def wake_at(self) -> float:
        """The time at which ``due`` or ``elapse`` must be called again."""
        if self._pilot.readings or self._pilot.jobs.done:
            return -math.inf
        times = [self._pilot.wake_at]
        if self._mode is Mode.NOMINAL:
            times.append(self._told_s + 1.0 / self.settings.odom_rate_hz)
            if self._pilot.busy(self._expected_s + EXPECTED_EVERY_S):
                times.append(self._expected_s + EXPECTED_EVERY_S)
        return min(times)

    def actuator(self, proof: StopProof) -> Conductor:
        """Return the actuator.

        The actuator passes commands to the ``Pilot``, which records each stop and each start of the
        robot in ``proof``.
        """
        self._pilot.proof = proof
        return Conductor(self._pilot)

    def wake(self) -> Packets:
        """Return the commands that stop the robot at the beginning of a connection.

        The ``Pilot`` repeats these commands until the server answers. It sends other requests only
        after that.
        """
        return self.stop()

    def stop(self) -> Packets:
        """Return the packets with the commands that stop the current motion."""
        said = self._pilot.stop_words
        return tuple((word.channel, word.request().data) for word in said)

    def emergency_stop(self) -> Packets:
        """Return the packets of ``stop``, because the controller has no emergency stop."""
        return self.stop()

    # What only this board has

    def ask(self, job: Job, token: object, now: float, *arguments: object) -> None:
        """Begin a job; a JobDone with this ``token`` reports its result later.

        Raises RequestRefused if another job is in progress, or if ``job`` is the download of a log
        that may not exist.
        """
        self._pilot.jobs.ask(job, token, now, *arguments)

    @property
    def resting(self) -> bool:
        """Whether the server is not busy, and measurements show that the robot is at rest."""
        return self._pilot.state is State.STILL and self._pilot.proof.proved

    @property
    def is_fresh(self) -> bool:
        """Whether the server's heading is known and exactly zero, as before its first RM.

        Otherwise, the server's clock must not be set back, because each RM (forward drive)
        integrates the turn rate over the time since the previous RM.
        """
        return self._pilot.odometry.heading.is_zero
