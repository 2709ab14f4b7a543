# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What is asked of the boards besides motion, one job at a time, and what shows that it is done.

No board acknowledges anything. A calibration shows in the offsets that are read back, twice alike,
as one in 99 damaged answers passes its sum. A loaded configuration is one that was read after the
request. That a configuration is saved shows nowhere, so there the boards must have been heard
afterwards without a complaint. Time is an argument.
"""

import math
from collections.abc import Mapping
from typing import Final

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.fejemis.half import Role
from omnibot_driver.core.fejemis.messages import Heartbeat, Message, Status, WheelConfiguration
from omnibot_driver.core.fejemis.readings import Job, JobDone

UNSEEN: Final = ({"0", "3"}, {"1", "2"})
"""Digits whose codes together are 99, so that a sum does not see their loss."""
WITHIN_S: Final = 8.0
CALIBRATION_S: Final = 1.2
"""A calibration averages for about a second."""
AGAIN_S: Final = 0.4
SAID: Final = 3
"""How often a request is sent that may be repeated."""
UNCHANGED_S: Final = 4.0
"""Offsets that have not changed by then were right before."""

Lines = dict[Role, list[bytes]]
OFFSETS: Final[Mapping[Job, tuple[bytes, bytes, str]]] = {
    Job.CALIBRATE_GYRO: (b"gyroc", b"gyrooi", "gyroo"),
    Job.CALIBRATE_ACCELEROMETER: (b"acccal2", b"accoi", "acco"),
}
"""What begins it, what asks for the result, and the keyword of the answer."""


def whole_seconds(delay_s: float) -> int:
    """The next number of seconds that cannot lose two digits unseen (`numerals.py`)."""
    seconds = max(1, round(delay_s))
    while any(pair <= {*str(seconds)} for pair in UNSEEN):
        seconds += 1
    return seconds


class Jobs:
    """``done``: what came of them, to be taken. ``powering_off``: power ends soon.

    ``reload``: the configuration was loaded, and is to be read again; to be taken.
    """

    def __init__(self) -> None:
        self.done: list[JobDone] = []
        self.powering_off = False
        self.reload = False
        self._clear()

    def _clear(self) -> None:
        self.job: Job | None = None
        self._token: object = None
        self._begun_at = self._next_at = self._until = math.inf
        self._said = 0
        self._before: tuple[float, ...] | None = None
        self._once: tuple[float, ...] | None = None
        self._heard: set[Role] = set()
        self._text = b""

    @property
    def wake_at(self) -> float:
        """When ``due`` has something."""
        return min(self._next_at, self._until)

    @property
    def at_rest(self) -> str:
        """Why the robot has to stand now, in words; empty if it need not."""
        job = self.job
        if job is not None and (job in OFFSETS or job is Job.LOAD):
            return f"a {job.value} is under way; wait for its answer"
        return ""

    def ask(
        self, job: Job, token: object, now: float, *, delay_s: float = 0.0, wait_s: float = 0.0
    ) -> None:
        """Begin, in ``wait_s``. Raises RequestRefused."""
        if self.job is not None:
            raise RequestRefused(f"a {self.job.value} is under way; wait for its answer")
        self.job, self._token = job, token
        self._begun_at = self._next_at = now + wait_s
        self._until = self._begun_at + WITHIN_S
        if job is Job.POWER_OFF:
            self._text = b"off %d" % whole_seconds(delay_s)
            self.powering_off = True

    def cancel(self, why: str) -> None:
        """Something else has ended it."""
        if self.job is not None:
            self._finish(False, f"{self.job.value} failed: {why}")

    def interrupt(self, why: str) -> None:
        """The robot was stopped: what needs it at rest for a while has failed."""
        if self.at_rest:
            self.cancel(why)

    def drive_restarted(self) -> None:
        """The board that would cut the power has forgotten it."""
        self.powering_off = False

    def keep_power(self) -> list[bytes]:
        """What calls a power off back; nothing where none is due."""
        lines = [b"on"] if self.powering_off else []
        if self.job is Job.POWER_OFF:
            self.cancel("it was called back")
        self.powering_off = False
        return lines

    def begin(self) -> None:
        """The line is new."""
        self.powering_off = False
        self.cancel("the port was lost meanwhile; call again")

    def due(self, now: float) -> Lines:
        """Lines to write now, to each board."""
        if self.job is None or now < self.wake_at:
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
                more = [b"confi"] if self.job is Job.LOAD and not first else []
                told = [text] if first else []
                return {"drive": [*told, *more], "front": told}
            case Job.POWER_OFF:
                return {"drive": [self._text] if first else []}
            case job:
                begin, ask, _ = OFFSETS[job]
                if self._before is None:
                    return {"drive": [ask]}
                if self._said <= SAID and self._begun_at > now - AGAIN_S:
                    return {"drive": [begin]}
                return {"drive": [ask] if now - self._begun_at > CALIBRATION_S else []}

    def hear(self, role: Role, message: Message, now: float) -> None:
        """What may show that it is done."""
        job = self.job
        if job is None or not self._said:
            return
        if isinstance(message, Heartbeat):
            self._heard.add(role)
            late = now - self._begun_at > SAID * AGAIN_S
            if job is Job.SAVE and late and {"drive", "front"} <= self._heard:
                self._finish(True, "saved on both boards, which do not confirm it")
            elif job is Job.POWER_OFF and late and role == "drive":
                self._finish(True, f"power ends {self._text[4:].decode('ascii')} s after the call")
        elif job is Job.LOAD and isinstance(message, WheelConfiguration):
            if now - self._begun_at > SAID * AGAIN_S:
                self.reload = True
                self._finish(True, "the saved configuration is loaded and read again")
        elif job in OFFSETS and isinstance(message, Status) and message.keyword == OFFSETS[job][2]:
            self._offsets(job, message.numbers, now)

    def _offsets(self, job: Job, numbers: tuple[float, ...], now: float) -> None:
        once, self._once = self._once, numbers
        if numbers != once:
            return
        if self._before is None:
            self._before, self._begun_at, self._said = numbers, now, 0
            self._next_at = -math.inf
            return
        after_s = now - self._begun_at
        if after_s < CALIBRATION_S:
            return
        shown = ", ".join(f"{number:g}" for number in numbers[:3])
        if numbers != self._before:
            self._finish(True, f"{job.value} done; offsets {shown}")
        elif after_s > UNCHANGED_S:
            self._finish(True, f"{job.value} done; the offsets are what they were: {shown}")

    def _give_up(self) -> None:
        assert self.job is not None
        which = "both boards" if self.job in (Job.SAVE, Job.LOAD) else "the drive board"
        self.powering_off = False
        self._finish(False, f"{self.job.value} was not confirmed by {which}; call again")

    def _finish(self, success: bool, message: str) -> None:
        self.done.append(JobDone(self._token, success, message))
        self._clear()
