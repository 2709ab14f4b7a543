# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""What a board is asked for and takes long to do, such as a record: one at a time.

It ends when the board or its task says so, with a failure when its time is over, and at once when
the robot is stopped, the e-stop is latched, or the board is lost. Knows times and sentences, not
what is done.
"""

import math

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.requests import RequestDone


class LongTask:
    """``answers``: those that were not taken yet; ``wake_at``: when ``tick`` has something to do,
    infinity while none is under way.
    """

    def __init__(self) -> None:
        self.answers: list[RequestDone] = []
        self._name = ""
        self._token: object = None
        self._begun_at = self.wake_at = math.inf
        self._driven = False

    @property
    def active(self) -> bool:
        """Whether a task is running."""
        return self.wake_at < math.inf

    def begin(self, name: str, token: object, limit_s: float, now: float) -> None:
        """Begin a task.

        ``name`` reads well after "a". Raises RequestRefused while another one runs.
        """
        if self.active:
            raise RequestRefused(
                f"a {self._name} is under way; wait for its answer, then call again"
            )
        self._name, self._token, self._driven = name, token, False
        self._begun_at, self.wake_at = now, now + limit_s

    def is_current(self, token: object) -> bool:
        """Whether the task with this token is running."""
        return self.active and self._token is token

    def end(self, token: object, success: bool, message: str) -> None:
        """End the task as done or failed. No effect if it has ended before."""
        if self.is_current(token):
            self.answers.append(RequestDone(token, success, message))
            self._token, self._begun_at, self.wake_at = None, math.inf, math.inf

    def give_up(self, reason: str) -> None:
        """Fail the task with a reason. No effect without a task."""
        if self.active:
            self.end(self._token, False, f"the {self._name} failed: {reason}")

    def watch(self, *, driven: bool) -> None:
        """Note whether the robot is commanded to move now: a stop ends the task."""
        if self._driven and not driven:
            self.give_up("the robot was stopped meanwhile; call again")
        self._driven = driven

    def tick(self, now: float) -> None:
        """Time passed."""
        if now >= self.wake_at:
            limit_s = self.wake_at - self._begun_at
            self.give_up(f"the board did not complete it within {limit_s:g} s")

    def progress(self, now: float) -> str:
        """The name of the running task, and its start; empty without one."""
        if not self.active:
            return ""
        limit_s = self.wake_at - self._begun_at
        return f"{self._name}: {now - self._begun_at:.0f} s of at most {limit_s:.0f} s"
