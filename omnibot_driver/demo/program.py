# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Runs a module of this package as a process. This code must not know what the process does."""

import ctypes
import os
import select
import signal
import subprocess
import sys
import tempfile
from typing import Final

PATIENCE_S: Final = 15.0


class DemoFailed(Exception):
    """The demo cannot continue. The message says why."""


class Program:
    """A module of this package that the demo runs as a child process.

    Ctrl-C does not end the child process: ``end`` does, or the kernel when the demo ends.
    """

    def __init__(self, name: str, *arguments: str, console: bool = False) -> None:
        self._name = name
        self._heard = b""
        self._log = tempfile.TemporaryFile("a+")  # noqa: SIM115, it lives as long as this object
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"omnibot_driver.{name}", *arguments],
            stdin=subprocess.PIPE if console else subprocess.DEVNULL,
            stdout=subprocess.PIPE if console else self._log,
            stderr=self._log,
            start_new_session=True,
            preexec_fn=end_with_parent,
        )

    def end(self) -> None:
        """End the process, by force if necessary."""
        self._process.terminate()
        try:
            self._process.wait(3.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def failure(self, what: str) -> DemoFailed:
        """Return an exception. Its message contains ``what`` and the last output of the process."""
        self._log.seek(0)
        lines = self._log.read().splitlines()[-10:] or ["(nothing)"]
        return DemoFailed("\n  ".join([f"{what}. Last output of the {self._name}:", *lines]))

    def check(self) -> None:
        """Raise DemoFailed if the process has ended."""
        if (code := self._process.poll()) is not None:
            raise self.failure(f"the {self._name} ended with code {code}")

    def ask(self, question: str = "") -> str:
        """Send ``question`` to the process; return the next line that the process prints.

        Raises DemoFailed if the process has ended or prints no line in time, and ValueError if it
        was started without ``console``.
        """
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise ValueError(f"the {self._name} has no console")
        self.check()
        stdin.write(question.encode())
        stdin.flush()
        while b"\n" not in self._heard:
            readable, _, _ = select.select([stdout], [], [], PATIENCE_S)
            if not readable or not (data := os.read(stdout.fileno(), 4096)):
                raise self.failure(f"the {self._name} does not answer")
            self._heard += data
        answer, _, self._heard = self._heard.partition(b"\n")
        return answer.decode().strip()


def end_with_parent() -> None:
    """Make the kernel end this new process when its parent ends."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGTERM)
