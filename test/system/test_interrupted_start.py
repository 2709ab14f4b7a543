# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of ctrl-C while a program still loads its libraries, which takes about half a second."""

import subprocess
import sys

import pytest

INTERRUPTED_AT = """
import os, runpy, signal, sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {library!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, CtrlC())
sys.argv[0] = {module!r}
runpy.run_module({module!r}, run_name="__main__")
"""


@pytest.mark.parametrize(
    ("module", "arguments", "library", "exit_code", "said"),
    [
        ("omnibot_driver.driver", ["--ros-args", "-p", "port:=sim://"], "rclpy", 0, ""),
        ("omnibot_driver.driver", ["--ros-args", "-p", "port:=sim://"], "std_srvs", 0, ""),
        ("omnibot_driver.tools.calibrate", ["imu"], "scipy", 130, "\ncalibrate: interrupted: "),
    ],
)
def test_it_ends_as_it_does_later(
    module: str, arguments: list[str], library: str, exit_code: int, said: str
) -> None:
    """The user presses ctrl-C during the imports. The exit code is the same as after the imports.

    No traceback is printed.
    """
    program = INTERRUPTED_AT.format(module=module, library=library)
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (exit_code, "")
    assert done.stderr.partition("the robot")[0] == said
