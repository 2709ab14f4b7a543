# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the udev rules, the systemd unit and the container: well formed, and as documented."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from omnibot_driver import guard

ROOT = Path(__file__).parents[2]
RULES = ROOT / "udev/99-omnibot.rules"
UNIT = ROOT / "systemd/omnibot-driver.service"
OUTLIVE = ROOT / "docker/outlive"

TOKEN = re.compile(r'([A-Z]+(?:\{[\w/]+\})?)(==|!=|\+=|:=|=)"([^"]*)"')
MATCHES = {"ACTION", "SUBSYSTEM", "DRIVER", "ATTRS{idVendor}", "ATTRS{idProduct}"}
ASSIGNMENTS = {"SYMLINK", "GROUP", "MODE", "ATTR{latency_timer}"}


def rules(lines: list[str]) -> list[dict[str, tuple[str, str]]]:
    """Parse each udev rule into its keys, with their operators and values.

    Fail if a line does not have the form of a rule.
    """
    parsed = []
    for line in lines:
        tokens = [TOKEN.fullmatch(token) for token in line.split(", ")]
        assert all(tokens), line
        parsed.append({token[1]: (token[2], token[3]) for token in tokens if token})
    return parsed


LINES = RULES.read_text().splitlines()
ACTIVE = rules([line for line in LINES if line and not line.startswith("#")])
OFFERED = rules([line.lstrip("#") for line in LINES if line.lstrip("#").startswith("SUBSYSTEM")])


def test_every_rule_matches_before_it_assigns() -> None:
    """In each udev rule, all keys are known, and each key has the operator that belongs to it."""
    for rule in ACTIVE + OFFERED:
        for key, (operator, _) in rule.items():
            assert key in MATCHES | ASSIGNMENTS
            assert operator == ("==" if key in MATCHES else "+=" if key == "SYMLINK" else "=")


def test_each_adapter_gets_the_same_name_and_rights() -> None:
    """The udev rules of all four adapters set the same name, /dev/omnibot, and the same rights.

    The test also reads the rules that are commented out in the file.
    """
    assert len(OFFERED) == 4
    for rule in OFFERED:
        assert rule["SUBSYSTEM"] == ("==", "tty")
        assert {key: rule[key][1] for key in ("SYMLINK", "GROUP", "MODE")} == {
            "SYMLINK": "omnibot",
            "GROUP": "dialout",
            "MODE": "0660",
        }


def test_only_one_adapter_is_taken_for_the_board() -> None:
    """Only one rule that is not commented out makes the link /dev/omnibot.

    A second active rule might give this name to a lidar.
    """
    assert len([rule for rule in ACTIVE if "SYMLINK" in rule]) == 1


def test_an_ftdi_adapter_does_not_hold_bytes_back() -> None:
    """A udev rule sets the latency timer of an FTDI adapter to 1 ms instead of 16 ms.

    The rule applies when the kernel binds its FTDI driver to the adapter.
    """
    (timer,) = [rule for rule in ACTIVE if "ATTR{latency_timer}" in rule]
    assert timer["DRIVER"] == ("==", "ftdi_sio")
    assert "bind" in timer["ACTION"][1].split("|")
    assert timer["ATTR{latency_timer}"] == ("=", "1")


def unit_settings() -> dict[str, list[str]]:
    """Return the values of each key in the systemd unit. Continued lines are joined."""
    settings: dict[str, list[str]] = {}
    for line in UNIT.read_text().replace("\\\n", " ").splitlines():
        key, assigned, value = line.partition("=")
        if assigned and not line.startswith("#"):
            settings.setdefault(key, []).append(value)
    return settings


def test_the_unit_starts_the_installed_driver_and_no_shell_stays_between() -> None:
    """The systemd unit starts the driver by ``exec``, so signals reach the driver itself.

    The command names no port: the names of port parameters depend on the board.
    """
    (command,) = unit_settings()["ExecStart"]
    assert ". /opt/ros/jazzy/setup.bash && " in command
    assert re.search(r'&& +exec "\S+/lib/omnibot_driver/driver" +--ros-args ', command)
    assert command.endswith(' --params-file "$OMNIBOT_PARAMETERS"\'')


def test_the_unit_stops_the_driver_by_ctrl_c_and_lets_its_guard_finish() -> None:
    """systemd ends the driver by SIGINT, as ctrl-C does.

    After a crash of the driver, systemd sends SIGINT to the guard process, which ignores it and can
    still stop the robot.
    """
    settings = unit_settings()
    assert settings["KillSignal"] == ["SIGINT"]
    assert settings["KillMode"] == ["control-group"]
    assert settings["Restart"] == ["on-failure"]
    assert settings["RestartPreventExitStatus"] == ["2"]


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")
def test_systemd_accepts_the_unit() -> None:
    """systemd-analyze accepts each key and value in the systemd unit."""
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(UNIT)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_first_process_of_a_container_outlives_the_guard() -> None:
    """After a crash of the driver, the container's first process lives longer than the guard.

    If the process ended earlier, the kernel would kill the guard, which repeats Stop for a second.
    """
    (pause_s,) = re.findall(r"^time\.sleep\(([\d.]+)\)$", OUTLIVE.read_text(), re.MULTILINE)
    assert float(pause_s) > guard.TIMES * guard.PACE_S
    assert str(OUTLIVE.relative_to(ROOT)) in (ROOT / "docker/Dockerfile").read_text()


DRIVER = "trap 'exit 7' TERM; echo ready; {}; while :; do sleep 0.1; done"


@pytest.mark.parametrize("stop", ["kill -TERM $PPID", "kill -INT $PPID"])
def test_the_first_process_of_a_container_passes_a_stop_on(stop: str) -> None:
    """``docker stop`` sends SIGTERM to the first process, which passes it on to the driver.

    The exit code of the first process is the exit code of the driver.
    """
    command = [sys.executable, OUTLIVE, "bash", "-c", DRIVER.format(stop)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (7, "ready\n", "")


@pytest.mark.slow
def test_a_stop_at_any_moment_of_the_start_ends_the_container() -> None:
    """A SIGTERM at any moment of the driver's start ends all processes of the container."""
    command = [sys.executable, OUTLIVE, "bash", "-c", DRIVER.format("true")]
    containers = []
    for number in range(40):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, process_group=0)
        containers.append(process)
        time.sleep(0.002 * number)  # the moments of a start have no events
        process.terminate()
    try:
        assert {process.wait(60.0) for process in containers} <= {-15, 7, 128 + 15}
        for process in containers:
            with pytest.raises(ProcessLookupError):
                os.killpg(process.pid, 0)
    finally:
        for process in containers:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def test_the_exit_code_of_a_killed_driver_is_that_of_a_shell() -> None:
    """The driver is killed by SIGKILL. The container's exit code is 137, as in a shell."""
    command = [sys.executable, OUTLIVE, "bash", "-c", "kill -KILL $$"]
    assert subprocess.run(command, timeout=60.0, check=False).returncode == 137
