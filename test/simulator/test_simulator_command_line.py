# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The simulator as a program of its own."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

import omnibot_driver
from omnibot_driver import simulator as simulators
from omnibot_driver.simulator.__main__ import boards, main

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


def test_a_board_that_is_not_built_is_one_sentence_and_code_2(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It names the board and those that there are."""
    assert main(["--board", "zeppelin", "--wings", "2"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    known = ", ".join(boards())
    assert printed.err == f"simulator: there is no simulated board 'zeppelin': choose {known}\n"


def test_the_boards_are_the_packages_beside_what_they_share() -> None:
    """Nothing lists them a second time."""
    folder = Path(simulators.__file__).parent
    packages = {path.parent.name for path in folder.glob("*/__init__.py")}
    assert {*boards(), "common"} == packages


@contextmanager
def toy(name: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The simulator of a board that is not in the package."""
    program = (
        "import sys, importlib; from omnibot_driver.simulator.__main__ import run;"
        "name = sys.argv[1]; sys.exit(run(importlib.import_module(name), name, sys.argv[2:]))"
    )
    path = os.pathsep.join((str(ROOT), str(Path(__file__).parent)))
    with subprocess.Popen(
        [sys.executable, "-c", program, name, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_board_of_two_lines_prints_both_and_says_which_is_which(tmp_path: Path) -> None:
    """The link that is given is one for each; the hint has all parameters of the driver."""
    with toy("toy_lines", "--link", str(tmp_path / "toy"), "--angle", "30") as process:
        printed = [line(process), line(process)]
        links = [tmp_path / "toy-drive", tmp_path / "toy-front"]
        assert [os.readlink(link) for link in links] == printed
        say(process, "truth")
        assert json.loads(line(process)).keys() >= {"x_m", "y_m", "yaw_rad", "flipped"}
        _, err = process.communicate("quit\n", timeout=PATIENCE_S)
    assert f"-p board:=toy_lines -p port:={links[0]} -p front_port:={links[1]}\n" in err


def test_a_board_on_the_network_prints_its_address() -> None:
    """It has no --link, and faults of a network."""
    with toy("toy_udp", "--lose", "0.1", "--duplicate", "0.1", "--delay", "0.2") as process:
        address = line(process)
        assert re.fullmatch(r"udp://127\.0\.0\.1:\d+", address)
        _, err = process.communicate("quit\n", timeout=PATIENCE_S)
    assert f"-p board:=toy_udp -p port:={address}\n" in err
    for foreign in ("--link", "--flip"):
        with toy("toy_udp", foreign, "0") as process:
            _, err = process.communicate(timeout=PATIENCE_S)
        assert f"unrecognized arguments: {foreign}" in err
        assert process.returncode == 2


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
