# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The driver as a separate process, with its output and its exit code."""

import contextlib
import itertools
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self

from driver_nursery import Nursery

PATIENCE_S = 120.0
"""How long a test waits for an event before the test fails, in s.

The limit is long, because no test checks how soon an event comes.
"""

if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    # Under nohup, children would inherit that SIGHUP is ignored; a handler is not inherited.
    signal.signal(signal.SIGHUP, lambda *_: None)

_namespaces = (f"robot{os.getpid()}_{number}" for number in itertools.count())
"""Namespaces that no other driver uses, not even in another test run in the same ROS domain."""
_nursery = Nursery()


class Driver:
    """The driver as a separate process, by default in a namespace that no other driver uses.

    ``before``: Python code that runs before the driver, in its process.

    ``interpreter``: whether to run a new interpreter, with exit handlers, instead of a fork.

    ``more``: further ROS arguments.
    """

    def __init__(
        self,
        *,
        port: str | None,
        before: str = "",
        interpreter: bool = False,
        namespace: str = "",
        more: Sequence[str] = (),
        **parameters: object,
    ) -> None:
        self.namespace = namespace or next(_namespaces)
        arguments = ["--ros-args", "-r", f"__ns:=/{self.namespace}", *more]
        given = parameters if port is None else {"port": port, **parameters}
        for name, value in given.items():
            arguments += ["-p", f"{name}:={value}"]
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "RCUTILS_LOGGING_USE_STDOUT": "1"}
        self.process: Any
        if interpreter:
            main = "import sys, omnibot_driver.driver as driver; sys.exit(driver.main())"
            self.process = subprocess.Popen(
                [sys.executable, "-c", f"{before}\n{main}", *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env=environment,
            )
        else:
            self.process = _nursery.start(arguments, environment, before)
        self.lines: list[str] = []
        self.answers: dict[str, Callable[[], None]] = {}
        """For each text, a function that is called for every line of output with this text."""
        self._said = threading.Condition()
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()
            self._listener.join()
            assert self.process.stdout is not None
            self.process.stdout.close()
            if "PYTEST_CURRENT_TEST" in os.environ:
                print(self.output)  # pytest shows it if the test has failed

    @property
    def output(self) -> str:
        return "".join(self.lines)

    def wait_for_line(self, pattern: str, since: int = 0) -> str:
        """Wait until a line of output matches the pattern, and return the line.

        The search begins at the line with the index ``since``.
        """

        def find() -> str | None:
            return next((line for line in self.lines[since:] if re.search(pattern, line)), None)

        with self._said:
            if not self._said.wait_for(lambda: find() or self._ended(), PATIENCE_S):
                raise AssertionError(f"no line matches {pattern!r} in:\n{self.output}")
            line = find()
        assert line is not None, f"the driver ended without {pattern!r}:\n{self.output}"
        return line

    def end(self, *signals: signal.Signals) -> int:
        """Send the signals in order, and return the driver's exit code.

        Afterwards, ``lines`` contains the complete output of the driver.
        """
        for number in signals:
            self.process.send_signal(number)
        self._listener.join(PATIENCE_S)
        return self.process.wait(PATIENCE_S)

    def guards(self) -> list[int]:
        """Return the process ids of the driver's guards, which are its child processes."""
        found = []
        for directory in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                parent = int((directory / "stat").read_text().rpartition(")")[2].split()[1])
                ours = parent == self.process.pid
                if ours and b"guard.py" in (directory / "cmdline").read_bytes():
                    found.append(int(directory.name))
        return found

    def _ended(self) -> bool:
        return not self._listener.is_alive()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._said:
                self.lines.append(line)
                self._said.notify_all()
            for answer in [answer for text, answer in self.answers.items() if text in line]:
                answer()
        with self._said:
            self._said.notify_all()
