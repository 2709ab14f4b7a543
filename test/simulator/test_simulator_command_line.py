# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the simulator as a separate program, with toy boards."""

import contextlib
import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import termios
from pathlib import Path

import pytest
import toy_lines
from simulator_program import PATIENCE_S, ROOT, RUN_MODULE, line, say, toy

from omnibot_driver import simulator as simulators
from omnibot_driver.simulator.__main__ import boards, main, run


def test_the_console_helps_and_says_what_it_does_not_know() -> None:
    """A user types ``help`` and an unknown word.

    The help and the error message go to stderr, because stdout is for answers.
    """
    with toy("toy_udp") as process:
        line(process)
        out, err = process.communicate("help\nfly\nquit\n", timeout=PATIENCE_S)
    assert out == ""
    assert "reboot" in err
    assert "no command 'fly'" in err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    """The program's input has ended, but the program continues until it gets a signal.

    After the signal, the program removes its links and ends with exit code 0.
    """
    link = tmp_path / "toy"
    with toy("toy_lines", "--link", str(link), stdin=subprocess.DEVNULL) as process:
        path = line(process)
        assert os.readlink(f"{link}-drive") == path
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert "Traceback" not in err
    assert os.listdir(tmp_path) == []


def test_in_the_background_it_leaves_the_terminal_to_other_programs() -> None:
    """A simulator started with ``&`` does not read the terminal, and ends at SIGTERM.

    The kernel would suspend a background program that reads the terminal.
    """
    user, terminal = os.openpty()
    os.write(user, b"quit\n")
    shell = ["bash", "-c", 'set -m; "$@" & echo $!; wait $!', "bash"]
    path = os.pathsep.join((str(ROOT), str(Path(__file__).parent)))
    with subprocess.Popen(
        [*shell, sys.executable, "-c", RUN_MODULE, "toy_udp"],
        stdin=terminal,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    ) as process:
        number, address = sorted((line(process), line(process)))
        simulator = int(number)
        try:
            assert address.startswith("udp://")
            os.kill(simulator, signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.kill(simulator, signal.SIGKILL)
    for descriptor in (user, terminal):
        os.close(descriptor)


def test_an_unknown_board_gives_one_sentence_and_exit_code_2(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A user names an unknown board. The error message lists the boards that exist."""
    assert main(["--board", "zeppelin", "--wings", "2"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    known = ", ".join(boards())
    assert printed.err == f"simulator: there is no simulated board 'zeppelin': choose {known}\n"


def test_the_boards_are_the_packages_beside_what_they_share() -> None:
    """Each package beside ``common`` is a board. The program needs no list of boards."""
    folder = Path(simulators.__file__).parent
    packages = {path.parent.name for path in folder.glob("*/__init__.py")}
    assert {*boards(), "common"} == packages


def test_a_board_of_two_lines_prints_both_and_says_which_is_which(tmp_path: Path) -> None:
    """With one ``--link`` for a board with two lines, each line gets its own link.

    The program's hint on how to start the driver has the parameter of each port.
    """
    with toy("toy_lines", "--link", str(tmp_path / "toy"), "--angle", "30") as process:
        printed = [line(process), line(process)]
        links = [tmp_path / "toy-drive", tmp_path / "toy-front"]
        assert [os.readlink(link) for link in links] == printed
        say(process, "truth")
        assert json.loads(line(process)).keys() >= {"x_m", "y_m", "yaw_rad", "flipped"}
        _, err = process.communicate("quit\n", timeout=PATIENCE_S)
    assert f"-p board:=toy_lines -p port:={links[0]} -p front_port:={links[1]}\n" in err


def test_the_hint_has_the_whole_path_of_a_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The user gives a relative path for ``--link``. The program's hint contains the full path.

    The hint therefore works in a terminal with another folder.
    """
    monkeypatch.chdir(tmp_path)
    with toy("toy_lines", "--link", "toy") as process:
        line(process), line(process)
        _, err = process.communicate("quit\n", timeout=PATIENCE_S)
    assert f"-p port:={tmp_path}/toy-drive -p front_port:={tmp_path}/toy-front\n" in err


@pytest.mark.slow
def test_a_board_on_the_network_prints_its_address() -> None:
    """A board on the network prints its UDP address, and has options for network faults.

    Serial options such as ``--link`` are missing.
    """
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
    """A link cannot be created. The program prints one line on stderr and ends with code 1.

    The signal handlers are restored.
    """
    taken = tmp_path / "taken"
    taken.write_text("data")
    handler = signal.getsignal(signal.SIGTERM)
    assert run(toy_lines, "toy_lines", ["--link", str(taken), "--link", "/nowhere/toy"]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("simulator: ")
    assert printed.err.count("\n") == 1
    assert signal.getsignal(signal.SIGTERM) is handler
