# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulated OmniBot as a separate program."""

import json
import os
import subprocess

from simulator_program import PATIENCE_S, line, say, simulator


def test_the_first_line_is_the_path_and_nothing_else() -> None:
    """The first line on stdout is the path alone, so a script can read and open it.

    The hints for people are on stderr.
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
    """After the console command ``reboot``, a running board is booting, or already paused."""
    with simulator("--running") as process:
        line(process)
        say(process, "reboot\ntruth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] in ("booting", "paused")


def test_the_end_of_the_input_does_not_end_it() -> None:
    """With /dev/null as stdin, the program still runs after the boot of the board."""
    with simulator(stdin=subprocess.DEVNULL) as process:
        port = os.open(line(process), os.O_RDONLY | os.O_NOCTTY)
        try:
            assert os.read(port, 100).startswith(b"Paused: 0 \n")
        finally:
            os.close(port)
        assert process.poll() is None


def test_the_options_reach_the_board() -> None:
    """With ``--running`` and ``--imu-only``, the board starts in IMU-only mode."""
    with simulator("--running", "--imu-only") as process:
        line(process)
        say(process, "truth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] == "imu_only"
