# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Long tasks of a board, such as a recording: one at a time.

A task fails at its time limit, when the robot is stopped, and when the board is lost. This module
knows time limits and the texts of answers; it does not know what a task does.
"""

import math

from omnibot_driver.core.errors import RequestRefused
from omnibot_driver.core.requests import RequestDone


class LongTask:
    """The task in progress, if any.

    * ``answers``: answers that the session has not taken yet.
    * ``wake_at``: time of the next ``tick``, in s; infinity without a task.
    """

    def __init__(self) -> None:
        self.answers: list[RequestDone] = []
        self._name = ""
        self._token: object = None
        self._begun_at = self.wake_at = math.inf
        self._driven = False

    @property
    def active(self) -> bool:
        """Whether a task is in progress."""
        return self.wake_at < math.inf

    def begin(self, name: str, token: object, limit_s: float, now: float) -> None:
        """Begin a task that fails after ``limit_s``. Raises RequestRefused during another task.

        ``name``: the noun in messages, e.g. "recording".

        ``token``: an object that belongs to this task only. The task's answer contains it.
        """
        if self.active:
            raise RequestRefused(
                f"a {self._name} is under way; wait for its answer, then call again"
            )
        self._name, self._token, self._driven = name, token, False
        self._begun_at, self.wake_at = now, now + limit_s

    def is_current(self, token: object) -> bool:
        """Return whether the task with this token is in progress."""
        return self.active and self._token is token

    def end(self, token: object, success: bool, message: str) -> None:
        """End the task as done or failed. This has no effect if the task has already ended."""
        if self.is_current(token):
            self.answers.append(RequestDone(token, success, message))
            self._token, self._begun_at, self.wake_at = None, math.inf, math.inf

    def give_up(self, reason: str) -> None:
        """Fail the task with a reason. This has no effect without a task."""
        if self.active:
            self.end(self._token, False, f"the {self._name} failed: {reason}")

    def watch(self, *, driven: bool) -> None:
        """Fail the task if the robot was driven at the last call of this method, but is not now.

        ``driven``: whether a command drives the robot now.
        """
        if self._driven and not driven:
            self.give_up("the robot was stopped during the request; call again")
        self._driven = driven

    def tick(self, now: float) -> None:
        """Fail the task if its time limit has passed."""
        if now >= self.wake_at:
            limit_s = self.wake_at - self._begun_at
            self.give_up(f"the board did not complete it within {limit_s:g} s; call again")

    def progress(self, now: float) -> str:
        """Return the task's name, elapsed time and limit as text; empty without a task."""
        if not self.active:
            return ""
        limit_s = self.wake_at - self._begun_at
        return f"{self._name}: {now - self._begun_at:.0f} s of at most {limit_s:.0f} s"
