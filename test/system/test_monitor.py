# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""The monitor on a terminal and in a pipe, with a real driver on a simulated board."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from driver_process import Driver
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from probe import Probe
from pseudo_terminal import PseudoTerminal
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String

from omnibot_driver.simulator import PtyBoard, SimulatedBoard
from omnibot_driver.tools.monitor.__main__ import main
from omnibot_driver.tools.monitor.feed import Feed
from omnibot_driver.tools.monitor.teleop import ZEROS

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
QUICKLY = ["--timeout", "1"]
ROOT = Path(__file__).parents[2]


def newest(board: SimulatedBoard) -> tuple[str, tuple[int, ...]]:
    return (board.commands[-1].kind, board.commands[-1].values) if board.commands else ("", ())


def drives(board: SimulatedBoard) -> bool:
    return newest(board) in (
        ("velocity", (speed, 0, 0)) for speed in (10, 11)
    )  # 0.15 m/s: 10.5 LSB


def stands(board: SimulatedBoard) -> bool:
    return newest(board) == ("wheels", (0, 0, 0))


@pytest.fixture
def monitor_of(stack: ExitStack) -> Callable[..., PseudoTerminal]:
    def start(driver: Driver, *options: str) -> PseudoTerminal:
        command = [sys.executable, "-m", "omnibot_driver.tools.monitor", *options]
        terminal = PseudoTerminal([*command, "--namespace", f"/{driver.namespace}"])
        return stack.enter_context(terminal)

    return start


def test_a_snapshot_in_a_pipe_tells_what_is_so(
    probe: Probe, driver: Driver, board: PtyBoard, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half a metre to the left: JSON has the board's true pose, its rates and its state."""
    odometry = probe.listen(Odometry, "odom")
    commands = probe.publisher(Twist, "cmd_vel")
    twist = Twist()
    twist.linear.y = 0.4

    def drive() -> bool:
        commands.publish(twist)
        return bool(odometry and odometry[-1].pose.pose.position.y > 0.5)

    probe.wait_for(drive)
    commands.publish(Twist())
    assert board.wait_for(lambda b: abs(b.truth.vy_mps) < 1e-3, 20.0)
    assert main(["--json", "--namespace", driver.namespace]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    told = json.loads(output.out)
    with board.lock:
        truth = board.board.truth
    assert told["driver"] == f"/{driver.namespace}/omnibot_driver"
    assert (told["state"], told["estop"], told["troubles"]) == ("nominal", False, [])
    assert told["pose"]["y_m"] == pytest.approx(truth.y_m, abs=2e-3)
    assert told["pose"]["x_m"] == pytest.approx(truth.x_m, abs=2e-3)
    rates_hz = told["rates_hz"]
    assert rates_hz["imu/data_raw"] / rates_hz["odom"] == pytest.approx(4.0, rel=0.15)
    assert abs(told["imu"]["linear_acceleration_mps2"][2]) == pytest.approx(9.8, abs=0.5)
    assert told["diagnostics"]["Link"]["values"]["Port"] == board.path


def test_the_space_bar_latches_the_estop_and_two_keys_release_it(
    probe: Probe, driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """The board hears it, the screen shows it; then R and y let go."""
    terminal = monitor_of(driver)
    terminal.wait_for("nominal")
    terminal.type(" ")
    assert board.wait_for(lambda b: newest(b)[0] == "estop", 20.0)
    terminal.wait_for("LATCHED")
    terminal.type("R")
    terminal.wait_for("Release")
    terminal.type("y")
    assert board.wait_for(stands, 20.0)
    terminal.wait_for("not latched")
    terminal.type("q")
    assert terminal.end() == 0


def test_who_lets_go_of_the_key_stops_the_robot(
    probe: Probe, driver: Driver, board: PtyBoard, monitor_of: Callable[..., PseudoTerminal]
) -> None:
    """One press: motion, then a few commands to stand still, then none; leaving says it again."""
    said = probe.listen(Twist, "cmd_vel")
    terminal = monitor_of(driver, "--teleop")
    terminal.wait_for("0.15 m/s")
    terminal.type("w")
    assert board.wait_for(drives, 20.0)
    assert board.wait_for(stands, 20.0)
    probe.wait_for(lambda: [twist.linear.x for twist in said[-ZEROS:]] == [0.0] * ZEROS)
    terminal.type("q")
    assert terminal.end() == 0
    speeds = [twist.linear.x for twist in said]
    moving = speeds.index(0.0)
    assert speeds[:moving] == pytest.approx([0.15] * moving)
    probe.wait_for(lambda: [twist.linear.x for twist in said[moving:]] == [0.0] * (ZEROS + 1))


def test_a_monitor_that_is_ended_stops_what_it_steered(
    board: PtyBoard,
    start_driver: Callable[..., Driver],
    probe_of: Callable[[Driver], Probe],
    monitor_of: Callable[..., PseudoTerminal],
) -> None:
    """Killed, or its window closed, in the middle of a motion; here with stamped commands."""
    driver = start_driver(board.path, enable_stamped_cmd_vel=True, cmd_vel_timeout=5.0)
    probe_of(driver).wait_for_state("nominal")

    def kill(terminal: PseudoTerminal) -> None:
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.end() == 0

    for end in (kill, PseudoTerminal.hang_up):
        terminal = monitor_of(driver, "--teleop")
        terminal.wait_for("0.15 m/s")
        terminal.type("w")
        assert board.wait_for(drives, 20.0)
        end(terminal)
        assert board.wait_for(stands, 4.0)


# Without a driver that is one


@pytest.fixture
def fake(stack: ExitStack) -> Probe:
    """Says that it is a driver that runs, and nothing else."""
    probe = stack.enter_context(Probe("fake"))
    for kind, topic, value in ((String, "state", "nominal"), (Bool, "estop_active", False)):
        publisher = probe.node.create_publisher(kind, f"omnibot_driver/{topic}", LATCHED)
        publisher.publish(kind(data=value))
    return probe


def test_an_estop_that_nobody_confirms_is_said_again(fake: Probe) -> None:
    """By topic where the service is missing, until the driver shows the latch."""
    said = fake.listen(Bool, "estop")
    feed = Feed([], "fake", "omnibot_driver")
    try:
        fake.wait_for_graph(lambda: feed.view().state)
        feed.estop()
        assert feed.view().estop_asked
        assert "nobody offers /fake/omnibot_driver/estop" in feed.view().said
        fake.wait_for(lambda: len(said) >= 3 and all(message.data for message in said))
        latch = fake.node.create_publisher(Bool, "omnibot_driver/estop_active", LATCHED)
        latch.publish(Bool(data=True))
        fake.wait_for_graph(lambda: feed.view().estop and not feed.view().estop_asked)
    finally:
        feed.close()


def sentence(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What it says on stderr when it cannot do what is wanted: one line."""
    assert main(arguments) == 1
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_without_a_driver_one_sentence_says_how_to_start_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the domain that was searched."""
    domain = str((int(os.environ["ROS_DOMAIN_ID"]) + 50) % 101 + 1)
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    said = sentence(capsys, "--once", *QUICKLY)
    assert f"no driver is running in ROS domain {domain}: start one" in said


def test_in_a_wrong_namespace_the_drivers_that_are_there_are_named(
    fake: Probe, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the option that leads to the first of them."""
    said = sentence(capsys, "--once", "--namespace", "elsewhere", *QUICKLY)
    assert "no driver /elsewhere/omnibot_driver here, but /fake/omnibot_driver" in said
    assert said.endswith("try --namespace /fake")


def test_topics_that_are_missing_are_named(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """What there is is printed all the same."""
    assert main(["--once", "--namespace", "fake", *QUICKLY]) == 1
    output = capsys.readouterr()
    assert output.out.startswith("/fake/omnibot_driver  nominal")
    assert "nothing comes on imu/data_raw, odom" in output.err


def test_nan_is_named_and_shown(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """Where a number would be, and in one sentence."""
    bad = Odometry()
    bad.pose.pose.position.x = bad.twist.twist.linear.y = float("nan")
    publisher = fake.node.create_publisher(Odometry, "odom", 10)
    fake.node.create_timer(0.02, lambda: publisher.publish(bad))
    assert main(["--once", "--namespace", "fake", *QUICKLY]) == 1
    output = capsys.readouterr()
    assert "nan" in output.out
    assert "not a finite number: pose x, measured y" in output.err


def test_a_pipe_cannot_steer(capsys: pytest.CaptureFixture[str]) -> None:
    """It has no keys."""
    assert "--teleop needs a terminal" in sentence(capsys, "--teleop")


def test_a_pipe_gets_a_snapshot(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """As with --once, and one sentence says so."""
    main(["--namespace", "fake", *QUICKLY])
    output = capsys.readouterr()
    assert output.out.startswith("/fake/omnibot_driver")
    assert "no terminal here, so this is a snapshot" in output.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--namespace", "a b"], "no such driver can be"),
        (["--once", "--ros-args", "--nonsense"], "ROS does not start"),
    ],
)
def test_names_that_are_none_are_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a sentence, not in a traceback."""
    assert main(arguments) == 1
    assert said in capsys.readouterr().err


def test_without_ros_one_sentence_says_so() -> None:
    """A Python without site-packages has no rclpy: no traceback, exit code 1."""
    command = [sys.executable, "-ES", "-m", "omnibot_driver.tools.monitor", "--once"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=20.0)
    assert ended.returncode == 1
    assert ended.stderr.startswith("monitor: this needs ROS 2 Jazzy's Python packages")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("wrong", [["--timeout", "0"], ["--teleop", "--once"], ["--nonsense"]])
def test_wrong_usage_has_exit_code_2(wrong: list[str], capsys: Any) -> None:
    """And the usage is shown."""
    with pytest.raises(SystemExit) as ended:
        main(wrong)
    assert ended.value.code == 2
    assert "usage: monitor" in capsys.readouterr().err
