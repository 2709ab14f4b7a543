# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Runs the user's jobs one at a time, and checks whether they succeed.

Jobs are calibrations, power-off, and saving or loading of the configuration. The boards acknowledge
none of them.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.fejemis.half import Role
from omnibot_driver.core.fejemis.messages import (
    Comment,
    FrontWheelOffset,
    Heartbeat,
    Message,
    Status,
    WheelConfiguration,
)
from omnibot_driver.core.fejemis.readings import Job, JobDone

POWER_ENDS: Final = (
    "~/power_off was called, so the board is about to cut the power; call ~/start to keep the"
    " power on"
)
"""The reason for refusing motion, brush and lift after a requested power-off."""
UNSEEN: Final = ({"0", "3"}, {"1", "2"})
"""Pairs of digits whose ASCII codes add up to 99.

If a line loses both digits of a pair, its checksum still fits.
"""
CALIBRATED_WITHIN_S: Final = 8.0
ANSWERED_WITHIN_S: Final = 4.5
"""``CALIBRATED_WITHIN_S``: longest duration of a calibration in s, from the user's request.
``ANSWERED_WITHIN_S``: longest duration of any other job. After this time, the job has failed."""
CALIBRATION_S: Final = 1.2
"""Duration of a calibration in s. For about a second of it, the board averages its readings."""
AGAIN_S: Final = 0.4
SAID: Final = 3
"""Number of times that the driver sends the command of a job, except a calibration.

For a calibration, ``CALIBRATIONS`` is the largest number.
"""
UNCHANGED_S: Final = 2.4
"""Time limit in s for a change of the offsets after a command to calibrate.

If the offsets are then still unchanged, the command was probably lost.
"""
CALIBRATIONS: Final = 2
"""Largest number of times that one job sends the command to calibrate.

The driver repeats the command only if the offsets stay unchanged.
"""

Lines = dict[Role, list[bytes]]
OFFSETS: Final[Mapping[Job, tuple[bytes, bytes, str]]] = {
    Job.CALIBRATE_GYRO: (b"gyroc", b"gyrooi", "gyroo"),
    Job.CALIBRATE_ACCELEROMETER: (b"acccal2", b"accoi", "acco"),
}
"""For each calibration: the command, the request for the offsets, and the keyword of the line that
reports the offsets."""


def whole_seconds(delay_s: float) -> int:
    """Return the delay of a power-off in whole seconds, at least 1.

    If the checksum would not detect the loss of two digits of the delay, the delay is increased.
    """
    seconds = max(1, round(delay_s))
    while any(pair <= {*str(seconds)} for pair in UNSEEN):
        seconds += 1
    return seconds


class Jobs:
    """Runner of jobs, at most one at a time.

    * ``done``: results of ended jobs, which the caller has to take.
    * ``powering_off``: whether the drive board will soon cut the power.
    * ``reload``: whether to read the configuration again. The caller resets this flag.
    """

    def __init__(self) -> None:
        self.done: list[JobDone] = []
        self.powering_off = False
        self.reload = False
        self._stay_on(0)
        self._clear()

    def _stay_on(self, times: int) -> None:
        self._on_left, self._on_at = times, -math.inf if times else math.inf

    def _clear(self) -> None:
        self.job: Job | None = None
        self._token: object = None
        self._begun_at = self._next_at = self._until = math.inf
        self._said = self._calibrations = 0
        self._before: tuple[float, ...] | None = None
        self._once: tuple[float, ...] | None = None
        self._heard: set[Role] = set()
        self._text = b""

    @property
    def wake_at(self) -> float:
        """Time in s at which to call ``due`` next."""
        return min(self._next_at, self._until, self._on_at)

    @property
    def at_rest(self) -> str:
        """Why the robot must stand still for the running job; empty if it may move."""
        job = self.job
        if job is not None and (job in OFFSETS or job is Job.LOAD):
            return f"{job.value} is under way; wait for its answer"
        return ""

    def ask(
        self, job: Job, token: object, now: float, *, delay_s: float = 0.0, wait_s: float = 0.0
    ) -> None:
        """Begin a job after ``wait_s`` seconds. Raises RequestRefused while another job runs.

        * ``token``: identifies the job in its result.
        * ``delay_s``: time in s until the board cuts the power; only for ``Job.POWER_OFF``.
        """
        if self.job is not None:
            raise RequestRefused(
                f"{self.job.value} is under way; wait for its answer, then call again"
            )
        self.job, self._token = job, token
        self._begun_at = self._next_at = now + wait_s
        self._until = now + (CALIBRATED_WITHIN_S if job in OFFSETS else ANSWERED_WITHIN_S)
        if job is Job.POWER_OFF:
            self._text = b"off %d" % whole_seconds(delay_s)
            self.powering_off = True
            self._stay_on(0)

    def cancel(self, why: str) -> None:
        """End the running job as failed, for the reason ``why``."""
        if self.job is not None:
            self._finish(False, f"{self.job.value} failed: {why}")

    def interrupt(self, why: str) -> None:
        """End the running job as failed if it needs the robot to stand still.

        ``why``: the reason for the failure.
        """
        if self.at_rest:
            self.cancel(why)

    def restarted(self, role: Role) -> None:
        """End the running job as failed, because the board ``role`` has restarted.

        If the front board has restarted, a power-off continues, because it needs only the drive
        board.
        """
        if role == "front" and self.job is Job.POWER_OFF:
            return
        self.cancel(f"the {role} board has restarted; call again")
        if role == "drive":
            self.powering_off = False

    def keep_power(self) -> None:
        """Cancel a requested power-off, because the user has called ~/start."""
        if self.powering_off:
            self._stay_on(SAID)
        if self.job is Job.POWER_OFF:
            self.cancel("~/start has cancelled it; the power stays on")
        self.powering_off = False

    def begin(self) -> None:
        """End the running job as failed, because the connection is new.

        A requested power-off stays in force, because the board may already have received it.
        """
        self.cancel("the port was lost during the request; call again once it is back")

    def due(self, now: float) -> Lines:
        """Return the lines to send now, by board."""
        lines = self._of_job(now)
        if now >= self._on_at:
            self._on_left -= 1
            self._on_at = now + AGAIN_S if self._on_left else math.inf
            lines["drive"] = [b"on", *lines.get("drive", [])]
        return lines

    def _of_job(self, now: float) -> Lines:
        if self.job is None or now < min(self._next_at, self._until):
            return {}
        if now >= self._until:
            self._give_up()
            return {}
        self._next_at = now + AGAIN_S
        self._said += 1
        first = self._said <= SAID
        match self.job:
            case Job.SAVE | Job.LOAD:
                text = b"eew" if self.job is Job.SAVE else b"eer"
                if self.job is Job.LOAD and not first:
                    return {"drive": [b"confi"], "front": [b"fwoi"]}
                return {"drive": [text], "front": [text]} if first else {}
            case Job.POWER_OFF:
                return {"drive": [self._text] if first else []}
            case job:
                begin, ask, _ = OFFSETS[job]
                if self._before is None:
                    return {"drive": [ask]}
                if self._begun_at > now - AGAIN_S:
                    return {"drive": [begin]}
                return {"drive": [ask] if now - self._begun_at > CALIBRATION_S else []}

    def hear(self, role: Role, message: Message, now: float) -> None:
        """Receive a message, and check whether it proves the success of the running job."""
        job = self.job
        if job is None or not self._said:
            return
        if isinstance(message, Heartbeat) and job is not Job.LOAD:
            self._heard.add(role)
            late = now - self._begun_at > SAID * AGAIN_S
            # Saving cannot be checked. The job only waits for a heartbeat of both boards.
            if job is Job.SAVE and late and {"drive", "front"} <= self._heard:
                self._finish(True, "save request sent to both boards; they do not confirm it")
            elif job is Job.POWER_OFF and late and role == "drive":
                self._finish(
                    True,
                    "power-off command sent; the board does not confirm it, but should cut the"
                    f" power {self._text[4:].decode('ascii')} s after this call",
                )
        elif job is Job.LOAD and now - self._begun_at > SAID * AGAIN_S:
            if _answers(role, message):
                self._heard.add(role)
            if {"drive", "front"} <= self._heard:
                self._finish(
                    True,
                    "the saved configuration is loaded; the driver now reads it from the boards",
                )
        elif job in OFFSETS and isinstance(message, Status) and message.keyword == OFFSETS[job][2]:
            self._offsets(job, message.numbers, now)

    def _offsets(self, job: Job, numbers: tuple[float, ...], now: float) -> None:
        # One reading is not enough, because 1 in 99 damaged answers has a correct checksum.
        once, self._once = self._once, numbers
        if numbers != once:
            return
        if self._before is None:
            self._before = numbers
            self._calibrate(now)
            return
        after_s = now - self._begun_at
        if after_s < CALIBRATION_S:
            return
        shown = ", ".join(f"{number:g}" for number in numbers[:3])
        if numbers != self._before:
            self._finish(True, f"{job.value} done; offsets {shown}")
        elif after_s > UNCHANGED_S and self._calibrations < CALIBRATIONS:
            self._calibrate(now)
        elif after_s > UNCHANGED_S:
            self._finish(
                False,
                f"{job.value} failed: the offsets {shown} are unchanged. Either the drive board"
                " did not receive the command, or its firmware does not know it; call again",
            )

    def _calibrate(self, now: float) -> None:
        self._calibrations += 1
        self._begun_at, self._next_at, self._said = now, -math.inf, 0

    def _give_up(self) -> None:
        assert self.job is not None
        which = "both boards" if self.job in (Job.SAVE, Job.LOAD) else "the drive board"
        then = "call again"
        if self.job is Job.POWER_OFF:
            then = (
                "the board may still cut the power. To keep the power on, call ~/start; to cut"
                " it, call ~/power_off again"
            )
        self._finish(False, f"{self.job.value} was not confirmed by {which}; {then}")

    def _finish(self, success: bool, message: str) -> None:
        if self.job is Job.LOAD and self._said:  # the boards may have obeyed even if the job failed
            self.reload = True
        self.done.append(JobDone(self._token, success, message))
        self._clear()


def _answers(role: Role, message: Message) -> bool:
    """Return whether ``message`` answers the query that the driver sends after ``eer``.

    The boards do not answer ``eer`` (load a configuration). A front board that does not know the
    query ``fwoi`` answers "unhandled". This answer is also accepted.
    """
    if role == "drive":
        return isinstance(message, WheelConfiguration)
    if isinstance(message, Comment):
        return "unhandled: 'fwoi'" in message.text
    return isinstance(message, FrontWheelOffset)
