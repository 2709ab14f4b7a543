# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The user's requests, except motion: brush, lift, LED strip, and jobs such as a calibration.

The module decides when each request is allowed.
"""

from typing import Final, Protocol

from omnibot_driver.core.board import Mode
from omnibot_driver.core.errors import CommandRefused, RequestRefused
from omnibot_driver.core.fejemis.jobs import POWER_ENDS
from omnibot_driver.core.fejemis.obedience import Obedience
from omnibot_driver.core.fejemis.odometry import PoseOdometry
from omnibot_driver.core.fejemis.readings import Job
from omnibot_driver.core.fejemis.settings import FejemisSettings, Written
from omnibot_driver.core.fejemis.told import Told
from omnibot_driver.core.fejemis.upkeep import Upkeep
from omnibot_driver.core.fejemis.watch import NO_DATA

STOPS_WITHIN_S: Final = 0.5
"""Time in s from Stop to the loading of a configuration. A moving robot stops in this time."""


class Robot(Protocol):
    """What the services need from the robot."""

    @property
    def mode(self) -> Mode:
        """The mode: nominal while both boards send data and the drive board obeys."""

    @property
    def refusal(self) -> str:
        """The reason why the robot must not be driven; empty if driving is allowed."""

    @property
    def driving(self) -> bool:
        """Whether a motion is commanded."""

    @property
    def settings(self) -> FejemisSettings:
        """The user's settings, such as the delay of a power-off."""


class Services:
    """The user's requests, with one method for each."""

    def __init__(
        self, robot: Robot, upkeep: Upkeep, obedience: Obedience, odometry: PoseOdometry, told: Told
    ) -> None:
        self._robot, self._upkeep, self._obedience = robot, upkeep, obedience
        self._odometry, self._told = odometry, told

    def set_brush(self, on: bool, now: float) -> None:
        """Switch the brush on or off. Raises RequestRefused if the brush must not run now."""
        if on and (reason := self._why_not_turn()):
            raise RequestRefused(f"brush refused: {reason}")
        self._upkeep.machine.set_brush(on)

    def lift(self, volts: float, now: float) -> None:
        """Move the lift, which can raise the front wheel, for at most ``command_timeout_s``.

        Positive volts raise the front wheel. Raises CommandRefused for NaN or infinity, or if the
        lift must not run now.
        """
        if volts and (reason := self._why_not_turn()):
            raise CommandRefused(f"lift_cmd refused: {reason}")
        self._upkeep.machine.lift(volts, now, self._robot.settings.command_timeout_s)

    def set_led(self, red: int, green: int, blue: int, now: float) -> None:
        """Set the colour of the LED strip. Each part is limited to 0..255."""
        red, green, blue = (max(0, min(255, part)) for part in (red, green, blue))
        self._upkeep.machine.set_colour(red, green, blue, now)

    def ask(self, job: Job, token: object, now: float) -> None:
        """Begin a job, whose result follows as a JobDone.

        Raises RequestRefused if the job is not allowed now.
        """
        robot, moving = self._robot, self._odometry.moving
        if robot.mode is Mode.UNKNOWN:
            reason = robot.refusal or NO_DATA
            raise RequestRefused(f"{job.value} refused: {reason}")
        if robot.driving and job is not Job.LOAD:
            raise RequestRefused(
                f"{job.value} refused: the robot is commanded by cmd_vel; end these commands, then"
                " call again"
            )
        if moving and job is not Job.LOAD:
            raise RequestRefused(
                f"{job.value} refused: the robot moves; wait until it stands still, then call again"
            )
        written = robot.settings.written
        if job is Job.CALIBRATE_ACCELEROMETER and Written.ACCELEROMETER in written:
            raise RequestRefused(
                f"{job.value} refused: the parameter accel_calibration sets the offsets; remove"
                " it, start the driver again, then call again"
            )
        moves = robot.driving or moving
        self._upkeep.jobs.ask(
            job,
            token,
            now,
            delay_s=robot.settings.power_off_delay_s,
            wait_s=STOPS_WITHIN_S if moves else 0.0,
        )
        if moves:
            self._told.halt("the configuration is being loaded; robot stopped", now)
        if job in (Job.LOAD, Job.POWER_OFF):
            self._upkeep.machine.off()

    def _why_not_turn(self) -> str:
        if self._upkeep.jobs.powering_off:
            return POWER_ENDS
        if self._obedience.estopped:
            return "the e-stop is latched; release it with the service ~/estop (data: false)"
        if self._robot.mode is Mode.PAUSED:
            return "the robot is paused; call ~/start first"
        if self._robot.mode is Mode.UNKNOWN:
            return self._robot.refusal or NO_DATA
        return ""
