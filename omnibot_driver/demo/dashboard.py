# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Runs the tool ``monitor`` on the demo's terminal, if possible.

The module knows processes; it does not know ROS.
"""

import subprocess
import sys
from importlib.util import find_spec

from omnibot_driver.demo.program import end_with_parent
from omnibot_driver.tools.monitor.screen import has_screen


class Dashboard:
    """The tool ``monitor`` on this terminal, until the user quits it or ``close`` is called.

    ``possible``: whether the terminal and the installed libraries allow the monitor.
    """

    def __init__(self, namespace: str) -> None:
        self.possible = has_screen() and find_spec("textual") is not None
        self._process: subprocess.Popen[bytes] | None = None
        if self.possible:
            monitor = [sys.executable, "-m", "omnibot_driver.tools.monitor", "--timeout", "inf"]
            self._process = subprocess.Popen(
                [*monitor, "--namespace", namespace], preexec_fn=end_with_parent
            )

    @property
    def quitted(self) -> bool:
        """Whether the monitor was started and has ended."""
        return self._process is not None and self._process.poll() is not None

    def close(self) -> None:
        """End the monitor, so that the demo can use the terminal again."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
