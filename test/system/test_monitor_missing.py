# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the monitor's messages and exit codes if something is missing or wrong."""

import json
import math
import subprocess
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from probe import Probe
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String

from omnibot_driver.tools.monitor.__main__ import main
from omnibot_driver.tools.monitor.feed import Feed

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
QUICKLY = ["--timeout", "4"]
"""Arguments that limit the wait for missing topics to 4 s."""
ROOT = Path(__file__).parents[2]


@pytest.fixture
def fake(stack: ExitStack) -> Probe:
    """An imitation of a driver. It repeats the state "nominal" and publishes no measurements."""
    probe = stack.enter_context(Probe("fake"))
    estop = probe.node.create_publisher(Bool, "omnibot_driver/estop_active", LATCHED)
    estop.publish(Bool(data=False))
    state = probe.node.create_publisher(String, "omnibot_driver/state", LATCHED)
    probe.node.create_timer(0.5, partial(state.publish, String(data="nominal")))
    return probe


def measure(fake: Probe, odometry: Odometry) -> None:
    """Let the fake driver publish this odometry and empty IMU messages at 50 Hz."""
    for topic, message in (("odom", odometry), ("imu/data_raw", Imu())):
        publisher = fake.node.create_publisher(type(message), topic, 10)
        fake.node.create_timer(0.02, partial(publisher.publish, message))


def test_an_estop_that_nobody_confirms_is_said_again(fake: Probe) -> None:
    """The driver has no service ``~/estop``, so the monitor sends ``true`` on the topic ``estop``.

    The monitor repeats this message until the driver reports a latched e-stop.
    """
    said = fake.listen(Bool, "estop")
    feed = Feed([], "fake", "omnibot_driver")
    try:
        fake.wait_for_graph(lambda: feed.view().state)
        feed.estop()
        assert feed.view().estop_asked
        assert "service /fake/omnibot_driver/estop not found" in feed.view().said
        fake.wait_for(lambda: len(said) >= 3 and all(message.data for message in said))
        latch = fake.node.create_publisher(Bool, "omnibot_driver/estop_active", LATCHED)
        latch.publish(Bool(data=True))
        fake.wait_for_graph(lambda: feed.view().estop and not feed.view().estop_asked)
    finally:
        feed.close()


def sentence(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run the monitor, which must fail, and return its only line on stderr."""
    assert main(arguments) == 1
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_without_a_driver_one_sentence_says_how_to_start_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No driver runs. The message names the ROS domain and says how to start a driver."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "100")
    said = sentence(capsys, "--once", "--timeout", "1")
    assert "no driver is running in ROS domain 100: start one" in said


def test_in_a_wrong_namespace_the_drivers_that_are_there_are_named(
    fake: Probe, capsys: pytest.CaptureFixture[str]
) -> None:
    """The user gives a wrong namespace.

    The message names the running drivers, and the option that selects the first of them.
    """
    said = sentence(capsys, "--once", "--namespace", "/elsewhere/", *QUICKLY)
    assert (
        "/elsewhere/omnibot_driver is running, but these drivers are: /fake/omnibot_driver; try"
        in said
    )
    assert said.endswith("try --namespace /fake")


def test_topics_that_are_missing_are_named(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """Some topics have no messages. The monitor names these topics, and prints all other data."""
    assert main(["--once", "--namespace", "fake", *QUICKLY]) == 1
    output = capsys.readouterr()
    assert output.out.startswith("/fake/omnibot_driver  nominal")
    assert "no messages arrive on imu/data_raw, odom" in output.err


def test_two_drivers_of_one_name_are_told(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """Two drivers have the same name.

    The monitor reports this, because its output would mix the data of the two drivers.
    """
    fake.node.create_publisher(String, "omnibot_driver/state", LATCHED)
    measure(fake, Odometry())
    assert main(["--once", "--namespace", "fake"]) == 1
    assert "there are 2 drivers called /fake/omnibot_driver" in capsys.readouterr().err


def test_nan_is_named_and_shown(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """A measurement has NaN.

    The monitor prints it as nan, and one sentence names the fields with NaN.
    """
    bad = Odometry()
    bad.pose.pose.position.x = bad.twist.twist.linear.y = float("nan")
    measure(fake, bad)
    assert main(["--once", "--namespace", "fake"]) == 1
    output = capsys.readouterr()
    assert "nan" in output.out
    assert "these values are NaN or infinite: pose x, measured y" in output.err


def test_a_heading_is_within_half_a_turn(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """The robot has turned by 145° to the left, and its quaternion has a negative w.

    The monitor shows a heading of 145°.
    """
    odometry = Odometry()
    turn = odometry.pose.pose.orientation
    turn.z, turn.w = -math.sin(math.radians(72.5)), -math.cos(math.radians(72.5))
    measure(fake, odometry)
    assert main(["--json", "--namespace", "fake"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["pose"]["yaw_rad"] == pytest.approx(math.radians(145.0))


def test_a_pipe_cannot_steer(capsys: pytest.CaptureFixture[str]) -> None:
    """``--teleop`` is refused without a terminal, because a pipe does not deliver key presses."""
    assert "--teleop needs a terminal" in sentence(capsys, "--teleop")


def test_a_pipe_gets_a_snapshot(fake: Probe, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a terminal, the monitor prints one snapshot, and says why on stderr."""
    measure(fake, Odometry())
    assert main(["--namespace", "fake"]) == 0
    output = capsys.readouterr()
    assert output.out.startswith("/fake/omnibot_driver")
    assert "this is not a terminal, so one snapshot is printed" in output.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--namespace", "a b"], "not a valid driver name"),
        (["--once", "--ros-args", "--nonsense"], "ROS does not start"),
    ],
)
def test_names_that_are_none_are_refused(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An invalid name or ROS argument gives a message and exit code 1, not a traceback."""
    assert main(arguments) == 1
    assert said in capsys.readouterr().err


def test_without_ros_one_sentence_says_so() -> None:
    """In a Python without rclpy the monitor prints one line and exits with code 1."""
    command = [sys.executable, "-ES", "-m", "omnibot_driver.tools.monitor", "--once"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=20.0)
    assert ended.returncode == 1
    assert ended.stderr.startswith("monitor: this program needs ROS 2 Jazzy's Python packages")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("wrong", [["--timeout", "0"], ["--teleop", "--once"], ["--nonsense"]])
def test_wrong_usage_has_exit_code_2(wrong: list[str], capsys: Any) -> None:
    """The user gives wrong arguments. The monitor shows its usage and exits with code 2."""
    with pytest.raises(SystemExit) as ended:
        main(wrong)
    assert ended.value.code == 2
    assert "usage: monitor" in capsys.readouterr().err
