# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulated OmniBot as a separate program."""

import json
import os
import subprocess

import pytest
from simulator_program import PATIENCE_S, line, say, simulator


def test_the_first_line_is_the_path_and_nothing_else() -> None:
    """The first line on stdout is only the path of the port, for scripts.

    Hints for people are on stderr.
    """
    with simulator() as process:
        path = line(process)
        os.close(os.open(path, os.O_RDWR | os.O_NOCTTY))
        say(process, "quit")
        out, err = process.communicate(timeout=PATIENCE_S)
    assert out == ""
    assert f"port:={path}" in err
    assert process.returncode == 0


def test_the_console_tells_the_truth() -> None:
    """The console command ``truth`` prints one line of JSON with the true pose and the mode."""
    with simulator("--running") as process:
        line(process)
        say(process, "truth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] == "nominal"
    assert {truth[key] for key in ("x_m", "y_m", "yaw_rad", "vx_mps", "vy_mps")} == {0.0}


def test_the_console_reboots_the_board() -> None:
    """A user types ``reboot`` on the console. The running board boots, and is then paused."""
    with simulator("--running") as process:
        line(process)
        say(process, "reboot\ntruth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] in ("booting", "paused")


@pytest.mark.slow
def test_the_end_of_the_input_does_not_end_it() -> None:
    """The program runs with /dev/null as its input.

    The end of the input does not end the program.
    """
    with simulator(stdin=subprocess.DEVNULL) as process:
        port = os.open(line(process), os.O_RDONLY | os.O_NOCTTY)
        try:
            assert os.read(port, 100).startswith(b"Paused: 0 \n")
        finally:
            os.close(port)
        assert process.poll() is None


def test_the_options_reach_the_board() -> None:
    """A user starts the program with ``--running`` and ``--imu-only``.

    The board is in IMU-only mode.
    """
    with simulator("--running", "--imu-only") as process:
        line(process)
        say(process, "truth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] == "imu_only"
