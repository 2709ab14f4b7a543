# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the demo: its steering, its display, and the complete program as a user runs it."""

import math
import os
import re
import select
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pseudo_terminal import PseudoTerminal

import omnibot_driver
from omnibot_driver import boards
from omnibot_driver.core.geometry.se2 import Pose
from omnibot_driver.core.geometry.twist import BodyTwist
from omnibot_driver.demo import display, square
from omnibot_driver.demo.__main__ import main
from omnibot_driver.demo.capability import Capability
from omnibot_driver.demo.capability import of as capability_of

PATIENCE_S = 60.0
ROOT = Path(omnibot_driver.__file__).parents[1]
MARKER = "OMNIBOT_DEMO_TEST"
CORNERS = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))

coordinates = st.floats(-3.0, 3.0)
poses = st.builds(Pose, coordinates, coordinates, st.floats(-10.0, 10.0))


@given(poses, st.integers(0, 1000))
def test_steering_never_exceeds_the_speeds_of_the_demo(pose: Pose, leg: int) -> None:
    """Whatever the robot's pose, the demo commands a motion within the demo's speed limits."""
    _, twist = square.steer(pose, leg)
    assert 0.0 < math.hypot(twist.vx_mps, twist.vy_mps) <= square.SPEED_MPS + 1e-9
    assert abs(twist.yaw_rate_radps) <= square.YAW_RATE_RADPS


@given(poses, st.integers(0, 1000))
def test_a_robot_that_cannot_drive_sideways_is_never_told_to(pose: Pose, leg: int) -> None:
    """A robot cannot drive sideways. ``steer_ahead`` only commands it to drive ahead or to turn."""
    _, twist = square.steer_ahead(pose, leg)
    assert twist.vy_mps == 0.0
    assert 0.0 <= twist.vx_mps <= square.SPEED_MPS
    assert abs(twist.yaw_rate_radps) <= square.YAW_RATE_RADPS
    assert twist.vx_mps > 0.0 or abs(twist.yaw_rate_radps) > 0.1


@given(st.integers(0, 1000), st.floats(0.0, 0.009), st.floats(-math.pi, math.pi))
def test_a_corner_turns_the_robot_to_the_next_side(leg: int, before_m: float, yaw: float) -> None:
    """The robot is close to the corner at the end of a side.

    The demo commands it along the next side.
    """
    x_m, y_m = CORNERS[leg % 4]
    direction = leg * math.pi / 2
    pose = Pose(x_m - before_m * math.cos(direction), y_m - before_m * math.sin(direction), yaw)
    next_leg, twist = square.steer(pose, leg)
    heading = math.atan2(twist.vy_mps, twist.vx_mps) + yaw
    assert next_leg == leg + 1
    assert abs(math.remainder(heading - direction - math.pi / 2, math.tau)) < 0.15


@pytest.mark.parametrize(("steer", "yaw_at_the_end"), [(square.steer, 0), (square.steer_ahead, 3)])
@settings(max_examples=20)
@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.1, 0.1))
def test_the_square_closes(
    steer: Any, yaw_at_the_end: int, x_m: float, y_m: float, yaw_rad: float
) -> None:
    """A robot that follows commands with a lag of 0.1 s drives a lap through all four corners."""
    pose, leg, step_s, lag_s = Pose(x_m, y_m, yaw_rad), 0, 0.08, 0.1
    moving = BodyTwist(0.0, 0.0, 0.0)
    nearest = [math.inf] * 4
    for _ in range(round(40.0 / step_s)):
        leg, wanted = steer(pose, leg)
        if leg == 4:
            break
        moving = BodyTwist(
            *(
                now + (then - now) * step_s / lag_s
                for now, then in (
                    (moving.vx_mps, wanted.vx_mps),
                    (moving.vy_mps, wanted.vy_mps),
                    (moving.yaw_rate_radps, wanted.yaw_rate_radps),
                )
            )
        )
        step = Pose(moving.vx_mps * step_s, moving.vy_mps * step_s, moving.yaw_rate_radps * step_s)
        pose = pose.moved(step)
        nearest = [
            min(so_far, math.dist((pose.x_m, pose.y_m), corner))
            for so_far, corner in zip(nearest, CORNERS, strict=True)
        ]
    assert leg == 4
    assert max(nearest) < 0.02
    assert abs(math.remainder(pose.yaw_rad - yaw_at_the_end * math.pi / 2, math.tau)) < 0.05


@given(poses, st.integers(0, 10_000), coordinates, st.sampled_from(["nominal", "disconnected"]))
def test_a_status_row_stands_under_its_heading(
    pose: Pose, leg: int, speed: float, state: str
) -> None:
    """Every status row is as wide as its heading, which is narrower than 80 columns."""
    twist = BodyTwist(speed, -speed, speed / 10)
    row = display.status_row(state, (100, 25), leg, pose, twist, twist)
    assert len(row) == len(display.HEADING.splitlines()[-1]) < 80
    assert len(display.status_row(state, (None, 25), leg, pose, twist, twist)) == len(row)


@contextmanager
def running_demo(**environment: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run a demo. Yield its process and a mark in the environment of all its processes.

    At the end, kill all processes with the mark.
    """
    mark = uuid.uuid4().hex
    with subprocess.Popen(
        [sys.executable, "-m", "omnibot_driver.demo"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONPATH": _python_path(), MARKER: mark, **environment},
    ) as process:
        try:
            yield process, mark
        finally:
            for pid in marked(mark):
                os.kill(pid, signal.SIGKILL)


def _python_path() -> str:
    return os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))


def marked(mark: str, name: str = "") -> list[int]:
    """Return the ids of the processes that have ``mark`` in their environment.

    With ``name``, only processes with this text in their command line are returned.
    """
    found = []
    for directory in Path("/proc").glob("[0-9]*"):
        try:
            environment = (directory / "environ").read_bytes()
            command = (directory / "cmdline").read_bytes()
        except OSError:
            continue
        if f"{MARKER}={mark}".encode() in environment and name.encode() in command:
            found.append(int(directory.name))
    return found


def wait_until_all_have_ended(mark: str) -> None:
    """Wait until all processes with ``mark`` in their environment have ended.

    Waiting is necessary, for example because a guard ends later than its driver.
    """
    for pid in marked(mark):
        try:
            process = os.pidfd_open(pid)
        except ProcessLookupError:
            continue
        ended = select.select([process], [], [], PATIENCE_S)[0]
        os.close(process)
        assert ended, f"process {pid} still runs"
    assert marked(mark) == []


def read_until_it_drives(process: subprocess.Popen[str]) -> None:
    """Read the output of the demo up to the first row with a measured speed."""
    assert process.stdout is not None
    for line in process.stdout:
        if re.match(r"nominal .* [ -]0\.[1-9]\d +-?\d\.\d\d +-?\d\.\d\d$", line):
            return
    raise AssertionError("the demo ended before it drove")


def test_some_seconds_end_with_a_small_pose_error_and_nothing_left() -> None:
    """After 5 s the demo ends with code 0. The odometry error is below 10 mm and 2°.

    No process is left.
    """
    with running_demo(DEMO_SECONDS="5") as (process, mark):
        output, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, output
        wait_until_all_have_ended(mark)
    error = re.search(r"^pose error +(\d+\.\d) mm, (\d+\.\d\d)°$", output, re.MULTILINE)
    rates = re.search(r"imu (\d+\.\d) Hz, odom (\d+\.\d) Hz", output)
    driven = re.search(r"driven +(\d+\.\d+) m in .* s, ([\d.]+) laps?", output)
    assert error, output
    assert rates, output
    assert driven, output
    assert float(error[1]) < 10.0
    assert float(error[2]) < 2.0
    assert float(rates[1]) > 2 * float(rates[2])  # a busy computer loses some of the IMU's
    assert float(driven[2]) > 0.0
    assert float(driven[2]) == pytest.approx(float(driven[1]) / 4, abs=0.3)
    assert "no driver" not in output
    closing = output[output.index("pose error") :]
    assert closing.index("first lift its wheels off the ground") < closing.index("/dev/ttyUSB0")


@pytest.mark.parametrize(("laps", "told"), [(0.0, "0 laps"), (1.0, "1 lap"), (1.25, "1.25 laps")])
def test_laps_are_told_in_english(
    laps: float, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The demo reports "1 lap", but "0 laps" and "1.25 laps"."""
    display.report(
        display.Drive(
            seconds=20.0,
            way_m=4.0 * laps,
            laps=laps,
            imu_hz=100.0,
            odom_hz=25.0,
            pose=Pose(),
            true_pose=Pose(),
            points=[],
            real="-p port:=/dev/ttyUSB0",
            page="docs/boards/omnibot.md",
        )
    )
    assert f" s, {told}\n" in capsys.readouterr().out


def test_a_robot_without_an_imu_and_without_sideways_motion_is_told_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The demo runs for a robot without an IMU that cannot drive sideways.

    Its text says that the robot turns at the corners. It does not mention IMU data.
    """
    real = "-p board:=cart -p port:=/dev/ttyUSB0"
    page = "docs/boards/cart.md"
    cart = Capability(
        title="cart", imu=False, sideways=False, ports=("port",), real=real, page=page
    )
    display.introduce(cart, (" --board cart", "-p board:=cart -p port:=/dev/pts/1"), "/d", "X=1", 9)
    display.report(
        display.Drive(
            seconds=20.0,
            way_m=4.0,
            laps=1.0,
            imu_hz=None,
            odom_hz=20.0,
            pose=Pose(),
            true_pose=Pose(),
            points=[],
            real=real,
            page=page,
        )
    )
    told = capsys.readouterr().out
    assert "A simulated cart drives a square of 1 m, turning at its corners." in told
    assert "imu/" not in told
    assert "imu " not in told
    assert "received    odom 20.0 Hz\n" in told
    assert told.endswith(f"--ros-args {real}\n")


@pytest.mark.parametrize("name", boards.PROFILES)
def test_every_board_has_a_demo(name: str) -> None:
    """The profile of each board gives the title and the ports that the demo needs."""
    capability = capability_of(name)
    assert any(capability.ports)
    assert capability.title


def test_an_unknown_board_gives_one_sentence_and_exit_code_2(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The user names an unknown board. The demo prints one line and starts nothing."""
    assert main(["--board", "zeppelin"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("demo: parameter 'board' must be one of omnibot")
    assert told.count("\n") == 1


def test_on_a_terminal_the_monitor_shows_it() -> None:
    """The demo runs on a terminal. The monitor shows the driver.

    When the user quits the monitor, the demo prints its result.
    """
    with PseudoTerminal([sys.executable, "-m", "omnibot_driver.demo"]) as terminal:
        terminal.wait_for("ros2 topic hz /demo_")
        terminal.wait_for("/omnibot_driver  nominal")
        terminal.wait_for("commanded m/s rad/s   0.2")
        terminal.type("q")
        terminal.wait_for("pose error")
        assert terminal.end() == 0


def test_a_signal_on_the_way_ends_it_cleanly() -> None:
    """SIGINT arrives during the drive. The demo prints its result and exits with code 0.

    No process of the demo is left. (Another test sends SIGTERM instead of SIGINT.)
    """
    with running_demo() as (process, mark):
        read_until_it_drives(process)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, output
        wait_until_all_have_ended(mark)
    assert "pose error" in output
    assert "Traceback" not in output


def test_who_ends_it_before_it_drives_is_told_so() -> None:
    """SIGTERM ends the demo before the robot has driven. The demo's last line says this."""
    with running_demo() as (process, mark):
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("state "):
                break
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, output
        wait_until_all_have_ended(mark)
    assert output.splitlines()[-1] == "The demo was ended before the robot drove."


def test_the_end_of_the_driver_ends_the_demo_with_its_last_words() -> None:
    """The driver is killed during the demo. The demo reports this and exits with code 1.

    The simulator ends, too.
    """
    with running_demo() as (process, mark):
        read_until_it_drives(process)
        (driver,) = marked(mark, "omnibot_driver.driver")
        os.kill(driver, signal.SIGKILL)
        output, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 1, output
        wait_until_all_have_ended(mark)
    assert "the driver ended with code -9" in output
    assert "state: nominal" in output


def test_a_killed_demo_leaves_nobody_behind() -> None:
    """The demo is killed by SIGKILL. The simulator and the driver end by themselves."""
    with running_demo() as (process, mark):
        read_until_it_drives(process)
        process.kill()
        process.wait()
        wait_until_all_have_ended(mark)


@pytest.mark.parametrize("value", ["soon", "0", "-3", "nan"])
def test_wrong_seconds_are_refused_in_one_sentence(
    value: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``DEMO_SECONDS`` is invalid. The demo prints one line and exits with code 2."""
    monkeypatch.setenv("DEMO_SECONDS", value)
    assert main([]) == 2
    assert capsys.readouterr().err == f"DEMO_SECONDS must be a number above 0, not {value!r}\n"


def test_an_argument_that_it_does_not_know_drives_nothing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The user gives an unknown argument. The demo's message names it, and the exit code is 2."""
    with pytest.raises(SystemExit) as ended:
        main(["port:=/dev/ttyUSB0"])
    assert ended.value.code == 2
    assert "unrecognized arguments: port:=/dev/ttyUSB0" in capsys.readouterr().err


def test_without_ros_it_says_so_in_one_sentence() -> None:
    """In a Python without rclpy the demo prints one line and exits with code 1."""
    ended = subprocess.run(
        [sys.executable, "-ES", "-m", "omnibot_driver.demo"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith("The demo needs ROS 2 Jazzy's Python packages")
    assert ended.stderr.count("\n") == 1
