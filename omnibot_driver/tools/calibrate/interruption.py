# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The reaction to Ctrl-C, to a lost SSH session and to kill.

A signal interrupts a question to the user at once. Otherwise, the next call of
``Interruption.check`` raises Interrupted.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Self

from omnibot_driver.tools.needs import ToolError

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(ToolError):
    """The user has interrupted the program."""


class Interruption:
    """A context manager that handles SIGINT, SIGTERM and SIGHUP.

    Outside the main thread it does nothing.

    ``outcome``: words about the result, for the message of an interruption.
    """

    def __init__(self) -> None:
        self.outcome = "nothing was written"
        self._requested = self._asking = self._deferred = False

    def __enter__(self) -> Self:
        self._before = {}
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._heard) for number in SIGNALS}
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raise Interrupted if a signal was received, except in a ``deferred`` context."""
        if self._requested and not self._deferred:
            raise Interrupted(f"interrupted: the robot is stopped, and {self.outcome}")

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """A context in which ``check`` does not raise.

        If a signal was received in the context, ``check`` raises after the context.
        """
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False

    def reading(self, read: Callable[[str], str]) -> Callable[[str], str]:
        """Return a function that calls ``read``. A signal interrupts the call at once."""

        def ask(question: str) -> str:
            self.check()
            self._asking = True
            try:
                return read(question)
            finally:
                self._asking = False

        return ask

    def _heard(self, _number: int, _frame: FrameType | None) -> None:
        # An exception inside ROS could leave the executor in an undefined state.
        self._requested = True
        if self._asking:
            self.check()
