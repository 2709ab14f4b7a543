# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Tests of the checks at the driver's start: the adapter's timer, the clock, and other nodes.

A temporary folder imitates sysfs.
"""

from pathlib import Path
from types import SimpleNamespace

import pytest

from omnibot_driver import selfcheck


def adapter(root: Path, device: str, latency: str) -> Path:
    """Make an imitation of sysfs in the folder ``root``, with one adapter. Return the folder."""
    folder = root / "class/tty" / device / "device"
    folder.mkdir(parents=True)
    (folder / "latency_timer").write_text(latency)
    return root


def test_an_adapter_that_keeps_bytes_is_told_of_with_the_remedy(tmp_path: Path) -> None:
    """For an adapter with FTDI's default latency timer, the message names two remedies.

    One remedy is permanent, the other is temporary.
    """
    text = selfcheck.latency_advice("/dev/ttyUSB0", adapter(tmp_path, "ttyUSB0", "16\n"))
    assert "16 ms" in text
    assert "udev/99-omnibot.rules" in text
    assert text.endswith("echo 1 | sudo tee /sys/class/tty/ttyUSB0/device/latency_timer")


def test_a_link_leads_to_the_adapter(tmp_path: Path) -> None:
    """The port is a symbolic link to an adapter, such as /dev/omnibot. The adapter is found."""
    sysfs = adapter(tmp_path / "sys", "ttyUSB7", "16\n")
    (tmp_path / "ttyUSB7").touch()
    link = tmp_path / "omnibot"
    link.symlink_to(tmp_path / "ttyUSB7")
    text = selfcheck.latency_advice(str(link), sysfs)
    assert str(link) in text
    assert "/sys/class/tty/ttyUSB7/" in text


@pytest.mark.parametrize("latency", ["1\n", "5\n", "", "soon\n"])
def test_a_short_timer_or_one_that_says_nothing_is_left_alone(tmp_path: Path, latency: str) -> None:
    """The check gives no message if the latency timer is short, or if its value is unreadable."""
    assert selfcheck.latency_advice("/dev/ttyUSB0", adapter(tmp_path, "ttyUSB0", latency)) == ""


@pytest.mark.parametrize("port", ["/dev/ttyACM0", "/dev/pts/3", "socket://host:1", "sim://", ""])
def test_a_port_without_such_a_timer_is_left_alone(tmp_path: Path, port: str) -> None:
    """A pseudo-terminal or a URL, for example, has no latency timer. The check gives no message."""
    assert selfcheck.latency_advice(port, adapter(tmp_path, "ttyUSB0", "16\n")) == ""


@pytest.mark.parametrize(
    ("port", "use_sim_time", "warned"),
    [
        ("/dev/ttyUSB0", True, True),
        ("socket://host:1", True, True),
        ("/dev/ttyUSB0", False, False),
        ("sim://", True, False),
        ("replay://bag", True, False),
        ("SIM://", True, False),
        ("Replay://bag", True, False),
    ],
)
def test_simulated_time_on_a_port_of_the_real_world_is_told_of(
    port: str, use_sim_time: bool, warned: bool
) -> None:
    """Simulated time on a real port leads to a warning: stamps and ages would be wrong."""
    text = selfcheck.clock_advice(port, use_sim_time)
    assert bool(text) == warned
    assert not warned or (port in text and "use_sim_time:=false" in text)


@pytest.mark.parametrize("prefix", ["", "robot1/", "robot1_", "a/b/"])
def test_a_prefix_that_ends_with_a_separator_is_left_alone(prefix: str) -> None:
    """A frame prefix is empty or ends with a slash or an underscore. There is no warning."""
    assert selfcheck.prefix_advice(prefix) == ""


@pytest.mark.parametrize("prefix", ["robot1", "a/b"])
def test_a_prefix_without_its_slash_is_told_of_with_the_remedy(prefix: str) -> None:
    """A frame prefix ends without a slash. The warning shows a resulting name such as robot1odom.

    It also says what to set instead.
    """
    advice = selfcheck.prefix_advice(prefix)
    assert f"is named {prefix}odom;" in advice
    assert advice.endswith(f"set frame_prefix to {prefix}/")


@pytest.mark.parametrize(
    ("port", "now_ns", "warned"),
    [
        ("/dev/ttyUSB0", 0, True),
        ("sim://?imu_only", 0, True),
        ("sim://", 1, False),
        ("replay://bag", 0, False),
        ("REPLAY://bag", 0, False),
    ],
)
def test_simulated_time_that_has_not_begun_is_told_of(port: str, now_ns: int, warned: bool) -> None:
    """With simulated time, the driver warns if /clock is not published, except in a replay."""
    assert ("nothing publishes /clock" in selfcheck.waiting_advice(port, now_ns)) == warned


@pytest.mark.parametrize(
    ("others", "warned"),
    [
        ([], False),
        ([("/", "omnibot_driver")], True),
        ([("/robot2", "omnibot_driver"), ("/", "rosbag2_player")], False),
    ],
)
def test_a_node_of_the_same_full_name_is_told_of(
    others: list[tuple[str, str]], warned: bool
) -> None:
    """The driver reports another node if its full name is the same.

    It does not report a node that has the same name in another namespace.
    """
    publishers = [
        SimpleNamespace(node_namespace=namespace, node_name=name)
        for namespace, name in [("/", "omnibot_driver"), *others]
    ]
    text = selfcheck.namesake_advice("/omnibot_driver", publishers)
    assert ("another node has the name /omnibot_driver," in text) == warned


def publisher(name: str, kind: str) -> SimpleNamespace:
    return SimpleNamespace(node_name=name, topic_type=f"geometry_msgs/msg/{kind}")


def test_publishers_of_the_other_type_are_named_with_the_remedy() -> None:
    """Only some publishers of cmd_vel use the wrong message type. The warning names them.

    A parameter decides which of the two types is the right one.
    """
    teleop, nav = publisher("teleop", "Twist"), publisher("nav", "TwistStamped")
    assert selfcheck.type_conflict([teleop], stamped=False) == ""
    assert selfcheck.type_conflict([nav], stamped=True) == ""
    text = selfcheck.type_conflict([teleop, nav, nav], stamped=False)
    assert text.startswith("nav publishes")
    assert text.endswith("enable_stamped_cmd_vel:=true")
    text = selfcheck.type_conflict([teleop, nav], stamped=True)
    assert text.startswith("teleop publishes")
    assert text.endswith("enable_stamped_cmd_vel:=false")


SECTION = "{name}:\n  ros__parameters:\n    max_linear_speed: 0.1\n"


@pytest.mark.parametrize(
    ("content", "read"),
    [
        (SECTION.format(name="/**"), True),
        (SECTION.format(name="/robot1/omnibot_driver"), True),
        (SECTION.format(name="/robot1/*"), True),
        (SECTION.format(name="/**/omnibot_driver"), True),
        ("robot1:\n  omnibot_driver:\n    ros__parameters: {max_linear_speed: 0.1}\n", True),
        ("/:\n  robot1:\n    omnibot_driver:\n      ros__parameters: {port: x}\n", True),
        (SECTION.format(name="/*"), False),
        (SECTION.format(name="omnibot_driver"), False),
        (SECTION.format(name="/robot2/omnibot_driver"), False),
        ("", False),
        (SECTION.format(name="omnibot_driver") + SECTION.format(name="/**"), True),
    ],
)
def test_a_parameter_file_for_another_node_is_told_of(
    tmp_path: Path, content: str, read: bool
) -> None:
    """The driver reports a parameter file that names only other nodes.

    ROS ignores such a file without a message. The driver's message names the file and the node.
    """
    file = tmp_path / "robot.yaml"
    file.write_text(content)
    arguments = ["driver", "--ros-args", "--params-file", str(file), "-p", "port:=sim://"]
    told = selfcheck.unread_files(arguments, "/robot1/omnibot_driver")
    assert bool(told) is not read
    assert all(str(file) in text and "/robot1/omnibot_driver;" in text for text in told)
