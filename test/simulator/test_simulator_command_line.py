# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulator as a program of its own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

import omnibot_driver
from omnibot_driver.simulator.__main__ import main

PATIENCE_S = 30.0
ROOT = Path(omnibot_driver.__file__).parents[1]


@contextmanager
def simulator(
    *arguments: str, stdin: int | IO[str] = subprocess.PIPE
) -> Iterator[subprocess.Popen[str]]:
    """A running simulator; killed if the test leaves it running."""
    with subprocess.Popen(
        [sys.executable, "-m", "omnibot_driver.simulator", *arguments],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def line(process: subprocess.Popen[str]) -> str:
    """The next line that the simulator prints."""
    assert process.stdout is not None
    return process.stdout.readline().rstrip("\n")


def say(process: subprocess.Popen[str], text: str) -> None:
    """Type a line into the console."""
    assert process.stdin is not None
    process.stdin.write(text + "\n")
    process.stdin.flush()


def test_the_first_line_is_the_path_and_nothing_else() -> None:
    """A script can open what it reads; the hints for people name it on stderr."""
    with simulator() as process:
        path = line(process)
        os.close(os.open(path, os.O_RDWR | os.O_NOCTTY))
        say(process, "quit")
        out, err = process.communicate(timeout=PATIENCE_S)
    assert out == ""
    assert f"port:={path}" in err
    assert process.returncode == 0


def test_the_console_tells_the_truth() -> None:
    """`truth` answers with one line of JSON that holds pose and mode."""
    with simulator("--running") as process:
        line(process)
        say(process, "truth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] == "nominal"
    assert {truth[key] for key in ("x_m", "y_m", "yaw_rad", "vx_mps", "vy_mps")} == {0.0}


def test_the_console_reboots_the_board() -> None:
    """After `reboot` a running board boots."""
    with simulator("--running") as process:
        line(process)
        say(process, "reboot\ntruth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] in ("booting", "paused")


def test_the_console_helps_and_says_what_it_does_not_know() -> None:
    """Both go to stderr, so that stdout keeps to its answers."""
    with simulator() as process:
        line(process)
        out, err = process.communicate("help\nfly\nquit\n", timeout=PATIENCE_S)
    assert out == ""
    assert "reboot" in err
    assert "no command 'fly'" in err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    """Exit code 0, no traceback, and the link is gone; a closed stdin had not ended it before."""
    link = tmp_path / "omnibot"
    with simulator("--link", str(link), stdin=subprocess.DEVNULL) as process:
        path = line(process)
        assert os.readlink(link) == path
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert "Traceback" not in err
    assert not link.is_symlink()


def test_the_end_of_the_input_does_not_end_it() -> None:
    """With /dev/null for stdin the board goes on through its boot and beyond."""
    with simulator(stdin=subprocess.DEVNULL) as process:
        port = os.open(line(process), os.O_RDONLY | os.O_NOCTTY)
        try:
            assert os.read(port, 100).startswith(b"Paused: 0 \n")
        finally:
            os.close(port)
        assert process.poll() is None


def test_the_options_reach_the_board() -> None:
    """An IMU-only board with a running start says so."""
    with simulator("--running", "--imu-only") as process:
        line(process)
        say(process, "truth")
        truth = json.loads(line(process))
        say(process, "quit")
        process.communicate(timeout=PATIENCE_S)
    assert truth["mode"] == "imu_only"


def test_a_link_that_cannot_be_made_is_one_sentence_and_code_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No traceback for a mistake in the arguments."""
    taken = tmp_path / "taken"
    taken.write_text("data")
    handler = signal.getsignal(signal.SIGTERM)
    assert main(["--link", str(taken)]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("simulator: ")
    assert printed.err.count("\n") == 1
    assert signal.getsignal(signal.SIGTERM) is handler
